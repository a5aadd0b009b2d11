"""Exact shortest distances over a CSR graph, with the work lists of ``near_far.py`` instead of a heap.

Use it for whole fields. For one goal far from the borders ``astar.py`` visits fewer vertices.
"""

from __future__ import annotations

import numpy as np

from mbf_mesh_nav.arrays import BoolArray, FlagArray, Float32Array, IntArray
from mbf_mesh_nav.kernels.compiled import ONE, Index, kernel
from mbf_mesh_nav.kernels.search.near_far import IN_FAR, IN_NEAR, UNQUEUED, after, raise_threshold

CANCEL_POLL_INTERVAL = 4096


@kernel
def propagate_distances(
    neighbour_offsets: IntArray,
    neighbours: IntArray,
    edge_weights: Float32Array,
    blocked: BoolArray,
    distances: Float32Array,
    predecessors: IntArray,
    seeds: IntArray,
    threshold_step: float,
    targets: IntArray,
    target_offsets: Float32Array,
    cancel_flag: FlagArray,
) -> bool:
    """Relax ``distances`` and ``predecessors`` in place from the queued ``seeds`` until nothing improves.

    Parameters
    ----------
    neighbour_offsets, neighbours, edge_weights : CSR arrays
        int32 (V+1,), int32 (2E,), float32 (2E,) [m]; an infinite weight is an impassable edge.
    blocked : (V,) bool
        Vertices that are never entered.
    distances, predecessors : (V,) float32 [m], (V,) int32
        Start state and result: inf and -1 except at seeds (a seed keeps predecessor -1) or at a field to repair.
    seeds : (s,) int32
        Vertices whose distance is already final or better than what their neighbours know.
    threshold_step : float
        Growth of the near list's bound [m]; a few mean edge weights. Does not change the result.
    targets, target_offsets : (t,) int32, (t,) float32 [m]
        Stop once no target can improve ``min(distances[targets] + target_offsets)``; empty for the whole field.
    cancel_flag : (1,) uint8
        Polled; nonzero ends the call.

    Returns
    -------
    bool
        False if cancelled.
    """
    near = np.empty(len(distances) + 1, dtype=np.int32)
    far = np.empty(len(distances), dtype=np.int32)
    state = np.zeros(len(distances), dtype=np.uint8)
    head, tail, far_count = Index(0), Index(0), Index(0)
    for seed in seeds:
        if state[seed] == UNQUEUED:
            state[seed] = IN_FAR
            far[far_count] = seed
            far_count += ONE
    threshold, step = np.float32(0.0), np.float32(threshold_step)
    visits = 0
    while True:
        # 1. Empty the near list; improved vertices go to the list their new distance belongs to.
        while head != tail:
            visits += 1
            if visits % CANCEL_POLL_INTERVAL == 0 and cancel_flag[0] != 0:
                return False
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
                    if candidate < threshold:
                        if state[neighbour] != IN_NEAR:
                            state[neighbour] = IN_NEAR
                            near[tail] = neighbour
                            tail = after(tail, near)
                    elif state[neighbour] == UNQUEUED:
                        state[neighbour] = IN_FAR
                        far[far_count] = neighbour
                        far_count += ONE
        # 2. Everything below the threshold is final: are the targets?
        if far_count == 0 or cancel_flag[0] != 0:
            return bool(cancel_flag[0] == 0)
        for i in range(len(targets)):
            if distances[targets[i]] + target_offsets[i] < threshold:
                return True
        # 3. Go on with what waits farther away.
        tail, far_count, threshold = raise_threshold(near, far, state, distances, tail, far_count, threshold, step)


@kernel
def follow_predecessors(predecessors: IntArray, vertex: int) -> IntArray:
    """Vertices (n,) int32 from ``vertex`` back to the seed it was reached from."""
    count = 1
    walker = vertex
    while predecessors[walker] >= 0:
        walker = predecessors[walker]
        count += 1
    chain = np.empty(count, dtype=np.int32)
    walker = vertex
    for i in range(count):
        chain[i] = walker
        walker = predecessors[walker]
    return chain
