"""How a footprint that touches obstacles of a costmap may move: nothing deeper, and nothing else.

When to use: where the robot stands in a contact. When not: a robot that touches nothing, which collides where
``FootprintCheck`` says so.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from mbf_abstract.geometry import FloatArray, Pose
from mbf_costmap_nav.grid.costmap import LETHAL, Costmap
from mbf_costmap_nav.grid.footprint import Footprint
from mbf_costmap_nav.grid.footprint_check import FootprintCheck
from mbf_costmap_nav.kernels.map.penetration import first_deeper

ROUNDING = 0.1
"""How much [cells] deeper counts as no deeper: along a wall the depth of a round outline goes up and down so far."""
ADJOINING = np.ones((3, 3), dtype=bool)
"""Lethal cells that have a side or a corner in common are one thing."""


def first_refused(costmap: Costmap, check: FootprintCheck, pose: Pose, poses: FloatArray) -> int:
    """Index of the first of poses (n, 3: x, y, yaw) to which a robot that touches something at ``pose`` must not move.

    It must touch nothing deeper than now and nothing else, nothing at all once it is free, and less somewhere: else all
    of it is refused. -1 if it may move so.
    """
    free = np.flatnonzero(~check.collisions(costmap, poses))
    leaves = int(free[0]) if len(free) else len(poses)
    worse, deepest = first_deeper_pose(costmap, check.footprint, pose, poses[:leaves])
    if worse >= 0:
        return worse
    if leaves < len(poses):
        hit = check.first_collision(costmap, poses[leaves:])
        return leaves + hit if hit >= 0 else -1
    return -1 if deepest[1:].min(initial=np.inf) < deepest[0] - ROUNDING else 0


def contact_depth(costmap: Costmap, footprint: Footprint, pose: Pose) -> float:
    """How deep [m] a footprint lies in lethal cells at a pose; 0 where ``FootprintCheck`` says it touches none."""
    if not check_of(footprint, costmap.resolution).collides(costmap, pose.x, pose.y, pose.yaw):
        return 0.0
    _, deepest = first_deeper_pose(costmap, footprint, pose, np.zeros((0, 3)))
    return costmap.resolution * max(float(deepest[0]) + 0.5, ROUNDING)


@lru_cache(maxsize=8)
def check_of(footprint: Footprint, resolution: float) -> FootprintCheck:
    """The check of a footprint on cells of a size [m], kept for the next question."""
    return FootprintCheck(footprint, resolution)


def first_deeper_pose(
    costmap: Costmap, footprint: Footprint, pose: Pose, poses: FloatArray, *, counts_border: bool = False
) -> tuple[int, FloatArray]:
    """First of poses (n, 3: x, y, yaw) where a footprint touches something deeper than at ``pose``, or something else.

    Parameters
    ----------
    poses : (n, 3) float64
        Of a motion from ``pose`` on, less than a cell from one to the next.
    counts_border : bool
        Whether what lies off the map is an obstacle.

    Returns
    -------
    index : int
        -1 without one. After a pose where nothing is touched everything is something else.
    deepest : (1 + n,) float64
        Greatest depth [cells] at ``pose`` and then at each of the poses up to that one, see ``first_deeper``.
    """
    from scipy.ndimage import label  # takes 0.13 s to import, and most robots touch nothing

    outlines = np.array([on_cells(costmap, footprint, x, y, yaw) for x, y, yaw in [(pose.x, pose.y, pose.yaw), *poses]])
    x0, y0 = np.floor(outlines.min(axis=(0, 1))).astype(int) - 1
    columns, rows = np.ceil(outlines.max(axis=(0, 1))).astype(int) + 1 - (x0, y0)
    blocked = np.full((rows, columns), counts_border)
    low, left = max(0, y0), max(0, x0)
    there = costmap.cells[low : max(0, y0 + rows), left : max(0, x0 + columns)]
    blocked[low - y0 :, left - x0 :][: there.shape[0], : there.shape[1]] = there == LETHAL
    things, _ = label(blocked, ADJOINING)
    first, deepest = first_deeper(things, outlines - (x0, y0), ROUNDING)
    return int(first) - 1 if first < len(outlines) else -1, deepest


def on_cells(costmap: Costmap, footprint: Footprint, x: float, y: float, yaw: float) -> FloatArray:
    """Corners (n, 2) [cells] of the footprint at a pose x, y [m], yaw [rad] of the costmap's frame."""
    corners = footprint.at(x, y, yaw) if len(footprint.vertices) > 2 else np.array([[x, y]])
    return np.asarray((corners - (costmap.origin_x, costmap.origin_y)) / costmap.resolution)
