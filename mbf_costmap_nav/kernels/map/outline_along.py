"""Whether a robot's outline fits all along a path over cells; mostly it does, and then nothing else is to be asked."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.compiling.decorators import inner_kernel, kernel
from mbf_costmap_nav.kernels.costs import LETHAL
from mbf_costmap_nav.kernels.map.footprint_cost import first_collision, footprint_cost
from mbf_costmap_nav.kernels.map.path_poses import course_along, headed_poses

FloatArray = NDArray[np.float64]


@kernel
def fits_along(
    cells: NDArray[np.uint8],
    resolution: float,
    origin_x: float,
    origin_y: float,
    samples: FloatArray,
    points: FloatArray,
    arm: float,
    turn_step: float,
    start_yaw: float,
    end_yaw: float,
) -> bool:
    """Whether no lethal cell lies under the samples on the course along points, while turning at its ends, and at them.

    Parameters
    ----------
    cells, resolution, origin_x, origin_y, samples
        As for ``footprint_cost``.
    points : (k, 2) float64
        Of the path [m].
    arm : float
        See ``course_along``.
    turn_step : float
        Largest angle [rad] between two poses of a turn.
    start_yaw, end_yaw : float
        Headings [rad] from which, and to which, the robot turns where the path begins and ends; nan = it does not.
    """
    poses, lengths = course_along(points, resolution, arm)
    last = len(poses) - 1
    if lengths[last] == 0.0 or first_collision(cells, resolution, origin_x, origin_y, samples, poses) >= 0:
        return False
    for pose, yaw in ((poses[0], start_yaw), (poses[last], end_yaw)):
        if not math.isnan(yaw) and _turn_collides(cells, resolution, origin_x, origin_y, samples, pose, yaw, turn_step):
            return False
    headed = headed_poses(points)[1:-1]
    return bool(first_collision(cells, resolution, origin_x, origin_y, samples, headed) < 0)


@inner_kernel
def _turn_collides(
    cells: NDArray[np.uint8],
    resolution: float,
    origin_x: float,
    origin_y: float,
    samples: FloatArray,
    pose: FloatArray,
    yaw: float,
    step: float,
) -> bool:
    """Whether the outline touches something on the shorter turn from a pose (3,) to ``yaw`` [rad]."""
    turn = np.fmod(yaw - pose[2], 2.0 * math.pi)
    if turn <= -math.pi:
        turn += 2.0 * math.pi
    elif turn > math.pi:
        turn -= 2.0 * math.pi
    count = math.ceil(abs(turn) / step)
    for number in range(1, count + 1):
        heading = pose[2] + turn * (number / count)
        if footprint_cost(cells, resolution, origin_x, origin_y, samples, pose[0], pose[1], heading) == LETHAL:
            return True
    return False
