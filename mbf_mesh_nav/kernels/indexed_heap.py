"""The priority queue of the wave kernels: an indexed 4-ary heap over flat arrays.

Four children per node halve the depth of a binary heap and keep siblings in one cache line; the position array turns
"decrease key" into a constant-time look-up, so no vertex is ever queued twice. Use it where the order of settling
matters (A*, fast marching); a plain shortest-path field is faster with the near/far lists of ``dijkstra.py``.

The heap is three arrays owned by the caller: ``keys`` (n,) float32 and ``ids`` (n,) int32 hold the heap,
``positions`` (n,) int32 tells where an id sits (-1: not queued). Functions return the new size.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.kernels.compiled import kernel

Float32Array = NDArray[np.float32]
Int32Array = NDArray[np.int32]


@kernel
def push_or_decrease(
    keys: Float32Array, ids: Int32Array, positions: Int32Array, size: int, item: int, key: float
) -> int:
    """Queue ``item`` with ``key``, or lower its key if it is queued already; return the new size."""
    slot = positions[item]
    if slot < 0:
        slot = size
        size += 1
    while slot > 0:
        parent = (slot - 1) >> 2
        if keys[parent] <= key:
            break
        keys[slot] = keys[parent]
        ids[slot] = ids[parent]
        positions[ids[slot]] = slot
        slot = parent
    keys[slot] = key
    ids[slot] = item
    positions[item] = slot
    return size


@kernel
def remove_top(keys: Float32Array, ids: Int32Array, positions: Int32Array, size: int) -> int:
    """Take the smallest item off the heap (read ``ids[0]``, ``keys[0]`` before); return the new size."""
    positions[ids[0]] = -1
    size -= 1
    if size == 0:
        return 0
    key = keys[size]
    item = ids[size]
    slot = 0
    while True:
        first = 4 * slot + 1
        if first >= size:
            break
        best = first
        for child in range(first + 1, min(first + 4, size)):
            if keys[child] < keys[best]:
                best = child
        if keys[best] >= key:
            break
        keys[slot] = keys[best]
        ids[slot] = ids[best]
        positions[ids[slot]] = slot
        slot = best
    keys[slot] = key
    ids[slot] = item
    positions[item] = slot
    return size
