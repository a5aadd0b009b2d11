"""A tree of poses that a car can reach by arcs, and the best of them in each bin of cell and heading.

When to use: by ``hybrid_astar``, which grows one from the start and one from the goal. When not: searches over cells,
whose g fits into the grid itself; here a map of a million cells has 72 million bins, of which few are ever seen.

Bins are found by hashing (open addressing, linear probing, at most half full); all arrays grow by doubling.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.compiling.decorators import Count, kernel, plain_kernel

FIRST_CAPACITY = 4096
NO_STATE = -1


class StateTree(NamedTuple):
    """States 0 .. ``made[0]`` - 1; the root is state 0.

    Attributes
    ----------
    poses : (n, 3) float64
        x, y [m], yaw [rad].
    g : (n,) float64
        Weighted length [m] from the root.
    bins : (n,) int64
        Cell and heading.
    parents : (n,) int32
        NO_STATE for the root.
    motions : (n,) int8
        Arc that joins a state with its parent, see ``motion_primitives``.
    slots : (4 n,) int32
        Hash table: the best state of a bin, or NO_STATE.
    made : (1,) int64
    """

    poses: NDArray[np.float64]
    g: NDArray[np.float64]
    bins: NDArray[np.int64]
    parents: NDArray[np.int32]
    motions: NDArray[np.int8]
    slots: NDArray[np.int32]
    made: NDArray[np.int64]


@kernel
def new_tree(pose: NDArray[np.float64], bin_of_pose: int, motion: int) -> StateTree:
    """Tree that is only a root."""
    tree = _empty_tree(Count(FIRST_CAPACITY))
    return with_state(tree, pose, 0.0, bin_of_pose, Count(NO_STATE), Count(motion))


@kernel
def _empty_tree(capacity: int) -> StateTree:
    return StateTree(
        np.empty((capacity, 3)),
        np.empty(capacity),
        np.empty(capacity, dtype=np.int64),
        np.empty(capacity, dtype=np.int32),
        np.empty(capacity, dtype=np.int8),
        np.full(4 * capacity, NO_STATE, dtype=np.int32),
        np.zeros(1, dtype=np.int64),
    )


@plain_kernel
def _slot_of(tree: StateTree, bin_of_pose: int) -> int:
    """Place of a bin in the hash table, or the free place where it belongs."""
    last = np.uint64(tree.slots.size - 1)
    slot = ((np.uint64(bin_of_pose) * np.uint64(0x9E3779B97F4A7C15)) >> np.uint64(32)) & last
    while tree.slots[slot] >= 0 and tree.bins[tree.slots[slot]] != bin_of_pose:
        slot = (slot + np.uint64(1)) & last
    return int(slot)


@plain_kernel
def best_state(tree: StateTree, bin_of_pose: int) -> int:
    """Best state of a bin, or NO_STATE."""
    return int(Count(tree.slots[_slot_of(tree, bin_of_pose)]))


@kernel
def with_state(
    tree: StateTree, pose: NDArray[np.float64], g: float, bin_of_pose: int, parent: int, motion: int
) -> StateTree:
    """Append a state that is the best of its bin from now on; the tree it returns may stand in other memory."""
    state = tree.made[0]
    if state == tree.g.size:
        tree = _doubled(tree)
    tree.poses[state], tree.g[state], tree.bins[state] = pose, g, bin_of_pose
    tree.parents[state], tree.motions[state] = parent, motion
    tree.slots[_slot_of(tree, bin_of_pose)] = state
    tree.made[0] = state + 1
    return tree


@kernel
def _doubled(tree: StateTree) -> StateTree:
    count = tree.made[0]
    larger = _empty_tree(2 * count)
    larger.poses[:count], larger.g[:count], larger.bins[:count] = tree.poses, tree.g, tree.bins
    larger.parents[:count], larger.motions[:count] = tree.parents, tree.motions
    larger.made[0] = count
    for slot in range(tree.slots.size):
        state = tree.slots[slot]
        if state >= 0:
            larger.slots[_slot_of(larger, tree.bins[state])] = state
    return larger
