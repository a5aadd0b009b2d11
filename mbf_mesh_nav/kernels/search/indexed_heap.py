"""The priority queue of A* over (vertex, heading): an indexed 4-ary heap over flat arrays.

Four children per node halve the depth of a binary heap and share a cache line; the position array turns "decrease
key" into a constant-time look-up, so no vertex is ever queued twice. Use it where the order of settling matters and
keys drop often; a plain shortest-path field is faster with the near/far lists of ``dijkstra.py``.

The heap is two arrays owned by the caller: ``heap`` (n,) uint64 and ``positions`` (n,) int32, the place of each item
(negative: not queued). Items are of type ``Index``. An entry is key and item in one number, see
``bucket_queue.entry_of``: one comparison orders by key and, among equal keys, by item, which makes the order of
settling the same everywhere. Functions return the new size.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.arrays import IntArray
from mbf_mesh_nav.kernels.compiled import ONE, Index, plain_kernel
from mbf_mesh_nav.kernels.wave.bucket_queue import entry_of, item_of, key_of

HeapArray = NDArray[np.uint64]

_TWO: Any = Index(2)
_THREE: Any = Index(3)


@plain_kernel
def push_or_decrease(heap: HeapArray, positions: IntArray, size: int, item: int, key: np.float32) -> int:
    """Queue ``item`` with ``key`` >= 0, or lower its key if it is queued already; return the new size."""
    entry = entry_of(np.float32(key), item)
    position = positions[item]
    slot = Index(position)
    if position < 0:
        slot = Index(size)
        size += 1
    while slot > Index(0):
        parent = (slot - ONE) >> _TWO
        above = heap[parent]
        if above <= entry:
            break
        heap[slot] = above
        positions[item_of(above)] = slot
        slot = parent
    heap[slot] = entry
    positions[item] = slot
    return size


@plain_kernel
def top_item(heap: HeapArray) -> int:
    """Return the item with the lowest key."""
    return item_of(heap[0])


@plain_kernel
def top_key(heap: HeapArray) -> np.float32:
    """Return the lowest key."""
    return key_of(heap[0])


@plain_kernel
def remove_top(heap: HeapArray, positions: IntArray, size: int) -> int:
    """Take the item with the lowest key off the heap; return the new size."""
    positions[item_of(heap[0])] = -1
    size -= 1
    if size == 0:
        return size
    end = Index(size)
    entry = heap[end]
    slot, first = Index(0), ONE
    # Down to the leaves by the least of four children, in minima the compiler turns into code without branches.
    while first + _THREE < end:
        a, b, c, d = heap[first], heap[first + ONE], heap[first + _TWO], heap[first + _THREE]
        left, right = min(a, b), min(c, d)
        least = min(left, right)
        if least >= entry:
            break
        left_child, right_child = first if a < b else first + ONE, first + _TWO if c < d else first + _THREE
        child = left_child if left < right else right_child
        heap[slot] = least
        positions[item_of(least)] = slot
        slot = child
        first = (slot << _TWO) + ONE
    else:  # at a leaf, or at the one node with fewer than four children, which are leaves
        child = first
        for other in range(first + ONE, end):
            if heap[other] < heap[child]:
                child = other
        if first < end and heap[child] < entry:
            heap[slot] = heap[child]
            positions[item_of(heap[slot])] = slot
            slot = child
    heap[slot] = entry
    positions[item_of(entry)] = slot
    return size
