"""The priority queue of the continuous wave: a ring of unsorted buckets by key, and a heap of the bucket at hand.

Most vertices are queued well ahead of the front and wait in a bucket, where adding one costs a few writes; only the
handful whose turn is next is kept in order. Entries leave strictly by (key, item), as from a heap, so the width of a
bucket changes nothing but the speed. A key that drops is queued again: the caller compares the key of an entry with
that of its item and drops the older one.

When to use: where the order of settling matters and keys grow by steps of about one size. When not: a plain
shortest-path field, which is faster with ``near_far.py``; keys without bound below the current one.

The caller owns ``heads`` (RING,) int32, full of ``EMPTY``, the buckets as linked lists; ``links`` and ``entries`` (n,)
int32 and uint64, room for all entries ever put in; ``near`` (n,) uint64, the heap. An entry is key and item in one
number, see ``entry_of``.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.arrays import IntArray
from mbf_mesh_nav.kernels.compiled import ONE, Count, Index, inlined_kernel, inner_kernel

Entries = NDArray[np.uint64]

RING = 2048
"""Buckets; keys farther ahead wait in the last one and are sorted in again."""
BUCKETS_PER_STEP: Any = np.float32(160)
"""Buckets that a step of the wave crosses; with so many, few entries share one."""
EMPTY = -1
BUCKET_MASK: Any = Index(RING - 1)
_ITEM_BITS: Any = Index(32)
_ITEM_MASK: Any = Index(0xFFFFFFFF)


@inner_kernel
def entry_of(key: np.float32, item: int) -> int:
    """Key >= 0 and item in one number: the bits of a positive float32 order like an integer, the item breaks ties."""
    return (Index(np.float32(key).view(np.uint32)) << _ITEM_BITS) | item  # type: ignore[no-any-return]


@inner_kernel
def item_of(entry: int) -> int:
    """Return the item of an entry."""
    return entry & _ITEM_MASK  # type: ignore[no-any-return]


@inner_kernel
def key_of(entry: int) -> np.float32:
    """Return the key of an entry."""
    return np.uint32(entry >> _ITEM_BITS).view(np.float32)


@inner_kernel
def put(
    heads: IntArray,
    links: IntArray,
    entries: Entries,
    near: Entries,
    used: int,
    near_size: int,
    bucket: int,
    inverse_width: np.float32,
    entry: int,
) -> tuple[int, int]:
    """Add an entry; returns the numbers of entries used so far and of those in the heap."""
    place = Count(key_of(entry) * inverse_width)
    if place <= bucket:
        return used, _push(near, near_size, entry)
    entries[used] = entry
    _link(heads, links, used, min(place, bucket + RING - 1))
    return used + ONE, near_size


@inlined_kernel
def next_bucket(
    heads: IntArray, links: IntArray, entries: Entries, near: Entries, bucket: int, inverse_width: np.float32
) -> tuple[int, int]:
    """Fill the heap, which is empty, from the next bucket that has something; returns that bucket and the heap's size.

    The size is 0 if nothing waits any more.
    """
    near_size, empty, is_more_ahead = Index(0), 0, False
    while near_size == Index(0) and empty < RING:
        bucket += 1
        empty += 1
        waiting = heads[Index(bucket) & BUCKET_MASK]
        heads[Index(bucket) & BUCKET_MASK] = EMPTY
        while waiting != EMPTY:
            number = Index(waiting)
            entry, following = entries[number], links[number]
            place = Count(key_of(entry) * inverse_width)
            if place <= bucket:
                near_size = _push(near, near_size, entry)
            else:  # too far ahead when it was put in
                _link(heads, links, number, min(place, bucket + RING - 1))
                is_more_ahead = True
            waiting = following
    if near_size == Index(0) and is_more_ahead:  # a whole round and nothing was due
        return _go_to_least(heads, links, entries, near, inverse_width)
    return bucket, near_size


@inner_kernel
def _go_to_least(
    heads: IntArray, links: IntArray, entries: Entries, near: Entries, inverse_width: np.float32
) -> tuple[int, int]:
    """Fill the empty heap from the bucket of the least entry, however far ahead, and sort the others in behind it."""
    # 1. All that waits in one list, and where the least of it belongs.
    waiting, bucket = Count(EMPTY), Count(2**62)
    for slot in range(RING):
        entry = Count(heads[slot])
        heads[slot] = EMPTY
        while entry != EMPTY:
            following = Count(links[entry])
            bucket = min(bucket, Count(key_of(entries[entry]) * inverse_width))
            links[entry] = waiting
            waiting, entry = entry, following
    # 2. Into the heap, or into the ring that starts there.
    near_size = Index(0)
    while waiting != EMPTY:
        following, place = Count(links[waiting]), Count(key_of(entries[waiting]) * inverse_width)
        if place <= bucket:
            near_size = _push(near, near_size, entries[waiting])
        else:
            _link(heads, links, Index(waiting), min(place, bucket + RING - 1))
        waiting = following
    return bucket, near_size


@inner_kernel
def _link(heads: IntArray, links: IntArray, number: int, place: int) -> None:
    """Put an entry at the head of a bucket's list."""
    slot = Index(place) & BUCKET_MASK
    links[number] = heads[slot]
    heads[slot] = number


@inner_kernel
def _push(near: Entries, size: int, entry: int) -> int:
    """Add an entry to the binary heap; returns its new size."""
    slot = Index(size)
    while slot > Index(0):
        parent = (slot - ONE) >> ONE
        if near[parent] <= entry:
            break
        near[slot] = near[parent]
        slot = parent
    near[slot] = entry
    return size + ONE  # type: ignore[no-any-return]


@inner_kernel
def remove_least(near: Entries, size: int) -> int:
    """Take ``near[0]`` off the heap; returns its new size."""
    end = Index(size) - ONE
    entry = near[end]
    slot, child = Index(0), ONE
    while child < end:
        if child + ONE < end and near[child + ONE] < near[child]:
            child += ONE
        if near[child] >= entry:
            break
        near[slot] = near[child]
        slot = child
        child = (slot << ONE) + ONE
    near[slot] = entry
    return end  # type: ignore[no-any-return]
