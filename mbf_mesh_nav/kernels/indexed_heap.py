"""The priority queue of the wave kernels: an indexed 4-ary heap over flat arrays.

Four children per node halve the depth of a binary heap and share a cache line; the position array turns "decrease
key" into a constant-time look-up, so no vertex is ever queued twice. Use it where the order of settling matters (A*,
fast marching); a plain shortest-path field is faster with the near/far lists of ``dijkstra.py``.

The heap is two arrays owned by the caller: ``heap`` (n,) int64 and ``positions`` (n,) int32, which tells where an item
sits (negative: not queued). An entry is key and item in one number: the bits of a float32 that is not negative order
like an integer, so they fill the upper half and the item the lower one. One comparison then orders by key and, among
equal keys, by item, which makes the order of settling the same everywhere. Functions return the new size.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.kernels.compiled import kernel

HeapArray = NDArray[np.int64]
Int32Array = NDArray[np.int32]

_ITEM_BITS: Any = np.int64(32)
_ITEM_MASK: Any = np.int64(0xFFFFFFFF)


@kernel
def push_or_decrease(heap: HeapArray, positions: Int32Array, size: int, item: int, key: float) -> int:
    """Queue ``item`` with ``key`` >= 0, or lower its key if it is queued already; return the new size."""
    entry = (np.int64(np.float32(key).view(np.int32)) << _ITEM_BITS) | np.int64(item)
    slot = np.int64(positions[item])
    if slot < 0:
        slot = np.int64(size)
        size += 1
    while slot > 0:
        parent = (slot - 1) >> 2
        above = heap[parent]
        if above <= entry:
            break
        heap[slot] = above
        positions[above & _ITEM_MASK] = slot
        slot = parent
    heap[slot] = entry
    positions[item] = slot
    return size


@kernel
def top_item(heap: HeapArray) -> int:
    """Return the item with the lowest key."""
    return heap[0] & _ITEM_MASK  # type: ignore[no-any-return]


@kernel
def top_key(heap: HeapArray) -> np.float32:
    """Return the lowest key."""
    return np.int32(heap[0] >> _ITEM_BITS).view(np.float32)


@kernel
def remove_top(heap: HeapArray, positions: Int32Array, size: int) -> int:
    """Take the item with the lowest key off the heap; return the new size."""
    positions[heap[0] & _ITEM_MASK] = -1
    size -= 1
    if size == 0:
        return 0
    entry = heap[size]
    slot, first = 0, 1
    # Down to the leaves by the least of four children, in minima the compiler turns into code without branches.
    while first + 3 < size:
        a, b, c, d = heap[first], heap[first + 1], heap[first + 2], heap[first + 3]
        left, right = min(a, b), min(c, d)
        least = min(left, right)
        if least >= entry:
            break
        left_child, right_child = first if a < b else first + 1, first + 2 if c < d else first + 3
        child = left_child if left < right else right_child
        heap[slot] = least
        positions[least & _ITEM_MASK] = slot
        slot = child
        first = 4 * slot + 1
    else:  # at a leaf, or at the one node with fewer than four children, which are leaves
        child = first
        for other in range(first + 1, size):
            if heap[other] < heap[child]:
                child = other
        if first < size and heap[child] < entry:
            heap[slot] = heap[child]
            positions[heap[slot] & _ITEM_MASK] = slot
            slot = child
    heap[slot] = entry
    positions[entry & _ITEM_MASK] = slot
    return size
