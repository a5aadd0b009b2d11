"""The direction field of a wave: at every vertex the way along which the wave came, seen backwards.

Where the ray to a vertex crossed a face, the crossing point on the opposite edge is found in the unfolded (weighted)
triangle and carried over to the real edge as a fraction of its length; so costs bend the wave but the direction
stays a direction in the real face, and no angle is ever computed.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.kernels.compiled import inner_kernel, kernel
from mbf_mesh_nav.kernels.cvp import NO_BEND
from mbf_mesh_nav.kernels.dijkstra import Float32Array, Int32Array


@kernel
def wave_directions(
    vertices: NDArray[np.float64],
    faces: Int32Array,
    vertex_faces: Int32Array,
    corner_ends: Int32Array,
    corner_weights: Float32Array,
    distances: Float32Array,
    predecessors: Int32Array,
    cut_records: Int32Array,
    bends: Int32Array,
) -> Float32Array:
    """Return unit vectors (V, 3) float32 towards the source; zero at seeds and where the wave did not come.

    The inputs are those and the results of ``cvp.propagate_wave``.
    """
    directions = np.zeros((len(distances), 3), dtype=np.float32)
    for vertex in range(len(distances)):
        if predecessors[vertex] < 0:
            continue
        x, y, z = vertices[predecessors[vertex]]
        record = cut_records[vertex]
        if record >= 0:
            # The face is (base, first, second); the free corner of the record is this vertex, the other one was known.
            first, second = corner_ends[record]
            to_known, to_free, between = corner_weights[record]
            face = faces[vertex_faces[record]]
            base = face[0] + face[1] + face[2] - first - second
            known = first
            if first == vertex:
                known, to_known, to_free = second, to_free, to_known
            bend = bends[vertex]
            to_bend = distances[bend] if bend != NO_BEND else np.float32(0.0)
            share = _crossing_share(distances[base] - to_bend, distances[known] - to_bend, to_known, to_free, between)
            x = vertices[base, 0] + share * (vertices[known, 0] - vertices[base, 0])
            y = vertices[base, 1] + share * (vertices[known, 1] - vertices[base, 1])
            z = vertices[base, 2] + share * (vertices[known, 2] - vertices[base, 2])
        dx, dy, dz = x - vertices[vertex, 0], y - vertices[vertex, 1], z - vertices[vertex, 2]
        length = math.sqrt(dx * dx + dy * dy + dz * dz)
        directions[vertex, 0] = dx / length
        directions[vertex, 1] = dy / length
        directions[vertex, 2] = dz / length
    return directions


@inner_kernel
def _crossing_share(u1: float, u2: float, c: float, b: float, a: float) -> float:
    """Where the ray to corner 3 crosses side 12, as a share of the side from corner 1; see ``unfolded_distance``."""
    source_x = (c * c + (u1 - u2) * (u1 + u2)) / (2.0 * c)
    corner_x = (c * c + (b - a) * (b + a)) / (2.0 * c)
    source_depth = math.sqrt(max(u1 * u1 - source_x * source_x, 0.0))
    corner_height = math.sqrt(max(b * b - corner_x * corner_x, 0.0))
    if source_depth + corner_height <= 0.0:
        return 0.0
    crossing = source_x + (corner_x - source_x) * source_depth / (source_depth + corner_height)
    return min(max(crossing / c, 0.0), 1.0)
