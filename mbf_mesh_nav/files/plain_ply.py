"""Binary PLY files of vertices and triangles and nothing else, without trimesh, whose import takes as long as a plan.

Only what leaves no question is read here: little-endian, numbers per vertex, one list of three corners per face, and
exactly as many bytes as the header promises. Everything else is trimesh's, with its errors.
"""

from __future__ import annotations

from itertools import islice
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.arrays import FloatArray

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
        types = _header(file)
        if types is None:
            return None
        (vertex, vertex_count), (face, face_count) = types
        split = vertex_count * vertex.itemsize
        size = split + face_count * face.itemsize
        content = file.read(size + 1) if size <= path.stat().st_size else b""
    if len(content) != size:
        return None
    vertices, faces = np.frombuffer(content[:split], vertex), np.frombuffer(content[split:], face)
    if (faces["count"] != 3).any():
        return None
    points = np.column_stack([vertices[axis] for axis in "xyz"]).astype(np.float64)
    return points + 0.0, faces["corners"].astype(np.int64)  # -0.0 is 0.0, as where a scene moves its parts into place


def _header(file: BinaryIO) -> list[tuple[np.dtype[np.void], int]] | None:
    """Types and numbers of the vertices and the faces."""
    lines = [line.decode("latin-1").split() for line in islice(iter(file.readline, b""), 2)]
    if lines != [["ply"], ["format", "binary_little_endian", "1.0"]]:
        return None
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


def _types(elements: list[tuple[str, int, list[tuple[str, ...]]]]) -> list[tuple[np.dtype[np.void], int]] | None:
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
            return [(vertex, vertex_count), (face, face_count)]
    return None
