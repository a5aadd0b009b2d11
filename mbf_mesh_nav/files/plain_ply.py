"""PLY files of vertices and triangles and nothing else, without trimesh, whose import takes as long as a plan.

Only what leaves no question is read here: little-endian or ASCII, numbers per vertex, one list of three corners per
face, and exactly as many bytes or numbers as the header promises. Everything else is trimesh's, with its errors.
"""

from __future__ import annotations

import warnings
from itertools import islice
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.arrays import FloatArray

Rows = tuple[np.dtype[np.void], int]  # the type of a row, and how many there are
Columns = tuple[FloatArray, NDArray[np.integer], NDArray[np.integer]]  # (V, 3) points, (F,), (F, 3) corners

BINARY = [["ply"], ["format", "binary_little_endian", "1.0"]]
ASCII = [["ply"], ["format", "ascii", "1.0"]]
MAX_HEADER_LINES = 1000
NUMBERS = {
    **{"char": "i1", "uchar": "u1", "short": "<i2", "ushort": "<u2", "int": "<i4", "uint": "<u4"},
    **{"int8": "i1", "uint8": "u1", "int16": "<i2", "uint16": "<u2", "int32": "<i4", "uint32": "<u4"},
    **{"float": "<f4", "double": "<f8", "float32": "<f4", "float64": "<f8"},
}
CORNERS = ("vertex_indices", "vertex_index")


def read_plain_ply(path: Path) -> tuple[FloatArray, NDArray[np.int64]] | None:
    """Read vertices (V, 3) float64 and faces (F, 3) int64 in the file's order; None where this is no plain PLY."""
    with path.open("rb") as file:
        form = [line.decode("latin-1").split() for line in islice(iter(file.readline, b""), 2)]
        if form not in (BINARY, ASCII) or (rows := _header(file)) is None:
            return None
        read = _of_bytes if form == BINARY else _of_text
        columns = read(file, path.stat().st_size, *rows)
    if columns is None or (columns[1] != 3).any():
        return None
    points, _, corners = columns
    return points + 0.0, corners.astype(np.int64)  # -0.0 is 0.0, as where a scene moves its parts into place


def _of_bytes(file: BinaryIO, most: int, vertices: Rows, faces: Rows) -> Columns | None:
    """Points, numbers of corners and corners of a binary file, of which there are at most ``most`` bytes."""
    (vertex, vertex_count), (face, face_count) = vertices, faces
    split = vertex_count * vertex.itemsize
    size = split + face_count * face.itemsize
    content = file.read(size + 1) if size <= most else b""
    if len(content) != size:
        return None
    of_vertices, of_faces = np.frombuffer(content[:split], vertex), np.frombuffer(content[split:], face)
    points = np.column_stack([of_vertices[axis] for axis in "xyz"]).astype(np.float64)
    return points, of_faces["count"], of_faces["corners"]


def _of_text(file: BinaryIO, most: int, vertices: Rows, faces: Rows) -> Columns | None:
    """The same of an ASCII file; None also where a line is not one row, or a number is none of its type."""
    (vertex, vertex_count), (_, face_count) = vertices, faces
    names = vertex.names or ()
    split, text = vertex_count * len(names), file.read(most)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", DeprecationWarning)  # of what is no number
            numbers = np.fromstring(text, dtype=np.float64, sep=" ")
    except (DeprecationWarning, ValueError):
        return None
    lines = text.count(b"\n") + (not text.endswith(b"\n"))
    if lines != vertex_count + face_count or len(numbers) != split + 4 * face_count:
        return None
    of_vertices, of_faces = numbers[:split].reshape(-1, len(names)), numbers[split:].reshape(-1, 4)
    points = np.column_stack([of_vertices[:, names.index(axis)].astype(vertex[axis]) for axis in "xyz"])
    if (of_faces != np.floor(of_faces)).any() or (np.abs(of_faces) > np.iinfo(np.int32).max).any():
        return None
    corners = of_faces.astype(np.int64)
    return points.astype(np.float64), corners[:, 0], corners[:, 1:]


def _header(file: BinaryIO) -> tuple[Rows, Rows] | None:
    """Types and numbers of the vertices and the faces; the lines of the format have been read."""
    elements: list[tuple[str, int, list[tuple[str, ...]]]] = []
    for line in islice(iter(file.readline, b""), MAX_HEADER_LINES):
        match line.decode("latin-1").split():
            case ["comment" | "obj_info", *_]:
                pass
            case ["element", name, count] if count.isdecimal():
                elements.append((name, int(count), []))
            case ["property", *words] if elements:
                elements[-1][2].append(tuple(words))
            case ["end_header"]:
                return _types(elements)
            case _:
                return None
    return None


def _types(elements: list[tuple[str, int, list[tuple[str, ...]]]]) -> tuple[Rows, Rows] | None:
    match elements:
        case [("vertex", vertex_count, numbers), ("face", face_count, [("list", size, index, corners)])]:
            names = [words[-1] for words in numbers]
            plain = all(len(words) == 2 and words[0] in NUMBERS for words in numbers)
            if not plain or len(set(names)) < len(names) or not {*"xyz"} <= {*names}:
                return None
            if corners not in CORNERS or not {size, index} <= NUMBERS.keys() or "f" in NUMBERS[size] + NUMBERS[index]:
                return None
            vertex = np.dtype([(name, NUMBERS[kind]) for kind, name in numbers])
            face = np.dtype([("count", NUMBERS[size]), ("corners", NUMBERS[index], 3)])
            return (vertex, vertex_count), (face, face_count)
    return None
