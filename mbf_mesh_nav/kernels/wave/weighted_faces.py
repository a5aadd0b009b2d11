"""Places and lengths within one face, whose sides are as long as the weights of its edges."""

from __future__ import annotations

import math

import numpy as np

from mbf_mesh_nav.arrays import Float32Array, FloatArray, IntArray
from mbf_mesh_nav.kernels.compiled import Count, inner_kernel
from mbf_mesh_nav.kernels.mesh.corners import slot_of
from mbf_mesh_nav.kernels.mesh.surface import Surface
from mbf_mesh_nav.kernels.mesh.vectors import Vector, cross, difference, dot, norm, row


@inner_kernel
def on_side(side: int, share: float) -> Vector:
    """Barycentric coordinates of a point on a side, at a share of it from its first corner."""
    first = 1.0 - share
    if side == 0:
        return first, share, 0.0
    return (0.0, first, share) if side == 1 else (share, 0.0, first)


@inner_kernel
def barycentric(vertices: FloatArray, corners: IntArray, point: Vector) -> Vector:
    """Barycentric coordinates of a point in the plane of a face."""
    a, b, c = row(vertices, Count(corners[0])), row(vertices, Count(corners[1])), row(vertices, Count(corners[2]))
    normal = cross(difference(b, a), difference(c, a))
    squared = max(dot(normal, normal), 1e-300)
    second = dot(cross(difference(point, a), difference(c, a)), normal) / squared
    third = dot(cross(difference(b, a), difference(point, a)), normal) / squared
    return 1.0 - second - third, second, third


@inner_kernel
def side_weights(surface: Surface, edge_weights: Float32Array, corners: IntArray) -> Vector:
    """Weights [m] of the sides of a face, that from corner k to the next at k; the length at a blocked corner."""
    return (
        _weight(surface, edge_weights, Count(corners[0]), Count(corners[1])),
        _weight(surface, edge_weights, Count(corners[1]), Count(corners[2])),
        _weight(surface, edge_weights, Count(corners[2]), Count(corners[0])),
    )


@inner_kernel
def _weight(surface: Surface, edge_weights: Float32Array, a: int, b: int) -> float:
    weight = float(edge_weights[slot_of(surface.neighbour_offsets, surface.neighbours, a, b)])
    return weight if weight < np.inf else norm(difference(row(surface.vertices, a), row(surface.vertices, b)))


@inner_kernel
def weighted_length(sides: Vector, step: Vector) -> float:
    """Length [m] of a step, a difference of barycentric coordinates, in the plane of a triangle of weighted sides."""
    squared = (
        step[0] * step[1] * sides[0] * sides[0]
        + step[1] * step[2] * sides[1] * sides[1]
        + step[2] * step[0] * sides[2] * sides[2]
    )
    return math.sqrt(max(-squared, 0.0))
