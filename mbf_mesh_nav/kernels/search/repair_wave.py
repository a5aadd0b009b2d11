"""Repairing a shortest-path field after local cost changes: invalidate what depends on the change, keep the rest.

The field is a tree of predecessors. Only vertices whose path leads over a changed vertex can be wrong; they are reset,
and their intact neighbours become the seeds of a new wave that ``dijkstra.propagate_distances`` runs to the same fixed
point a search from scratch reaches. (The idea of Ramalingam and Reps, 1996, with a whole subtree at a time.)
"""

from __future__ import annotations

from typing import Any

import numpy as np

from mbf_mesh_nav.arrays import Float32Array, IntArray
from mbf_mesh_nav.kernels.compiled import ONE, Count, Index, kernel
from mbf_mesh_nav.kernels.fill import fill
from mbf_mesh_nav.kernels.prefetch import prefetch
from mbf_mesh_nav.kernels.search.dijkstra import SearchGraph

_AHEAD: Any = Index(16)  # places of a list, after which a vertex's edges will have come from memory
_FAR_AHEAD: Any = Index(32)  # the same for where they stand, and for the field at its neighbours, which are near it
_LAST: Any = Index(5)  # of the edges of most vertices, which are six; asking for what lies behind the end does no harm
_BESIDE: Any = np.uint8(1)
_RESET: Any = np.uint8(2)
_SEED: Any = np.uint8(3)


@kernel
def invalidate_subtrees(
    graph: SearchGraph,
    distances: Float32Array,
    predecessors: IntArray,
    roots: IntArray,
    root_distances: Float32Array,
    changed: IntArray,
) -> IntArray:
    """Reset, in place, all vertices whose path leads over a changed vertex; return the seeds of the repair.

    Parameters
    ----------
    graph : SearchGraph
        With the new weights and blocked vertices.
    distances, predecessors : (V,) float32, (V,) int32
        The old field; reset vertices get inf and -1.
    roots, root_distances : (r,) int32, (r,) float32
        Seeds of the field, a few, which keep their distance.
    changed : (c,) int32
        Vertices whose cost or flag changed, i.e. at which the weight of any edge may have changed.

    Returns
    -------
    seeds : (s,) int32
        Reached vertices beside reset ones, and the roots among those.
    """
    reset = np.empty(len(distances) + 1, dtype=np.int32)
    beside = np.empty(len(distances) + 1, dtype=np.int32)
    seeds = np.empty(len(distances), dtype=np.int32)
    state = np.empty(len(distances), dtype=np.uint8)
    fill(state, Count(0))
    count, beside_count, seed_count, reader = Index(0), Index(0), Index(0), Index(0)
    for changed_vertex in changed:
        vertex = Index(changed_vertex)
        if state[vertex] == 0:
            state[vertex] = _RESET
            reset[count] = vertex
            count += ONE
    # 1. Reset the changed vertices and everything behind them, and list what lies beside.
    while reader < count:
        vertex = Index(reset[reader])
        reader += ONE
        if reader + _FAR_AHEAD < count:
            ahead = Index(reset[reader + _FAR_AHEAD])
            prefetch(graph.offsets, ahead)
            prefetch(distances, ahead)
            prefetch(predecessors, ahead)
            prefetch(state, ahead)
        if reader + _AHEAD < count:
            ahead = Index(graph.offsets[reset[reader + _AHEAD]])
            prefetch(graph.neighbours, ahead)
            prefetch(graph.neighbours, ahead + _LAST)
        distances[vertex] = np.inf
        predecessors[vertex] = -1
        for slot in range(Index(graph.offsets[vertex]), Index(graph.offsets[vertex + ONE])):
            # To one list or the other, or to none, without a branch: written behind both, counted where it belongs.
            other = Index(graph.neighbours[slot])
            is_child, before = Index(predecessors[other]) == vertex, state[other]
            reset[count] = other
            count += Index(is_child & (before != _RESET))
            beside[beside_count] = other
            beside_count += Index((not is_child) & (before == 0))
            state[other] = _RESET if is_child else max(before, _BESIDE)
    for index in range(len(roots)):
        root = Index(roots[index])
        if state[root] == _RESET and not graph.blocked[root]:
            distances[root] = root_distances[index]
            state[root] = _SEED
            seeds[seed_count] = root
            seed_count += ONE
    # 2. The wave starts again from what is intact of that.
    for index in range(beside_count):
        other = Index(beside[index])
        if state[other] == _BESIDE and distances[other] < np.inf:
            seeds[seed_count] = other
            seed_count += ONE
    return seeds[:seed_count].copy()
