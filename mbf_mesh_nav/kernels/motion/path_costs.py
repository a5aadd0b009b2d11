"""Length and collected cost of a path through faces."""

from __future__ import annotations

import math

from mbf_mesh_nav.arrays import Float32Array, FloatArray, IntArray
from mbf_mesh_nav.kernels.compiled import Count, Index, plain_kernel
from mbf_mesh_nav.kernels.mesh.vectors import between, cross, difference, dot, norm, row, triangle

_LEAST_WEIGHT = 1e-9  # of the corners with a finite cost, lest a cost is divided by zero


@plain_kernel
def way_cost(
    vertices: FloatArray,
    faces: IntArray,
    costs: Float32Array,
    factor: float,
    positions: FloatArray,
    point_faces: IntArray,
) -> float:
    """Length plus ``factor`` times the cost in the middle of each step [m]; steps in order, see ``cost_along``."""
    total = 0.0
    for index in range(1, len(positions)):
        start, end, face = row(positions, index - 1), row(positions, index), Count(point_faces[index])
        length = norm(difference(end, start))
        if factor == 0.0:
            total += length
            continue
        a, b, c = triangle(vertices, faces, Index(face))
        ab, ac, offset = difference(b, a), difference(c, a), difference(between(start, end, 0.5), a)
        normal = cross(ab, ac)
        squared = dot(normal, normal)
        weight_b, weight_c = dot(cross(offset, ac), normal) / squared, dot(cross(ab, offset), normal) / squared
        weights = 1.0 - weight_b - weight_c, weight_b, weight_c
        collected = weight = 0.0
        for corner in range(3):
            cost = float(costs[faces[face, corner]])
            if math.isfinite(cost):
                collected += weights[corner] * cost
                weight += weights[corner]
        total += length * (1.0 + factor * collected / max(weight, _LEAST_WEIGHT))
    return total
