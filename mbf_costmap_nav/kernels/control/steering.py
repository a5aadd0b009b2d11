"""The best sequence of short arcs that a car can drive without touching anything: depth first, dear ones left early.

When to use: by ``control.close_steering``. When not: to look farther ahead than some arcs, as their number grows with a
power of it; that is a plan.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.compiling.decorators import Index, inner_kernel, kernel
from mbf_costmap_nav.kernels.costs import LETHAL
from mbf_costmap_nav.kernels.map.footprint_cost import footprint_cost

FloatArray = NDArray[np.float64]

ONE = Index(1)


@kernel
def best_sequence(
    cells: NDArray[np.uint8],
    geometry: FloatArray,
    samples: FloatArray,
    start: FloatArray,
    wanted: FloatArray,
    lengths: FloatArray,
    curvatures: FloatArray,
    now: float,
    steering_cost: float,
    reach: float,
    step: float,
    first_step: float,
) -> tuple[float, float]:
    """Return the curvature that begins the best sequence, and how far [m^2] that ends beside; inf if all touch.

    Parameters
    ----------
    cells : (height, width) uint8
    geometry : (resolution, origin_x, origin_y)
        [m].
    samples : (s, 2) float64
        Of the outline, in the base frame [m].
    start : (3,) float64
        Pose (x, y [m], yaw [rad]) of the car.
    wanted : (n, 3) float64
        Poses in which the arcs should end.
    lengths : (n,) float64
        Of the arcs [m]; negative = backward.
    curvatures : (k,) float64
        To choose from: change of heading per length [rad/m].
    now : float
        The curvature that is driven.
    steering_cost : float
        Of the square of a change of curvature [m^4].
    reach : float
        How far [m] before the base the end of the outline is that is kept to the path; negative = behind.
    step : float
        Farthest distance [m] of poses on an arc that are looked at.
    first_step : float
        How far [m] is driven until the choice is made anew, signed as ``lengths``; that pose is looked at, too.
    """
    last, level = Index(lengths.size - 1), Index(0)
    poses, costs = np.zeros((lengths.size, 3)), np.zeros(lengths.size)
    chosen = np.zeros(lengths.size, dtype=np.int64)
    poses[0, 0], poses[0, 1], poses[0, 2] = start[0], start[1], start[2]
    first, nearest, least = 0.0, np.inf, np.inf
    while level > 0 or chosen[0] < curvatures.size:
        if chosen[level] == curvatures.size:
            level -= ONE
            continue
        curvature, before = curvatures[chosen[level]], now
        if level > 0:
            before = curvatures[chosen[level - ONE] - 1]
        chosen[level] += 1
        x, y, yaw = _on_arc(poses, level, curvature, lengths[level])
        beside = _beside(wanted, level, x, y, yaw, reach)
        cost = costs[level] + beside + steering_cost * (curvature - before) * (curvature - before)
        if cost >= least or (level == 0 and _touches(cells, geometry, samples, poses, level, curvature, first_step)):
            continue
        if _touches_along(cells, geometry, samples, poses, level, curvature, lengths[level], step):
            continue
        if level == last:
            first, nearest, least = curvatures[chosen[0] - 1], beside, cost
            continue
        level += ONE
        poses[level, 0], poses[level, 1], poses[level, 2] = x, y, yaw
        costs[level], chosen[level] = cost, 0
    return first, nearest


@inner_kernel
def _on_arc(poses: FloatArray, start: int, curvature: float, length: float) -> tuple[float, float, float]:
    """Pose (x, y, yaw) so far [m] along an arc."""
    half_turn = 0.5 * curvature * abs(length)
    chord = length * np.sin(half_turn) / half_turn if abs(half_turn) > 1e-9 else length
    middle = poses[start, 2] + half_turn
    return poses[start, 0] + chord * np.cos(middle), poses[start, 1] + chord * np.sin(middle), middle + half_turn


@inner_kernel
def _beside(wanted: FloatArray, place: int, x: float, y: float, yaw: float, reach: float) -> float:
    """Squares [m^2] of how far base and farthest end are beside where they should be."""
    turn = (yaw - wanted[place, 2] + np.pi) % (2.0 * np.pi) - np.pi
    side = (y - wanted[place, 1]) * np.cos(wanted[place, 2]) - (x - wanted[place, 0]) * np.sin(wanted[place, 2])
    end = side + reach * turn
    return float(side * side + end * end)


@inner_kernel
def _touches(
    cells: NDArray[np.uint8],
    geometry: FloatArray,
    samples: FloatArray,
    poses: FloatArray,
    start: int,
    curvature: float,
    length: float,
) -> bool:
    """Whether the outline touches a lethal cell so far [m] along an arc."""
    x, y, yaw = _on_arc(poses, start, curvature, length)
    return footprint_cost(cells, geometry[0], geometry[1], geometry[2], samples, x, y, yaw) == LETHAL


@inner_kernel
def _touches_along(
    cells: NDArray[np.uint8],
    geometry: FloatArray,
    samples: FloatArray,
    poses: FloatArray,
    start: int,
    curvature: float,
    length: float,
    step: float,
) -> bool:
    """Whether it touches one anywhere on an arc."""
    count = int(np.ceil(abs(length) / step))
    for number in range(count):
        if _touches(cells, geometry, samples, poses, start, curvature, length * (number + 1.0) / count):
            return True
    return False
