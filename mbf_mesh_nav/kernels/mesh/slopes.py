"""Angles of the surface from its normals."""

from __future__ import annotations

import math

import numpy as np

from mbf_mesh_nav.arrays import BoolArray, Float32Array, FloatArray, IntArray
from mbf_mesh_nav.kernels.compiled import Count, inlined_kernel, kernel


@kernel
def inclinations(upward: FloatArray) -> Float32Array:
    """Angle (V,) float32 [rad] between unit normals with these z components (V,) and the vertical, from 0 to pi.

    The components lie side by side: with every third number of the normals it takes twice as long.
    """
    angles = np.empty(len(upward), dtype=np.float32)
    for vertex in range(len(upward)):
        angles[vertex] = arc_cosine(min(max(upward[vertex], -1.0), 1.0))
    return angles


@inlined_kernel
def arc_cosine(cosine: float) -> float:
    """Angle [rad] to a cosine from -1 to 1, to one unit in the last place.

    For loops over many: unlike the C library's it is plain arithmetic, done for several at once and alike on every CPU.
    """
    size = abs(cosine)
    steep = size <= 0.5
    square = size * size if steep else 0.5 * (1.0 - size)  # sin^2 of the angle's complement, or of half the angle
    sine = size if steep else math.sqrt(square)
    # (asin(s) - s) / s^3 in z = s^2 for s from 0 to 1/2: its Chebyshev fit, wrong by 3e-16 at most.
    fit = 0.028169218060881414
    fit = -0.010749050339697808 + square * fit
    fit = 0.01603551434914882 + square * fit
    fit = 0.0078029494773533175 + square * fit
    fit = 0.011875494382636922 + square * fit
    fit = 0.013929652902326633 + square * fit
    fit = 0.017355259955786323 + square * fit
    fit = 0.02237204763174451 + square * fit
    fit = 0.03038194736709848 + square * fit
    fit = 0.044642857103423646 + square * fit
    fit = 0.07500000000020764 + square * fit
    fit = 0.1666666666666665 + square * fit
    angle = sine + sine * square * fit
    acute = 0.5 * math.pi - angle if steep else 2.0 * angle
    return acute if cosine >= 0.0 else math.pi - acute


@kernel
def tilt_of_normals(
    normals: FloatArray, headings: FloatArray, max_roll: float, max_pitch: float
) -> tuple[BoolArray, Float32Array]:
    """Which headings a robot that stands on a vertex' tangent plane may have, and its roll there.

    Parameters
    ----------
    normals : (V, 3) float64
        Unit normals.
    headings : (H,) float64
        About the vertical [rad].
    max_roll, max_pitch : float
        Limits of the magnitudes [rad].

    Returns
    -------
    allowed : (V, H) bool
    roll : (V, H) float32
        [rad], left side up positive.
    """
    vertex_count, heading_count = normals.shape[0], headings.shape[0]
    allowed = np.empty((vertex_count, heading_count), dtype=np.bool_)
    rolls = np.empty((vertex_count, heading_count), dtype=np.float32)
    for heading in range(heading_count):
        cosine, sine = math.cos(headings[heading]), math.sin(headings[heading])
        for vertex in range(vertex_count):
            x, y, up = normals[vertex, 0], normals[vertex, 1], normals[vertex, 2]
            pitch, roll = math.atan2(-(x * cosine + y * sine), up), math.atan2(-(y * cosine - x * sine), up)
            allowed[vertex, heading] = abs(roll) <= max_roll and abs(pitch) <= max_pitch
            rolls[vertex, heading] = roll
    return allowed, rolls


@kernel
def slopes_of_edges(
    vertices: FloatArray,
    neighbour_offsets: IntArray,
    neighbours: IntArray,
    normals: FloatArray,
    max_roll: float,
    max_pitch: float,
) -> BoolArray:
    """Which directed edges (2E,) a robot on the tangent plane may drive along, at the very heading of the edge.

    Between both ends the normal goes from one to the other in proportion, so roll and pitch are greatest at an end.
    """
    allowed = np.empty(len(neighbours), dtype=np.bool_)
    for vertex in range(len(vertices)):
        for slot in range(neighbour_offsets[vertex], neighbour_offsets[vertex + 1]):
            other = neighbours[slot]
            dx, dy = vertices[other, 0] - vertices[vertex, 0], vertices[other, 1] - vertices[vertex, 1]
            length = math.sqrt(dx * dx + dy * dy)
            worst = 0.0 if length > 0.0 else np.inf
            for end in (Count(vertex), Count(other)):
                x, y, up = normals[end, 0], normals[end, 1], normals[end, 2] * length
                roll, pitch = abs(math.atan2(y * dx - x * dy, up)), abs(math.atan2(x * dx + y * dy, up))
                worst = max(worst, max(roll / max_roll, pitch / max_pitch))
            allowed[slot] = worst <= 1.0
    return allowed
