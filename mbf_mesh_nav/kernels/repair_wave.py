"""Repairing a shortest-path field after local cost changes: forget what hung on the change, keep the rest.

The field is a tree of predecessors. Only vertices whose way leads over a changed vertex can be wrong; they are reset,
and their intact neighbours become the seeds of a new wave that ``dijkstra.propagate_distances`` runs to the same fixed
point a search from scratch reaches. (The idea of Ramalingam and Reps, 1996, with a whole subtree at a time.)
"""

from __future__ import annotations

import numpy as np

from mbf_mesh_nav.kernels.compiled import inner_kernel, kernel
from mbf_mesh_nav.kernels.dijkstra import BoolArray, Float32Array, Int32Array


@kernel
def forget_changed_ways(
    neighbour_offsets: Int32Array,
    neighbours: Int32Array,
    blocked: BoolArray,
    distances: Float32Array,
    predecessors: Int32Array,
    roots: Int32Array,
    changed: Int32Array,
) -> Int32Array:
    """Reset, in place, all vertices whose way leads over a changed vertex; return the seeds of the repair.

    Parameters
    ----------
    neighbour_offsets, neighbours : (V+1,), (2E,) int32
    blocked : (V,) bool
        The new blocked vertices.
    distances, predecessors : (V,) float32, (V,) int32
        The old field; reset vertices get inf and -1.
    roots : (r,) int32
        Seeds of the field, a few, which keep their distance.
    changed : (c,) int32
        Vertices whose cost or flag changed, i.e. at which the weight of any edge may have changed.

    Returns
    -------
    seeds : (s,) int32
        Reached vertices beside reset ones, and the roots among the changed.
    """
    stack = np.empty(len(distances), dtype=np.int32)
    reset = np.empty(len(distances), dtype=np.int32)
    was_reset = np.zeros(len(distances), dtype=np.bool_)
    depth = 0
    for vertex in changed:
        if not was_reset[vertex]:
            was_reset[vertex] = True
            stack[depth] = vertex
            depth += 1
    # 1. Reset the changed vertices and everything behind them.
    count = 0
    while depth > 0:
        depth -= 1
        vertex = stack[depth]
        reset[count] = vertex
        count += 1
        for slot in range(neighbour_offsets[vertex], neighbour_offsets[vertex + 1]):
            child = neighbours[slot]
            if predecessors[child] == vertex and not was_reset[child]:
                was_reset[child] = True
                stack[depth] = child
                depth += 1
        if not _is_among(roots, vertex):
            distances[vertex] = np.inf
            predecessors[vertex] = -1
    # 2. The wave starts again from what is intact around them.
    seed_count = 0
    is_seed = np.zeros(len(distances), dtype=np.bool_)
    for index in range(count):
        vertex = reset[index]
        if _is_among(roots, vertex) and not blocked[vertex] and not is_seed[vertex]:
            is_seed[vertex] = True
            stack[seed_count] = vertex
            seed_count += 1
        for slot in range(neighbour_offsets[vertex], neighbour_offsets[vertex + 1]):
            other = neighbours[slot]
            if distances[other] < np.inf and not is_seed[other]:
                is_seed[other] = True
                stack[seed_count] = other
                seed_count += 1
    return stack[:seed_count].copy()


@inner_kernel
def _is_among(roots: Int32Array, vertex: int) -> bool:
    for root in roots:
        if root == vertex:
            return True
    return False
