"""Point clouds of the Point Cloud Library: PCD 0.7, ascii, binary and binary_compressed.

Format: pointclouds.org, "The PCD (Point Cloud Data) file format". An organised cloud (HEIGHT above 1) has a place for
every pixel of a camera; pixels without a return are NaN by that format, so they are left out here.
"""

from __future__ import annotations

from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.building.clouds.stored_points import StoredPoints, coordinates, read_records, refuse_count
from mbf_mesh_nav.building.clouds.text_points import read_rows
from mbf_mesh_nav.kernels.building.lzf import lzf_decompress
from mbf_mesh_nav.mesh.mesh_report import MeshError

KINDS = {"F": "f", "I": "i", "U": "u"}
LENGTHS = {"F": (4, 8), "I": (1, 2, 4, 8), "U": (1, 2, 4, 8)}
MAX_HEADER_LINES = 100
MAX_RECORD_BYTES = 4096
MOST_EXPANSION = 88
"""Three bytes of an LZF block stand for at most 264."""


def read_pcd_points(path: Path, max_points: int) -> StoredPoints:
    """Read the points of a PCD file.

    Raises
    ------
    MeshError
        No PCD, cut off, damaged, more than ``max_points`` points, or points without x, y and z.
    """
    with path.open("rb") as file:
        header = _read_header(path, file)
        try:
            record = _record(header)
            width, height = _whole(header, "WIDTH"), _whole(header, "HEIGHT")
            count = _whole(header, "POINTS") if "POINTS" in header else width * height
            form = " ".join(header["DATA"])
        except ValueError as error:
            raise MeshError(str(path), [f"its header is not a PCD header: {error}"]) from error
        if count != width * height:
            raise MeshError(str(path), [f"POINTS {count} is not WIDTH {width} x HEIGHT {height}"])
        refuse_count(path, count, max_points)
        if form == "ascii":
            stored = _read_text(path, file, record, count)
        elif form == "binary":
            stored = coordinates(path, read_records(path, file, record, count))
        elif form == "binary_compressed":
            stored = coordinates(path, _decompressed(path, file, record, count))
        else:
            raise MeshError(str(path), [f"DATA: expected ascii, binary or binary_compressed, got '{form:.40}'"])
    if height == 1:
        return stored
    returned = np.isfinite(stored.points).all(axis=1)
    note = f"{count - int(returned.sum())} of {count} pixels of the organised cloud have no return"
    return stored._replace(points=stored.points[returned], notes=(note,))


def _read_header(path: Path, file: BinaryIO) -> dict[str, list[str]]:
    header: dict[str, list[str]] = {}
    for _ in range(MAX_HEADER_LINES):
        words = file.readline(4096).decode("ascii", "replace").split()
        if words and not words[0].startswith("#"):
            header[words[0].upper()] = words[1:]
        if "DATA" in header:
            return header
    raise MeshError(str(path), ["is not a PCD file: there is no DATA line in its header"])


def _whole(header: dict[str, list[str]], key: str) -> int:
    """The number of a line; raises ValueError where that is none."""
    text = " ".join(header.get(key, ["no such line"]))
    if not text.isdecimal():
        raise ValueError(f"{key}: expected a whole number, got '{text:.40}'")
    return int(text)


def _record(header: dict[str, list[str]]) -> np.dtype[np.void]:
    """Type of one point; raises ValueError for lines that are missing, wrong or do not fit together."""
    names = header.get("FIELDS", [])
    lines = {"SIZE": header.get("SIZE", []), "TYPE": header.get("TYPE", [])}
    lines["COUNT"] = header.get("COUNT", ["1"] * len(names))
    for key, words in lines.items():
        if len(words) != len(names):
            raise ValueError(f"{key}: expected {len(names)} values, one for each of FIELDS, got {len(words)}")
    fields = []
    for number, (name, size, kind, count) in enumerate(zip(names, *lines.values(), strict=True)):
        if size not in map(str, LENGTHS.get(kind, ())) or not count.isdecimal():
            raise ValueError(f"field {name:.40}: TYPE {kind:.40} of SIZE {size:.40} x {count:.40}")
        unique = f"{name}_{number}" if names.count(name) > 1 else name  # padding is called "_" as often as it occurs
        form = f"<{KINDS[kind]}{int(size)}"
        fields.append((unique, form) if int(count) == 1 else (unique, form, (int(count),)))
    record = np.dtype(fields)
    if record.itemsize > MAX_RECORD_BYTES:
        raise ValueError(f"{record.itemsize} bytes a point")
    return record


def _read_text(path: Path, file: BinaryIO, record: np.dtype[np.void], count: int) -> StoredPoints:
    places, column = {}, 0
    for name in record.names or ():
        places[name] = column
        column += int(np.prod(record[name].shape, dtype=np.int64))
    if missing := [name for name in "xyz" if name not in places]:
        raise MeshError(str(path), [f"its points have no {', '.join(missing)}"])
    return StoredPoints(read_rows(path, file, (places["x"], places["y"], places["z"]), None, count))


def _decompressed(path: Path, file: BinaryIO, record: np.dtype[np.void], count: int) -> NDArray[np.void]:
    """Records out of a compressed block, in which one field's values of all points stand after the other's."""
    head, expected = file.read(8), count * record.itemsize
    if len(head) < 8:
        text = f"the file is cut off: expected the sizes of a compressed block in 8 bytes, found {len(head)}"
        raise MeshError(str(path), [text])
    sizes = np.frombuffer(head, dtype="<u4")
    if int(sizes[1]) != expected:
        raise MeshError(str(path), [f"its compressed block holds {sizes[1]} bytes, expected {expected}"])
    block = np.frombuffer(file.read(int(sizes[0])), dtype=np.uint8)
    if len(block) < sizes[0]:
        raise MeshError(str(path), [f"the file is cut off: expected {sizes[0]} compressed bytes, found {len(block)}"])
    if expected > MOST_EXPANSION * len(block):
        raise MeshError(str(path), [f"{len(block)} compressed bytes cannot hold {expected}"])
    content = np.empty(expected, dtype=np.uint8)
    if lzf_decompress(block.copy(), content) != expected:
        raise MeshError(str(path), ["its compressed block is damaged"])
    records = np.zeros(count, dtype=record)
    start = 0
    for name in record.names or ():
        kind = record[name]
        end = start + count * kind.itemsize
        records[name] = content[start:end].view(kind.base).reshape(count, *kind.shape)
        start = end
    return records
