"""What a car drives, and what it costs: the arcs of ``hybrid_astar``, and the curves that join their ends.

When to use: by ``hybrid_astar``, whose steps are longer than a cell where the turning circle is large. When not:
trajectories of velocities in time, which ``rollout`` integrates.

The cost of a piece is its length times (1 + cost_factor * cost of the cells / 252), times a factor where it is driven
backward and one where it is curved; each change of direction is added. Arcs and curves are sampled a cell apart: the
footprint is looked at at each sample, and the centre in every cell between two of them, so the path made of the same
samples is free wherever it is drawn.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.compiling.decorators import Count, kernel, plain_kernel
from mbf_costmap_nav.kernels.car.curves import drive, sample_word
from mbf_costmap_nav.kernels.car.ground import Ground, driven_cost
from mbf_costmap_nav.kernels.car.state_tree import StateTree

FloatArray = NDArray[np.float64]

FORWARD_MOTIONS, MOTIONS = 3, 6
"""Motions 0-2 go right, straight and left; 3-5 do so backward."""
NO_MOTION = -1
"""Of the root of a tree."""
FORWARD_SIDE, BACKWARD_SIDE = 1.0, -1.0
"""Sides of a tree: the car drives from its root, or to it."""


class Car(NamedTuple):
    """How a car drives, and the costs that a search for its path weighs.

    Attributes
    ----------
    radius : float
        Of the turning circle [m].
    cost_factor, reverse_factor, turning_factor : float
        What cells of cost 252 add to a length, in lengths; factors on lengths driven backward, and on those of curves.
    change_cost : float
        Of a change of direction [m].
    bin_size : float
        Side of the square [m] in which poses of one heading bin are the same for the search.
    step : float
        Length of an arc [m].
    pieces : int
        Samples on an arc.
    """

    radius: float
    reversing: bool
    cost_factor: float
    reverse_factor: float
    turning_factor: float
    change_cost: float
    bin_size: float
    step: float
    pieces: int


@plain_kernel
def steering_of(motion: int) -> float:
    """-1 right, 0 straight, 1 left."""
    return float(motion % 3 - 1)


@plain_kernel
def direction_of(motion: int) -> float:
    """1 forward, -1 backward, 0 for no motion."""
    if motion == NO_MOTION:
        return 0.0
    return 1.0 if motion < FORWARD_MOTIONS else -1.0


@plain_kernel
def weight_of(car: Car, steering: float, direction: float) -> float:
    """Factor on the length of a piece over free cells."""
    weight = car.reverse_factor if direction < 0.0 else 1.0
    return weight if steering == 0.0 else weight * car.turning_factor


@plain_kernel
def change_of(car: Car, before: float, after: float) -> float:
    """Cost [m] of driving in the direction ``after`` behind ``before``; 0 stands for none."""
    return car.change_cost if before * after < 0.0 else 0.0


@plain_kernel
def sample_arc(pose: FloatArray, motion: int, side: float, car: Car, into: FloatArray) -> None:
    """Fill ``into`` (pieces, 3) with poses evenly spaced over an arc from (or on the backward side to) a pose."""
    signed, steering = side * direction_of(motion) * car.step, steering_of(motion)
    for i in range(car.pieces):
        share = (i + 1) / car.pieces
        into[i, 0], into[i, 1], into[i, 2] = drive(pose[0], pose[1], pose[2], steering, signed * share, car.radius)


@kernel
def path_from_root(tree: StateTree, last: int, side: float, car: Car) -> FloatArray:
    """Poses (n, 3) from the root of a tree to state ``last``, in the order of the tree on either side."""
    arcs, state = 0, last
    while tree.parents[state] >= 0:
        arcs += 1
        state = tree.parents[state]
    path = np.empty((1 + arcs * car.pieces, 3))
    path[0] = tree.poses[state]
    state = last
    for arc in range(arcs - 1, -1, -1):
        begin, parent = 1 + arc * car.pieces, tree.parents[state]
        sample_arc(tree.poses[parent], Count(tree.motions[state]), side, car, path[begin : begin + car.pieces])
        state = parent
    return path


@kernel
def curve_cost(
    ground: Ground, car: Car, start: FloatArray, word: FloatArray, before: float, after: float, limit: float
) -> float:
    """Cost [m] of a curve driven from a pose, between the directions ``before`` and ``after`` (0 = standing).

    inf if the car does not fit all along it, or as soon as it is not below ``limit``.
    """
    if np.abs(word[:, 1]).sum() * car.radius >= limit:
        return np.inf
    total, pose, previous = 0.0, start, before
    for segment in range(word.shape[0]):
        length = word[segment, 1] * car.radius
        if abs(length) < 1e-9:
            continue
        direction = 1.0 if length > 0.0 else -1.0
        total += change_of(car, previous, direction)
        previous = direction
        poses = sample_word(pose[0], pose[1], pose[2], word[segment : segment + 1], car.radius, ground.geometry[0])
        cost = driven_cost(ground, pose, poses)
        total += abs(length) * weight_of(car, word[segment, 0], direction) * (1.0 + car.cost_factor * cost / 252.0)
        if cost < 0.0 or total >= limit:
            return np.inf
        pose = poses[poses.shape[0] - 1]
    total += change_of(car, previous, after)
    return total if total < limit else np.inf
