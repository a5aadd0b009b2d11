"""Repairing a shortest-path field after local cost changes: invalidate what depends on the change, keep the rest.

The field is a tree of predecessors. Only vertices whose path leads over a changed vertex can be wrong; they are reset,
and their intact neighbours become the seeds of a new wave that ``dijkstra.propagate_distances`` runs to the same fixed
point a search from scratch reaches. (The idea of Ramalingam and Reps, 1996, with a whole subtree at a time.)
"""

from __future__ import annotations

from typing import Any

import numpy as np

from mbf_mesh_nav.arrays import Float32Array, IntArray
from mbf_mesh_nav.kernels.compiled import ONE, Count, Index, inner_kernel, kernel
from mbf_mesh_nav.kernels.prefetch import prefetch
from mbf_mesh_nav.kernels.search.dijkstra import SearchGraph

_FAR_AHEAD: Any = Index(96)  # places of the list, after which it will be known where the edges of a vertex stand
_AHEAD: Any = Index(64)  # the same for its edges
_NEAR_AHEAD: Any = Index(32)  # the same for the field at its first and last neighbour; the others lie between them
_LAST: Any = Index(5)  # of the edges of most vertices, which are six; asking for what lies behind the end does no harm
_MANY: Any = Index(8192)  # vertices listed since the list was looked through, which are still in the caches then
_NONE, _LISTED = -1, -2  # as predecessors: of a reset vertex; of a changed one to which the walk has yet to come
_ROOT = 2**31 - 1  # of a root: all that is reached, but for changed vertices, has one of at least 0


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
        With the new weights and blocked vertices; no vertex is twice a neighbour of another.
    distances, predecessors : (V,) float32, (V,) int32
        The old field; reset vertices get inf and -1.
    roots, root_distances : (r,) int32, (r,) float32
        Seeds of the field, a few, which keep their distance.
    changed : (c,) int32
        Vertices whose cost or flag changed, i.e. at which the weight of any edge may have changed.

    Returns
    -------
    seeds : (s,) int32
        Reached vertices beside reset ones, and the roots among those; some more than once.
    """
    reset = np.empty(len(distances) + 1, dtype=np.int32)
    beside = np.empty(len(graph.neighbours) + 1, dtype=np.int32)
    count, beside_count, reader, many = Index(0), Index(0), Index(0), _MANY
    for changed_vertex in changed:
        vertex = Index(changed_vertex)
        if predecessors[vertex] != _LISTED:
            predecessors[vertex] = _LISTED
            reset[count] = vertex
            count += ONE
    for number in roots:
        root = Index(number)
        if predecessors[root] == _NONE:  # not if another root leads to it
            predecessors[root] = _ROOT
    # 1. Reset the changed vertices and everything behind them, and list what lies beside and is not reset yet.
    while reader < count:
        vertex = Index(reset[reader])
        reader += ONE
        if beside_count > many:
            beside_count = _still_reached(beside, beside_count, distances)
            many = beside_count + _MANY
        if reader + _FAR_AHEAD < count:
            ahead = Index(reset[reader + _FAR_AHEAD])
            prefetch(graph.offsets, ahead)
            prefetch(distances, ahead)
            prefetch(predecessors, ahead)
        if reader + _AHEAD < count:
            ahead = Index(graph.offsets[reset[reader + _AHEAD]])
            prefetch(graph.neighbours, ahead)
            prefetch(graph.neighbours, ahead + _LAST)
        if reader + _NEAR_AHEAD < count:
            ahead = Index(reset[reader + _NEAR_AHEAD])
            first, end = Index(graph.offsets[ahead]), Index(graph.offsets[ahead + ONE])
            if first < end:
                prefetch(predecessors, Index(graph.neighbours[first]))
                prefetch(predecessors, Index(graph.neighbours[end - ONE]))
        distances[vertex] = np.inf
        predecessors[vertex] = _NONE
        for slot in range(Index(graph.offsets[vertex]), Index(graph.offsets[vertex + ONE])):
            # To one list or the other, or to none, without a branch: written behind both, counted where it belongs.
            other = Index(graph.neighbours[slot])
            before = predecessors[other]
            is_child = Index(Index(before) == vertex)
            reset[count] = beside[beside_count] = other
            count += is_child
            beside_count += Index(before >= 0) - is_child
    # 2. The wave starts again from the roots among them and from what stayed intact beside them.
    beside_count = _still_reached(beside, beside_count, distances)
    seeds = np.empty(Count(len(roots)) + Count(beside_count), dtype=np.int32)
    seed_count = Index(0)
    for index in range(len(roots)):
        root = Index(roots[index])
        if predecessors[root] == _ROOT:
            predecessors[root] = _NONE
        if distances[root] == np.inf and not graph.blocked[root]:
            distances[root] = root_distances[index]
            seeds[seed_count] = root
            seed_count += ONE
    for place in range(beside_count):
        seeds[seed_count] = beside[place]
        seed_count += ONE
    return seeds[:seed_count].copy()


@inner_kernel
def _still_reached(listed: IntArray, count: int, distances: Float32Array) -> int:
    """Take out, in place, of the first ``count`` vertices those that were reset since; return how many are left."""
    kept: int = Index(0)
    for place in range(count):
        vertex = Index(listed[place])
        listed[kept] = vertex
        kept += Index(distances[vertex] < np.inf)
    return kept
