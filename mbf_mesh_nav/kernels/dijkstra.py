"""Exact shortest distances over a CSR graph with near/far work lists instead of a heap.

Vertices below a moving threshold wait in the *near* list, the others in the *far* list. A vertex whose value drops
is queued again, so the result is the same fixed point as Dijkstra's, bit for bit, whatever the step of the threshold;
the step (a few edges) only keeps repeated visits rare. Compared with a heap nothing is sorted, which is
about twice as fast on meshes. (The idea of delta-stepping: Meyer and Sanders, 2003, on one thread.)

Use it for whole fields. For one goal far from the borders ``astar.py`` settles fewer vertices.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.kernels.compiled import kernel

BoolArray = NDArray[np.bool_]
FlagArray = NDArray[np.uint8]
Float32Array = NDArray[np.float32]
Int32Array = NDArray[np.int32]

CANCEL_POLL_INTERVAL = 4096
_UNQUEUED, _IN_NEAR, _IN_FAR = 0, 1, 2


@kernel
def propagate_distances(
    neighbour_offsets: Int32Array,
    neighbours: Int32Array,
    edge_weights: Float32Array,
    blocked: BoolArray,
    distances: Float32Array,
    predecessors: Int32Array,
    seeds: Int32Array,
    threshold_step: float,
    targets: Int32Array,
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
    vertex_count = len(distances)
    near = np.empty(vertex_count + 1, dtype=np.int32)  # ring buffer: a queued vertex sits in it once
    far = np.empty(vertex_count, dtype=np.int32)
    state = np.zeros(vertex_count, dtype=np.uint8)
    head = 0
    tail = 0
    far_count = 0
    for seed in seeds:
        if state[seed] == _UNQUEUED:
            state[seed] = _IN_FAR
            far[far_count] = seed
            far_count += 1
    threshold = 0.0  # float64: adding the step must change it however far the wave is
    visits = 0
    while True:
        # 1. Empty the near list; improved vertices go to the list their new distance belongs to.
        while head != tail:
            visits += 1
            if visits % CANCEL_POLL_INTERVAL == 0 and cancel_flag[0] != 0:
                return False
            vertex = near[head]
            head += 1
            if head > vertex_count:
                head = 0
            state[vertex] = _UNQUEUED
            base = distances[vertex]
            for slot in range(neighbour_offsets[vertex], neighbour_offsets[vertex + 1]):
                neighbour = neighbours[slot]
                candidate = base + edge_weights[slot]
                if candidate < distances[neighbour] and not blocked[neighbour]:
                    distances[neighbour] = candidate
                    predecessors[neighbour] = vertex
                    if candidate < threshold:
                        if state[neighbour] != _IN_NEAR:
                            state[neighbour] = _IN_NEAR
                            near[tail] = neighbour
                            tail += 1
                            if tail > vertex_count:
                                tail = 0
                    elif state[neighbour] == _UNQUEUED:
                        state[neighbour] = _IN_FAR
                        far[far_count] = neighbour
                        far_count += 1
        # 2. Everything below the threshold is final: are the targets?
        if far_count == 0 or cancel_flag[0] != 0:
            return bool(cancel_flag[0] == 0)
        for i in range(len(targets)):
            if distances[targets[i]] + target_offsets[i] < threshold:
                return True
        # 3. Raise the threshold past the nearest far vertex and move what is below it to the near list.
        lowest = np.inf
        for i in range(far_count):
            if state[far[i]] == _IN_FAR:
                lowest = min(lowest, float(distances[far[i]]))
        threshold = max(threshold, lowest) + threshold_step
        kept = 0
        for i in range(far_count):
            vertex = far[i]
            if state[vertex] != _IN_FAR:  # reached more cheaply meanwhile, handled by the near list
                continue
            if distances[vertex] < threshold:
                state[vertex] = _IN_NEAR
                near[tail] = vertex
                tail += 1
                if tail > vertex_count:
                    tail = 0
            else:
                far[kept] = vertex
                kept += 1
        far_count = kept


@kernel
def follow_predecessors(predecessors: Int32Array, vertex: int) -> Int32Array:
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
