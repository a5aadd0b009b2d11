"""Angles of the surface from its normals."""

from __future__ import annotations

import math

import numpy as np

from mbf_mesh_nav.kernels.compiled import kernel
from mbf_mesh_nav.kernels.dijkstra import BoolArray, Float32Array
from mbf_mesh_nav.kernels.vectors import Float64Array


@kernel
def inclinations(normals: Float64Array) -> Float32Array:
    """Angle (V,) float32 [rad] between unit normals (V, 3) and the vertical, from 0 to pi."""
    angles = np.empty(normals.shape[0], dtype=np.float32)
    for vertex in range(normals.shape[0]):
        angles[vertex] = math.acos(min(max(normals[vertex, 2], -1.0), 1.0))
    return angles


@kernel
def tilt_of_normals(
    normals: Float64Array, headings: Float64Array, max_roll: float, max_pitch: float
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
