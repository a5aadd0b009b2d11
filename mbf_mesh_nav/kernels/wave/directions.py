"""The direction field of a wave: at every vertex the direction from which the wave came.

Where the ray to a vertex crossed a face, the crossing point on the opposite edge is found in the unfolded (weighted)
triangle and carried over to the real edge as a fraction of its length; so costs bend the wave but the direction
stays a direction in the real face, and no angle is ever computed.
"""

from __future__ import annotations

import math

import numpy as np

from mbf_mesh_nav.arrays import Float32Array, FloatArray, IntArray
from mbf_mesh_nav.kernels.compiled import Count, inner_kernel, kernel
from mbf_mesh_nav.kernels.mesh.vectors import between, difference, norm, row
from mbf_mesh_nav.kernels.wave.fronts import NO_BEND


@kernel
def wave_directions(
    vertices: FloatArray,
    faces: IntArray,
    vertex_faces: IntArray,
    corner_ends: IntArray,
    corner_weights: Float32Array,
    distances: Float32Array,
    predecessors: IntArray,
    cut_records: IntArray,
    bends: IntArray,
) -> Float32Array:
    """Return unit vectors (V, 3) float32 towards the source; zero at seeds and where the wave did not come.

    The inputs are those and the results of ``cvp.propagate_wave``.
    """
    directions = np.empty((len(distances), 3), dtype=np.float32)
    for vertex in range(len(distances)):
        if predecessors[vertex] < 0:
            directions[vertex, 0] = directions[vertex, 1] = directions[vertex, 2] = 0.0
            continue
        crossing = row(vertices, Count(predecessors[vertex]))
        record = cut_records[vertex]
        if record >= 0:
            # The face is (base, first, second); the free corner of the record is this vertex, the other one was known.
            first, second = corner_ends[record, 0], corner_ends[record, 1]
            side, to_end, to_other = corner_weights[record, 0], corner_weights[record, 1], corner_weights[record, 2]
            face = vertex_faces[record]
            end = Count(faces[face, 0]) + faces[face, 1] + faces[face, 2] - first - second
            other = Count(first)
            if first == vertex:
                other, side, to_end = Count(second), to_end, side
            # The front that came to this vertex passed one end of the side or both.
            bend = bends[vertex]
            if bends[end] != bend and end != bend:
                end, other, to_end, to_other = other, end, to_other, to_end
            to_bend = distances[bend] if bend != NO_BEND else np.float32(0.0)
            share = _crossing_share(distances[vertex] - to_bend, distances[end] - to_bend, side, to_end, to_other)
            crossing = between(row(vertices, end), row(vertices, other), share)
        way = difference(crossing, row(vertices, vertex))
        length = norm(way)
        for axis in range(3):
            directions[vertex, axis] = way[axis] / length
    return directions


@inner_kernel
def _crossing_share(u: float, u_end: float, c: float, b: float, a: float) -> float:
    """Where the line from a corner to the front's centre crosses the opposite side, as a share of it from one end.

    Parameters
    ----------
    u, u_end : float
        Distances from the centre to the corner and to that end.
    c, b, a : float
        The side; lengths from the corner to that end and to the other one.
    """
    corner_x = (c * c + (b - a) * (b + a)) / (2.0 * c)
    corner_height = math.sqrt(max(b * b - corner_x * corner_x, 0.0))
    # The angle at the corner between the end and the centre; the ray is turned by it from the one towards the other.
    cosine = min(max((b * b + (u - u_end) * (u + u_end)) / (2.0 * b * u), -1.0), 1.0)
    sine = math.sqrt(1.0 - cosine * cosine)
    ray_x = (corner_height * sine - corner_x * cosine) / b
    ray_depth = (corner_height * cosine + corner_x * sine) / b
    if ray_depth <= 0.0:
        return 1.0
    return min(max((corner_x + ray_x * corner_height / ray_depth) / c, 0.0), 1.0)
