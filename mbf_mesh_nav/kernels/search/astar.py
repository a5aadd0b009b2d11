"""A* over a CSR graph: the cheapest path to one point, guided by the straight line to it.

The bound never overestimates because every edge weight is at least the edge's length (the map adds costs, it never
multiplies below one). The open list is that of ``near_far.py``, ordered by distance plus bound. Strength: visits a
fifth of the vertices of a random query. Weakness: around large obstacles the bound misleads, and computing it makes the
search slower than the field of ``dijkstra.py``.
"""

from __future__ import annotations

import math

import numpy as np

from mbf_mesh_nav.arrays import BoolArray, FlagArray, Float32Array, FloatArray, IntArray
from mbf_mesh_nav.kernels.compiled import ONE, Index, inner_kernel, kernel
from mbf_mesh_nav.kernels.search.dijkstra import CANCEL_POLL_INTERVAL
from mbf_mesh_nav.kernels.search.near_far import IN_FAR, IN_NEAR, UNQUEUED, after, raise_threshold

_ROUNDING_MARGIN = 1.0 - 1e-6  # keeps the float32 bound below the float32 path cost


@kernel
def search_towards(
    vertices: FloatArray,
    neighbour_offsets: IntArray,
    neighbours: IntArray,
    edge_weights: Float32Array,
    blocked: BoolArray,
    distances: Float32Array,
    predecessors: IntArray,
    seeds: IntArray,
    targets: IntArray,
    target_offsets: Float32Array,
    goal: FloatArray,
    threshold_step: float,
    cancel_flag: FlagArray,
) -> int:
    """Relax ``distances`` and ``predecessors`` in place from ``seeds`` until the best target is final.

    Parameters
    ----------
    vertices : (V, 3) float64 [m]
    neighbour_offsets, neighbours, edge_weights, blocked, distances, predecessors, seeds, targets, target_offsets
        As in ``dijkstra.propagate_distances``.
    goal : (3,) float64 [m]
        The point behind the targets; ``target_offsets`` must not be shorter than the straight lines to it.
    threshold_step : float
        Growth of the near list's bound [m]; about an edge. Does not change the result.
    cancel_flag : (1,) uint8

    Returns
    -------
    int
        Number of visits of vertices, -1 if cancelled. No path: all target distances stay infinite.
    """
    near = np.empty(len(distances) + 1, dtype=np.int32)
    far = np.empty(len(distances), dtype=np.int32)
    state = np.zeros(len(distances), dtype=np.uint8)
    totals = np.empty(len(distances), dtype=np.float32)  # of the vertices in the far list
    head, tail, far_count = Index(0), Index(0), Index(0)
    for seed in seeds:
        if state[seed] == UNQUEUED:
            state[seed] = IN_FAR
            totals[seed] = distances[seed] + straight_line_bound(vertices, Index(seed), goal)
            far[far_count] = seed
            far_count += ONE
    threshold, step = np.float32(0.0), np.float32(threshold_step)
    visits = 0
    while True:
        # 1. Empty the near list; improved vertices go to the list that distance plus bound belongs to.
        while head != tail:
            visits += 1
            if visits % CANCEL_POLL_INTERVAL == 0 and cancel_flag[0] != 0:
                return -1
            vertex = Index(near[head])
            head = after(head, near)
            state[vertex] = UNQUEUED
            base = distances[vertex]
            for slot in range(Index(neighbour_offsets[vertex]), Index(neighbour_offsets[vertex + ONE])):
                neighbour = Index(neighbours[slot])
                candidate = base + edge_weights[slot]
                if candidate < distances[neighbour] and not blocked[neighbour]:
                    distances[neighbour] = candidate
                    predecessors[neighbour] = vertex
                    total = candidate + straight_line_bound(vertices, neighbour, goal)
                    if total < threshold:
                        if state[neighbour] != IN_NEAR:
                            state[neighbour] = IN_NEAR
                            near[tail] = neighbour
                            tail = after(tail, near)
                    else:
                        totals[neighbour] = total
                        if state[neighbour] == UNQUEUED:
                            state[neighbour] = IN_FAR
                            far[far_count] = neighbour
                            far_count += ONE
        # 2. No way shorter than the threshold is left to find: is a target reached by such a one?
        if far_count == 0 or cancel_flag[0] != 0:
            return visits if cancel_flag[0] == 0 else -1
        for i in range(len(targets)):
            if distances[targets[i]] + target_offsets[i] < threshold:
                return visits
        # 3. Go on with what promises less.
        tail, far_count, threshold = raise_threshold(near, far, state, totals, tail, far_count, threshold, step)


@inner_kernel
def straight_line_bound(vertices: FloatArray, vertex: int, goal: FloatArray) -> np.float32:
    """Straight-line distance [m] from a vertex to the goal, rounded down."""
    dx = vertices[vertex, 0] - goal[0]
    dy = vertices[vertex, 1] - goal[1]
    dz = vertices[vertex, 2] - goal[2]
    return np.float32(math.sqrt(dx * dx + dy * dy + dz * dz) * _ROUNDING_MARGIN)
