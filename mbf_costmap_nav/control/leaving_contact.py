"""How a robot that touches something drives out of it: straight, after a turn where that is needed.

When to use: in controllers of robots that turn on the spot. When not: where nothing is touched; in recoveries, which
drive a given motion.

On an arc a robot rubs along what it touches, and friction turns it towards it: pushed against a pillar it presses on
along its path until it is stuck at the pillar's corner. So it turns to its path first, if a straight drive leads out
there within ``WITHIN``; else it drives straight on, if that does; else it turns farther, away from its path.
"""

from __future__ import annotations

import numpy as np

from mbf_abstract.geometry import FloatArray
from mbf_abstract.geometry.arcs import arc_poses
from mbf_abstract.maps.controllers.end_of_path import swept_poses
from mbf_abstract.maps.controllers.room_to_turn import SMALL_TURN
from mbf_costmap_nav.control.path_handling import ControlCycle

WITHIN = 0.15
"""Distance [m] within which it must touch less."""
OFF_PATH = (0.25, 0.5)
"""Angles [rad] to both sides of the direction to the path, tried in this order: it may lead along what is touched."""


def turn_that_leads_out(cycle: ControlCycle, bearing: float, backward: bool) -> float | None:
    """Angle [rad] to turn by before driving straight, 0 if the heading does; None if nothing leads out.

    Parameters
    ----------
    bearing : float
        Angle [rad] from the direction of driving to the path.
    backward : bool
        Whether it is to drive backward.
    """
    angles = [0.0] if abs(bearing) < SMALL_TURN else [bearing, 0.0]
    angles += [bearing + side * angle for angle in OFF_PATH for side in (1.0, -1.0)]
    return next((angle for angle in angles if cycle.first_collision(_poses(cycle, angle, backward)) < 0), None)


def _poses(cycle: ControlCycle, angle: float, backward: bool) -> FloatArray:
    """Poses (n, 3) of a turn by an angle [rad] and of a straight drive after it, half a cell of the outline apart."""
    pose, half_cell = cycle.request.pose, 0.5 * cycle.costmap.resolution
    speed = -half_cell if backward else half_cell
    straight = arc_poses((pose.x, pose.y, pose.yaw + angle), speed, 0.0, 0.0, WITHIN / half_cell, 1.0)
    if angle == 0.0:
        return straight
    reach = max(cycle.footprint.footprint.circumscribed_radius, cycle.costmap.resolution)
    return np.vstack([swept_poses(pose, angle, half_cell / reach), straight])
