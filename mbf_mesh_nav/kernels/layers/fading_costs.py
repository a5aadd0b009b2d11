"""Costs that fade with the distance from lethal vertices."""

from __future__ import annotations

import math

import numpy as np

from mbf_mesh_nav.arrays import Float32Array, IntArray
from mbf_mesh_nav.kernels.compiled import ONE, Index, kernel


@kernel
def set_fading_costs(
    distances: Float32Array,
    touched: IntArray,
    flips: int,
    inscribed_radius: float,
    lethal_value: float,
    inscribed_value: float,
    cost_scaling_factor: float,
    costs: Float32Array,
) -> IntArray:
    """Write the costs of the ``touched`` vertices (t,) and return those that differ, and all of the first ``flips``.

    ``lethal_value`` at lethal vertices, ``inscribed_value`` up to the inscribed radius [m], from there on
    ``inscribed_value * exp(-cost_scaling_factor (d - inscribed_radius))`` but less than ``inscribed_value``, as the
    robot fits there however slowly the costs fade, and 0 at infinite distance; changes ``costs`` (V,) in place.
    """
    radius, below = np.float32(inscribed_radius), np.nextafter(np.float32(inscribed_value), np.float32(0.0))
    moved = np.empty(len(touched), dtype=np.int32)
    size = Index(0)
    for place in range(len(touched)):
        vertex = Index(touched[place])
        distance = distances[vertex]
        cost = inscribed_value
        if distance == 0.0:
            cost = lethal_value
        elif distance == np.inf:
            cost = 0.0
        elif distance > inscribed_radius:
            cost = inscribed_value * math.exp(-cost_scaling_factor * (distance - inscribed_radius))
            if distance > radius and cost > below:
                cost = below
        if place < flips or np.float32(cost) != costs[vertex]:
            costs[vertex] = cost
            moved[size] = vertex
            size += ONE
    return moved[:size].copy()
