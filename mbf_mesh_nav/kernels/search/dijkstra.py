"""Exact shortest paths over a vertex graph, as whole fields (Dijkstra) or towards one goal (A*).

The open list is that of ``near_far.py`` instead of a heap. Towards a goal it is ordered by the distance plus the
straight line to the goal. That bound never overestimates: every edge weight is at least the edge's length (the map adds
costs, it never multiplies below one).

When to use A*: one goal; it visits a fifth of the vertices of a random query. When not: whole fields, and goals behind
large obstacles, around which the bound misleads; computing it then makes the search the slower one.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mbf_mesh_nav.arrays import BoolArray, FlagArray, Float32Array, FloatArray, IntArray
from mbf_mesh_nav.kernels.compiled import ONE, Count, Index, inner_kernel, kernel
from mbf_mesh_nav.kernels.fill import fill
from mbf_mesh_nav.kernels.lowest_bit import BITS, lowest_bit
from mbf_mesh_nav.kernels.prefetch import prefetch
from mbf_mesh_nav.kernels.search.near_far import IN_FAR, IN_NEAR, UNQUEUED, after, raise_threshold

CANCEL_POLL_INTERVAL = 4096
_AHEAD = Index(16)  # places of the near list, after which a vertex's edges will have come from memory
_FAR_AHEAD = Index(32)  # the same for where its edges stand, and for its neighbours' distances, which are near its own
_LAST = Index(5)  # of the edges of most vertices, which are six; asking for what lies behind the end does no harm
_ROUNDING_MARGIN = 1.0 - 1e-6  # keeps the float32 bound below the float32 path cost


class SearchGraph(NamedTuple):
    """Vertices and edges of a search.

    Attributes
    ----------
    offsets, neighbours : (V+1,), (2E,) int32
        Entries ``offsets[v]`` to ``offsets[v+1]`` are the vertices next to ``v``.
    weights : (2E,) float32
        [m]; an infinite one is an impassable edge.
    blocked : (V,) bool
        Vertices that are never entered.
    """

    offsets: IntArray
    neighbours: IntArray
    weights: Float32Array
    blocked: BoolArray


@kernel
def propagate_distances(
    graph: SearchGraph,
    distances: Float32Array,
    predecessors: IntArray,
    seeds: IntArray,
    threshold_step: float,
    targets: IntArray,
    target_offsets: Float32Array,
    cancel_flag: FlagArray,
    towards: tuple[FloatArray, FloatArray] | None = None,
) -> bool:
    """Relax ``distances`` and ``predecessors`` in place from the queued ``seeds`` until nothing improves.

    Parameters
    ----------
    distances, predecessors : (V,) float32 [m], (V,) int32
        Start state and result: inf and -1 except at seeds (a seed keeps predecessor -1) or at a field to repair.
    seeds : (s,) int32
        Vertices whose distance is already final or better than what their neighbours know.
    threshold_step : float
        Growth of the near list's bound [m]; a few mean edge weights, one towards a goal. Does not change the result.
    targets, target_offsets : (t,) int32, (t,) float32 [m]
        Stop once no target can improve ``min(distances[targets] + target_offsets)``; empty for the whole field.
    cancel_flag : (1,) uint8
        Polled; nonzero ends the call.
    towards : (V, 3) float64, (3,) float64 [m], optional
        All vertices and the goal, the point behind the targets, for a search guided by the straight lines to it;
        ``target_offsets`` must not be shorter than these.

    Returns
    -------
    bool
        False if cancelled. Without a path all target distances stay infinite.
    """
    near = np.empty(len(distances) + 1, dtype=np.int32)
    far = np.empty(len(distances) + 1, dtype=np.int32)
    state = np.empty(len(distances), dtype=np.uint8)
    fill(state, Count(0))
    if towards is None:
        keys = distances  # valid in the far list
    else:
        keys = np.empty(len(distances), dtype=np.float32)
        vertices, goal = towards
    head, tail, far_count = Index(0), Index(0), Index(0)
    for seed in seeds:
        if state[seed] == UNQUEUED:
            state[seed] = IN_FAR
            if towards is not None:
                keys[seed] = distances[seed] + straight_line_bound(vertices, Index(seed), goal)
            far[far_count] = seed
            far_count += ONE
    threshold, step = np.float32(0.0), np.float32(threshold_step)
    visits = 0
    following, next_begin, next_end = Index(len(distances)), Index(0), Index(0)  # of nobody yet
    while True:
        # 1. Empty the near list; improved vertices go to the list that their new key belongs to.
        while head != tail:
            visits += 1
            if visits % CANCEL_POLL_INTERVAL == 0 and cancel_flag[0] != 0:
                return False
            vertex = Index(near[head])
            head = after(head, near)
            if head + _FAR_AHEAD < tail:
                ahead = Index(near[head + _FAR_AHEAD])
                prefetch(graph.offsets, ahead)
                prefetch(distances, ahead)
                prefetch(predecessors, ahead)
            if head + _AHEAD < tail:
                ahead = Index(graph.offsets[Index(near[head + _AHEAD])])
                prefetch(graph.neighbours, ahead)
                prefetch(graph.neighbours, ahead + _LAST)
                prefetch(graph.weights, ahead)
                prefetch(graph.weights, ahead + _LAST)
            state[vertex] = UNQUEUED
            base = distances[vertex]
            # Where the next vertex's edges stand is read before the wrong guess that each vertex costs, not after it.
            begin, end = next_begin, next_end
            if vertex != following:
                begin, end = Index(graph.offsets[vertex]), Index(graph.offsets[vertex + ONE])
            if head != tail:
                following = Index(near[head])
                next_begin, next_end = Index(graph.offsets[following]), Index(graph.offsets[following + ONE])
            while begin < end:
                # The edges that gain, as bits, without a branch: about one at a vertex does, and nobody knows which.
                # The last one first, see ``lowest_bit.py``.
                chunk, gaining = begin, Index(0)
                begin = min(begin + BITS, end)
                slot = begin
                for _ in range(chunk, begin):
                    slot -= ONE
                    gains = base + graph.weights[slot] < distances[Index(graph.neighbours[slot])]
                    gaining += gaining + Index(gains)
                while gaining != 0:
                    slot = chunk + lowest_bit(gaining)
                    gaining &= gaining - ONE
                    neighbour = Index(graph.neighbours[slot])
                    candidate = base + graph.weights[slot]
                    if candidate < distances[neighbour] and not graph.blocked[neighbour]:
                        distances[neighbour] = key = candidate
                        predecessors[neighbour] = vertex
                        if towards is not None:
                            key = candidate + straight_line_bound(vertices, neighbour, goal)
                            keys[neighbour] = key
                        # To one list or the other, or to none: written behind both, and counted where it belongs.
                        is_near, listed = key < threshold, state[neighbour]
                        near[tail], far[far_count] = neighbour, neighbour
                        tail += Index(is_near & (listed != IN_NEAR))
                        tail = tail if tail < Index(len(near)) else Index(0)
                        far_count += Index((not is_near) & (listed == UNQUEUED))
                        state[neighbour] = IN_NEAR if is_near else IN_FAR
        # 2. No path shorter than the threshold is left to find: do the targets have theirs?
        head, tail = Index(0), Index(0)
        if far_count == 0 or cancel_flag[0] != 0:
            return bool(cancel_flag[0] == 0)
        for i in range(len(targets)):
            if distances[targets[i]] + target_offsets[i] < threshold:
                return True
        # 3. Go on with what waits farther away.
        tail, far_count, threshold = raise_threshold(near, far, state, keys, tail, far_count, threshold, step)


@kernel
def frontier(graph: SearchGraph, distances: Float32Array, first: int, end: int) -> IntArray:
    """Vertices (n,) int32 from ``first`` to before ``end`` that know a cheaper path to a neighbour than it has.

    With these as seeds a search goes on from the distances it left, also where the graph has got more edges since.
    """
    found = np.empty(end - first, dtype=np.int32)
    count = Index(0)
    for vertex in range(Index(first), Index(end)):
        base = distances[vertex]
        if base == np.inf:
            continue
        for slot in range(Index(graph.offsets[vertex]), Index(graph.offsets[vertex + ONE])):
            neighbour = Index(graph.neighbours[slot])
            if base + graph.weights[slot] < distances[neighbour] and not graph.blocked[neighbour]:
                found[count] = vertex
                count += ONE
                break
    return found[:count]


@inner_kernel
def straight_line_bound(vertices: FloatArray, vertex: int, goal: FloatArray) -> np.float32:
    """Straight-line distance [m] from a vertex to the goal, rounded down."""
    dx = vertices[vertex, 0] - goal[0]
    dy = vertices[vertex, 1] - goal[1]
    dz = vertices[vertex, 2] - goal[2]
    return np.float32(math.sqrt(dx * dx + dy * dy + dz * dz) * _ROUNDING_MARGIN)


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
