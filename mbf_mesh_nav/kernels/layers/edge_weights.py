"""What a snapshot of a mesh map shows, brought up to date: vertex costs, flags, and the weights of the edges."""

from __future__ import annotations

import numpy as np

from mbf_mesh_nav.arrays import BoolArray, Float32Array, IntArray
from mbf_mesh_nav.kernels.compiled import ONE, Count, Index, kernel
from mbf_mesh_nav.kernels.fill import fill

_UNCHANGED, _WAITING, _WRITTEN = 0, 1, 2


@kernel
def show_changes(
    offsets: IntArray,
    neighbours: IntArray,
    lengths: Float32Array,
    new_costs: Float32Array,
    new_lethal: BoolArray,
    edge_cost_factor: float,
    changed: IntArray,
    costs: Float32Array,
    lethal: BoolArray,
    weights: Float32Array,
) -> None:
    """Take over costs and flags of the ``changed`` vertices, write the weights of all edges at them, both directions.

    ``w = L + factor * L * (c_i + c_j) / 2``, infinite if an end is lethal or has an infinite or NaN cost
    (mesh_navigation's rule; adding keeps ``w >= L``, so a straight-line bound stays admissible). A vertex may be named
    more than once.
    """
    state = np.empty(costs.shape[0], dtype=np.uint8)
    fill(state, Count(0))
    for index in range(changed.shape[0]):
        vertex = Index(changed[index])
        costs[vertex], lethal[vertex] = new_costs[vertex], new_lethal[vertex]
        state[vertex] = _WAITING
    for index in range(changed.shape[0]):
        vertex = Index(changed[index])
        if state[vertex] == _WRITTEN:
            continue
        state[vertex] = _WRITTEN
        blocked = lethal[vertex] or not np.isfinite(costs[vertex])
        for entry in range(Index(offsets[vertex]), Index(offsets[vertex + ONE])):
            other = Index(neighbours[entry])
            weight = np.float32(np.inf)
            if not blocked and not lethal[other] and np.isfinite(costs[other]):
                mean_cost = 0.5 * (costs[vertex] + costs[other])
                weight = np.float32(lengths[entry] * (1.0 + edge_cost_factor * mean_cost))
            weights[entry] = weight
            if state[other] != _UNCHANGED:
                continue  # the other end writes its own entry
            # The twin entry of the other end: a binary search in its ascending list.
            low, high = Index(offsets[other]), Index(offsets[other + ONE])
            while low < high:
                middle = (low + high) >> ONE
                if Index(neighbours[middle]) < vertex:
                    low = middle + ONE
                else:
                    high = middle
            weights[low] = weight
