"""Writers of point clouds in every format that is read, and what reading a bad one says, for tests."""

import numpy as np
import pytest

from mbf_mesh_nav.building.clouds.point_cloud import read_clouds
from mbf_mesh_nav.mesh.mesh_report import MeshError

POINTS = np.round(np.random.default_rng(5).uniform((0, 0, 0), (30, 20, 4), (400, 3)), 3)
PCD_HEADER = """\
VERSION 0.7
FIELDS x _ y z
SIZE {size} 1 {size} {size}
TYPE F U F F
COUNT 1 3 1 1
WIDTH {width}
HEIGHT {height}
VIEWPOINT 0 0 0 1 0 0 0
POINTS {count}
DATA {form}
"""


def refusal(file, **options):
    """The text with which a file is refused."""
    with pytest.raises(MeshError) as caught:
        read_clouds([file], **options)
    return str(caught.value)


def write_ply(file, points, form="binary_little_endian", kind="double", promised=None):
    """Write a PLY without faces, with a colour between the coordinates."""
    count = len(points) if promised is None else promised
    lines = ["ply", f"format {form} 1.0", "comment by a test", "element sensor 1", "property float gain"]
    lines += [f"element vertex {count}", f"property {kind} x", "property uchar red"]
    lines += [f"property {kind} y", f"property {kind} z", "end_header", ""]
    head = "\n".join(lines).encode()
    if form == "ascii":
        rows = "".join(f"{x!r} 7 {y!r} {z!r}\n" for x, y, z in points.tolist())
        file.write_bytes(head + b"1.5\n" + rows.encode())
        return file
    order = ">" if "big" in form else "<"
    float_type = order + ("f8" if kind == "double" else "f4")
    records = np.zeros(len(points), dtype=[("x", float_type), ("red", "u1"), ("y", float_type), ("z", float_type)])
    for axis, name in enumerate("xyz"):
        records[name] = points[:, axis]
    file.write_bytes(head + np.array([1.5], order + "f4").tobytes() + records.tobytes())
    return file


def write_pcd(file, points, form="binary", size=8, height=1, promised=None):
    """Write a PCD with three bytes of padding between the coordinates."""
    count = len(points) if promised is None else promised
    head = PCD_HEADER.format(size=size, width=count // height, height=height, count=count, form=form).encode()
    records = np.zeros(
        len(points), dtype=[("x", f"<f{size}"), ("pad", "u1", 3), ("y", f"<f{size}"), ("z", f"<f{size}")]
    )
    for axis, name in enumerate("xyz"):
        records[name] = points[:, axis]
    if form == "ascii":
        body = "".join(f"{x!r} 0 0 0 {y!r} {z!r}\n" for x, y, z in points.tolist()).encode()
    elif form == "binary":
        body = records.tobytes()
    else:
        block = b"".join(np.ascontiguousarray(records[name]).tobytes() for name in records.dtype.names)
        packed = lzf_compressed(block)
        body = np.array([len(packed), len(block)], "<u4").tobytes() + packed
    file.write_bytes(head + body)
    return file


def write_las(file, points, scale=0.001, offset=(0.0, 0.0, 0.0), classes=None, well_known_text="", geo_keys=()):
    """Write a LAS or LAZ file of version 1.4."""
    import laspy

    header = laspy.LasHeader(point_format=6, version="1.4")
    header.scales, header.offsets = np.full(3, scale), np.asarray(offset)
    if well_known_text:
        header.vlrs.append(laspy.vlrs.known.WktCoordinateSystemVlr(well_known_text))
    if geo_keys:
        numbers = [1, 1, 0, len(geo_keys), *(number for key, value in geo_keys for number in (key, 0, 1, value))]
        header.vlrs.append(laspy.VLR("LASF_Projection", 34735, "", np.array(numbers, "<u2").tobytes()))
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = points.T
    if classes is not None:
        cloud.classification = classes
    cloud.write(str(file))
    return file


def write_text(file, points, delimiter=" ", head=""):
    """Write a table of coordinates."""
    rows = "".join(delimiter.join(map(repr, row)) + "\n" for row in points.tolist())
    file.write_text(head + rows)
    return file


def lzf_compressed(content):
    """LZF block by greedy search for earlier triples of bytes."""
    packed, literals, seen, place = bytearray(), bytearray(), {}, 0

    def flush():
        for start in range(0, len(literals), 32):
            part = literals[start : start + 32]
            packed.extend([len(part) - 1, *part])
        literals.clear()

    while place < len(content):
        triple = content[place : place + 3]
        source = seen.get(triple, -1) if len(triple) == 3 else -1
        seen[triple] = place
        if source < 0 or place - source > 8192:
            literals.append(content[place])
            place += 1
            continue
        flush()
        length = 3
        while length < 264 and place + length < len(content) and content[place + length] == content[source + length]:
            length += 1
        distance, code = place - source - 1, length - 2
        packed.append((min(code, 7) << 5) | (distance >> 8))
        if code >= 7:
            packed.append(code - 7)
        packed.append(distance & 255)
        place += length
    flush()
    return bytes(packed)


def lzf_naive(block):
    """LZF by its definition, for sound blocks."""
    content, place = bytearray(), 0
    while place < len(block):
        control, place = block[place], place + 1
        if control < 32:
            content += block[place : place + control + 1]
            place += control + 1
            continue
        length = control >> 5
        if length == 7:
            length, place = length + block[place], place + 1
        source, place = len(content) - ((control & 31) << 8) - block[place] - 1, place + 1
        for step in range(length + 2):
            content.append(content[source + step])
    return bytes(content)
