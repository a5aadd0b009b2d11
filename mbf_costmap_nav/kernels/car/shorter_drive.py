"""Replace pieces of a drivable path by free curves that cost less.

When to use: behind ``hybrid_astar``, whose headings are binned and whose heuristic is weighted, so its paths wind a
little and where its trees met they may change direction for a few centimetres. When not: paths that are not made of a
car's curves; ``smoothing`` moves the points of those.

Windows of the path, first long ones, then ever shorter ones, are each compared with the shortest curve between their
ends (shortcuts as for any planner of paths: Geraerts and Overmars 2007).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.compiling.decorators import kernel
from mbf_costmap_nav.kernels.car.curves import curve_between, sample_word
from mbf_costmap_nav.kernels.car.ground import Ground, fitting_cost
from mbf_costmap_nav.kernels.car.motion_primitives import Car, change_of, curve_cost, weight_of

FloatArray = NDArray[np.float64]

SHORTEST_WINDOW = 16
"""Poses of the last windows."""
WORTH_WHILE = 0.99
"""A curve must cost at most this part of what it replaces."""


@kernel
def drive_costs(ground: Ground, car: Car, poses: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Cost (n,) [m] from the first pose of a path (n, 3) to each, and the direction (n,) in which it is reached."""
    costs, directions = np.zeros(len(poses)), np.zeros(len(poses))
    for i in range(1, len(poses)):
        dx, dy = poses[i, 0] - poses[i - 1, 0], poses[i, 1] - poses[i - 1, 1]
        turn = poses[i, 2] - poses[i - 1, 2]
        heading = poses[i - 1, 2] + 0.5 * turn
        directions[i] = 1.0 if np.cos(heading) * dx + np.sin(heading) * dy >= 0.0 else -1.0
        steering = 0.0 if abs(turn) < 1e-9 else 1.0
        cell = max(0, fitting_cost(ground, poses[i]))
        length = np.hypot(dx, dy) * weight_of(car, steering, directions[i]) * (1.0 + car.cost_factor * cell / 252.0)
        costs[i] = costs[i - 1] + change_of(car, directions[i - 1], directions[i]) + length
    return costs, directions


@kernel
def shortened(ground: Ground, car: Car, poses: FloatArray, cancel_flag: NDArray[np.uint8]) -> tuple[FloatArray, float]:
    """Path (m, 3) of the same ends as ``poses`` (n, 3: x, y [m], yaw [rad]) that costs as much or less, and its cost.

    All headings of ``poses`` run on without jumps of 2 pi; so do those of the result. With the flag set it ends early.
    """
    window = len(poses) - 1
    costs, directions = drive_costs(ground, car, poses)
    while window >= SHORTEST_WINDOW and cancel_flag[0] == 0:
        begin = 0
        while begin < len(poses) - 1:
            end = min(begin + window, len(poses) - 1)
            after = directions[end + 1] if end + 1 < len(poses) else 0.0
            limit = WORTH_WHILE * (costs[end] - costs[begin])
            word = curve_between(poses[begin], poses[end], car.radius, car.reversing)
            if curve_cost(ground, car, poses[begin], word, directions[begin], after, limit) < limit:
                x, y, yaw = poses[begin]
                curve = sample_word(x, y, yaw, word, car.radius, ground.geometry[0])
                rest = poses[end + 1 :].copy()
                rest[:, 2] += curve[len(curve) - 1, 2] - poses[end, 2]
                poses = np.concatenate((poses[: begin + 1], curve, rest))
                costs, directions = drive_costs(ground, car, poses)
            begin += max(1, window // 4)
        window //= 2
    return poses, costs[len(poses) - 1]
