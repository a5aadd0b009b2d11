"""The part of the surface under a round robot."""

from __future__ import annotations

import numpy as np

from mbf_mesh_nav.arrays import FloatArray, IntArray
from mbf_mesh_nav.kernels.compiled import Count, inner_array_kernel, inner_kernel, kernel

FIRST_BITS = 9
"""Binary logarithm of the places a table of vertices begins with; at most every second one is taken."""
SPREAD = 2654435769
"""Multiplier of Fibonacci hashing, see Knuth, The Art of Computer Programming 3, 6.4: neighbours land far apart."""


@kernel
def vertices_in_disc(
    vertices: FloatArray, offsets: IntArray, neighbours: IntArray, start: int, centre: FloatArray, radius: float
) -> IntArray:
    """Vertices reached from ``start`` over edges without leaving ``radius`` [m] of ``centre`` (3,); start included.

    Being connected, they lie on one storey; they come in the order of a breadth-first search. The work is that of the
    disc, however large the map: which vertices were seen is kept in a hash table with open addressing.
    """
    bits, size, head = Count(FIRST_BITS), Count(1), Count(0)
    members = np.empty(Count(1) << (bits - 1), dtype=np.int32)
    members[0] = start
    table = _table_of(members, size, bits)
    while True:
        # The search itself owns no array: numba would count references to one that it replaces, at every step.
        size, head = _search(vertices, offsets, neighbours, centre, radius, members, size, head, table, bits)
        if head == size:
            return _first(members, size, size)
        bits += 2
        members = _first(members, size, Count(1) << (bits - 1))
        table = _table_of(members, size, bits)


@inner_kernel
def _search(
    vertices: FloatArray,
    offsets: IntArray,
    neighbours: IntArray,
    centre: FloatArray,
    radius: float,
    members: IntArray,
    size: int,
    head: int,
    table: IntArray,
    bits: int,
) -> tuple[int, int]:
    """Go on from member ``head`` on until all are looked at or there is no more room; the new size and head."""
    room, squared = len(members), radius * radius
    x, y, z = centre[0], centre[1], centre[2]
    while head < size:
        vertex = members[head]
        for entry in range(offsets[vertex], offsets[vertex + 1]):
            other = Count(neighbours[entry])
            place = _place_of(table, bits, other)
            if table[place] == other:
                continue
            dx, dy, dz = vertices[other, 0] - x, vertices[other, 1] - y, vertices[other, 2] - z
            if dx * dx + dy * dy + dz * dz <= squared:
                if size == room:
                    return size, head
                table[place] = members[size] = other
                size += 1
        head += 1
    return size, head


@inner_array_kernel
def _table_of(members: IntArray, size: int, bits: int) -> IntArray:
    """The table of the first members."""
    table = np.empty(Count(1) << bits, dtype=np.int32)
    for place in range(len(table)):
        table[place] = -1
    for index in range(size):
        table[_place_of(table, bits, Count(members[index]))] = members[index]
    return table


@inner_kernel
def _place_of(table: IntArray, bits: int, vertex: int) -> int:
    """Where a vertex is in a table with room, else the free place that is its."""
    mask = len(table) - 1
    place = (vertex * SPREAD >> (32 - bits)) & mask
    while table[place] >= 0 and table[place] != vertex:
        place = (place + 1) & mask
    return place


@inner_array_kernel
def _first(members: IntArray, size: int, room: int) -> IntArray:
    """A copy of the first members in an array with ``room``."""
    copy = np.empty(room, dtype=np.int32)
    for index in range(size):
        copy[index] = members[index]
    return copy
