"""Vectors of three as tuples: in kernels they stay in registers, arrays of three would be made and dropped."""

from __future__ import annotations

import math

from mbf_mesh_nav.arrays import FloatArray, IntArray
from mbf_mesh_nav.kernels.compiled import Count, inner_kernel

Vector = tuple[float, float, float]


@inner_kernel
def row(array: FloatArray, index: int) -> Vector:
    """One row of an (n, 3) array."""
    return array[index, 0], array[index, 1], array[index, 2]


@inner_kernel
def triangle(vertices: FloatArray, faces: IntArray, face: int) -> tuple[Vector, Vector, Vector]:
    """Corners of a face."""
    a, b, c = Count(faces[face, 0]), Count(faces[face, 1]), Count(faces[face, 2])
    return row(vertices, a), row(vertices, b), row(vertices, c)


@inner_kernel
def set_row(array: FloatArray, index: int, vector: Vector) -> None:
    """Write one row of an (n, 3) array."""
    array[index, 0], array[index, 1], array[index, 2] = vector


@inner_kernel
def dot(a: Vector, b: Vector) -> float:
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inner_kernel
def cross(a: Vector, b: Vector) -> Vector:
    """Vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@inner_kernel
def difference(a: Vector, b: Vector) -> Vector:
    """``a - b``."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@inner_kernel
def between(a: Vector, b: Vector, share: float) -> Vector:
    """Point on the line from ``a`` (share 0) to ``b`` (share 1)."""
    return a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1]), a[2] + share * (b[2] - a[2])


@inner_kernel
def norm(a: Vector) -> float:
    """Length."""
    return math.sqrt(dot(a, a))
