"""Occupied cubes out of the nodes of an octree as OctoMap writes them.

Nodes come depth first, from the root on, the eight children of a node in the order of their number: bit 0 is the upper
half along x, bit 1 along y, bit 2 along z. The tree has 16 levels below the root.
"""

from __future__ import annotations

import numpy as np

from mbf_mesh_nav.arrays import BoolArray, IntArray
from mbf_mesh_nav.kernels.compiled import inner_kernel, kernel, plain_kernel

LEVELS = 16
OCCUPIED, INNER = 2, 3
"""What two bits of a binary file state of a child; 0 = unknown, 1 = free."""
CUT_OFF, TOO_DEEP = -1, -2
"""Instead of the nodes read: the last ones are missing, or one is below the last level."""


@inner_kernel
def enter_child(corners: IntArray, depth: int, child: int) -> int:
    """Write the lower corner of a child of the open node at ``depth`` one level deeper; return the child's edge."""
    edge = 1 << (LEVELS - 1 - depth)
    for axis in range(3):
        corners[depth + 1, axis] = corners[depth, axis] + edge * ((child >> axis) & 1)
    return edge


@inner_kernel
def keep_cube(cubes: IntArray, found: int, corners: IntArray, depth: int, edge: int) -> None:
    """Write an occupied cube, if there is room for it."""
    if found < cubes.shape[0]:
        for axis in range(3):
            cubes[found, axis] = corners[depth, axis]
        cubes[found, 3] = edge


@kernel
def cubes_of_inner_nodes(kinds: IntArray, cubes: IntArray) -> tuple[int, int, int]:
    """Occupied cubes of a binary file, which holds the inner nodes alone, two bits for each child.

    Parameters
    ----------
    kinds : (n,) int32
        The 16 bits of each node, those of child 0 lowest.
    cubes : (m, 4) int32
        Filled with the x, y and z of the lower corners and with the edges, in voxels from the lower corner of the
        tree; an empty array only counts.

    Returns
    -------
    read, nodes, found : int
        Inner nodes read, or ``CUT_OFF`` or ``TOO_DEEP``; nodes of the tree, leaves included; occupied cubes.
    """
    opened, child = np.zeros(LEVELS, dtype=np.int32), np.zeros(LEVELS, dtype=np.int32)
    corners = np.zeros((LEVELS + 1, 3), dtype=np.int32)
    read, nodes, found, depth = 1, 1, 0, 0
    if kinds.shape[0] == 0:
        return CUT_OFF, nodes, found
    opened[0] = kinds[0]
    while depth >= 0:
        if child[depth] == 8:
            depth -= 1
            continue
        kind = (opened[depth] >> (2 * child[depth])) & 3
        edge = enter_child(corners, depth, child[depth])
        child[depth] += 1
        nodes += kind > 0
        if kind == OCCUPIED:
            keep_cube(cubes, found, corners, depth + 1, edge)
            found += 1
        elif kind == INNER:
            if depth + 1 == LEVELS:
                return TOO_DEEP, nodes, found
            if read == kinds.shape[0]:
                return CUT_OFF, nodes, found
            depth += 1
            opened[depth], child[depth] = kinds[read], 0
            read += 1
    return read, nodes, found


@kernel
def cubes_of_all_nodes(children: IntArray, is_occupied: BoolArray, cubes: IntArray) -> tuple[int, int]:
    """Occupied cubes of a full file, which holds all nodes.

    Parameters
    ----------
    children : (n,) int32
        A bit for each child that exists; 0 = a leaf.
    is_occupied : (n,) bool
        Of inner nodes it does not matter.
    cubes
        As of ``cubes_of_inner_nodes``.

    Returns
    -------
    read, found : int
        Nodes read, or ``CUT_OFF`` or ``TOO_DEEP``; occupied cubes.
    """
    left = np.zeros(LEVELS + 1, dtype=np.int32)  # children of the open nodes that are still to come
    corners = np.zeros((LEVELS + 1, 3), dtype=np.int32)
    read, found, depth, edge = 0, 0, 0, 1 << LEVELS
    while depth >= 0:
        if read == children.shape[0]:
            return CUT_OFF, found
        if children[read] and depth == LEVELS:
            return TOO_DEEP, found
        if children[read] == 0 and is_occupied[read]:
            keep_cube(cubes, found, corners, depth, edge)
            found += 1
        left[depth] = children[read]
        read += 1
        while depth >= 0 and left[depth] == 0:
            depth -= 1
        if depth >= 0:
            child = 0
            while not (left[depth] >> child) & 1:
                child += 1
            left[depth] &= left[depth] - 1
            edge = enter_child(corners, depth, child)
            depth += 1
    return read, found


@plain_kernel
def voxels_of_cubes(cubes: IntArray, voxels: IntArray) -> None:
    """Write the x, y and z of all voxels (n, 3) of the cubes (m, 4)."""
    count = 0
    for cube in range(cubes.shape[0]):
        edge = cubes[cube, 3]
        for x in range(edge):
            for y in range(edge):
                for z in range(edge):
                    voxels[count, 0] = cubes[cube, 0] + x
                    voxels[count, 1] = cubes[cube, 1] + y
                    voxels[count, 2] = cubes[cube, 2] + z
                    count += 1
