"""Vertices of a PLY file as a point cloud; ascii and both binary forms, with or without faces.

Format: Greg Turk, "The PLY Polygon File Format" (1994).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

import numpy as np

from mbf_mesh_nav.building.clouds.stored_points import StoredPoints, bytes_left, coordinates, read_records, refuse_count
from mbf_mesh_nav.building.clouds.text_points import read_rows
from mbf_mesh_nav.mesh.mesh_report import MeshError

TYPES = {
    **{"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"},
    **{"float": "f4", "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2"},
    **{"int32": "i4", "uint32": "u4", "float32": "f4", "float64": "f8"},
}
BYTE_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">"}
MAX_HEADER_LINES = 10_000


@dataclass
class _Element:
    name: str
    count: int
    properties: list[tuple[str, str]] = field(default_factory=list)
    has_lists: bool = False


def read_ply_points(path: Path, max_points: int) -> StoredPoints:
    """Read the element ``vertex`` of a PLY file.

    Raises
    ------
    MeshError
        No PLY, cut off, more than ``max_points`` points, or vertices without x, y and z.
    """
    with path.open("rb") as file:
        form, elements = _read_header(path, file)
        before = []
        for element in elements:
            if element.name == "vertex":
                break
            before.append(element)
        else:
            raise MeshError(str(path), ["there is no element 'vertex' in its header"])
        refuse_count(path, element.count, max_points)
        if element.count == 0:
            raise MeshError(str(path), ["there is no point in it: expected an element 'vertex' of 1 or more, got 0"])
        if element.has_lists or any(other.has_lists for other in before):
            raise MeshError(str(path), ["a list in or before the element 'vertex' is not read"])
        stored = (
            _read_text(path, file, before, element)
            if form == "ascii"
            else _read_binary(path, file, before, element, BYTE_ORDERS[form])
        )
    return stored


def has_faces(path: Path) -> bool:
    """Whether a PLY file is a mesh by its header; raises ``MeshError`` for a header that is none.

    Faces without a vertex are none: their file is read, and refused, as a cloud.
    """
    with path.open("rb") as file:
        counts = {element.name: element.count for element in _read_header(path, file)[1]}
    return counts.get("face", 0) > 0 and counts.get("vertex", 0) > 0


def _read_header(path: Path, file: BinaryIO) -> tuple[str, list[_Element]]:
    if file.readline(8).strip() != b"ply":
        raise MeshError(str(path), ["is not a PLY file: it does not begin with 'ply'"])
    form, elements = "", list[_Element]()
    try:
        for _ in range(MAX_HEADER_LINES):
            words = file.readline(4096).decode("ascii", "replace").split()
            if words[:1] == ["format"]:
                form = words[1]
            elif words[:1] == ["element"]:
                elements.append(_Element(words[1], int(words[2])))
            elif words[:2] == ["property", "list"]:
                elements[-1].has_lists = True
            elif words[:1] == ["property"]:
                elements[-1].properties.append((words[2], TYPES[words[1]]))
            elif words[:1] == ["end_header"] or bytes_left(file) == 0:
                break
    except (LookupError, ValueError) as error:
        raise MeshError(str(path), [f"its header has a line that is not PLY: {' '.join(words)!r:.80}"]) from error
    if words[:1] != ["end_header"]:
        raise MeshError(str(path), ["the file is cut off within its header: there is no end_header"])
    if form != "ascii" and form not in BYTE_ORDERS:
        raise MeshError(str(path), [f"unknown format {form!r:.40}; known: ascii, {', '.join(BYTE_ORDERS)}"])
    return form, elements


def _read_binary(path: Path, file: BinaryIO, before: list[_Element], vertex: _Element, order: str) -> StoredPoints:
    for element in before:
        file.seek(element.count * _record(element, order).itemsize, 1)
    return coordinates(path, read_records(path, file, _record(vertex, order), vertex.count))


def _record(element: _Element, order: str) -> np.dtype[np.void]:
    return np.dtype([(name, order + kind) for name, kind in element.properties])


def _read_text(path: Path, file: BinaryIO, before: list[_Element], vertex: _Element) -> StoredPoints:
    names = [name for name, _ in vertex.properties]
    if missing := [name for name in "xyz" if name not in names]:
        raise MeshError(str(path), [f"its points have no {', '.join(missing)}"])
    for _ in range(sum(element.count for element in before)):
        if not file.readline():
            raise MeshError(str(path), ["the file is cut off before its points"])
    columns = (names.index("x"), names.index("y"), names.index("z"))
    return StoredPoints(read_rows(path, file, columns, None, vertex.count))
