"""What a footprint would touch along a motion on a costmap, and where the nearest obstacle lies.

A robot that already touches an obstacle may move as long as it touches nothing deeper and nothing else, so backing out
of a collision works and driving on into it does not (``contact``); once it is free it stays so. Where the whole
footprint lies on obstacles no direction is known to lead out, and only ``escape`` may move.

A robot that touches nothing collides where planners and controllers say so, by the samples of ``FootprintCheck``: a
corner of a cell that the outline clips by less than a quarter of its side counts for none of them. Otherwise a path
that a planner has returned could be refused.
"""

from __future__ import annotations

import math

import numpy as np

from mbf_abstract.geometry import FloatArray, Pose, Twist
from mbf_abstract.geometry.arcs import arc_poses
from mbf_abstract.maps.controllers.failures import obstacle_text
from mbf_costmap_nav.grid.contact import check_of, first_deeper_pose, on_cells
from mbf_costmap_nav.grid.costmap import LETHAL, Costmap
from mbf_costmap_nav.grid.footprint import Footprint
from mbf_costmap_nav.kernels.map.footprint_cost import OUTSIDE
from mbf_costmap_nav.kernels.map.rasterisation import blocked_under

CYCLE = 0.05
"""Time [s] from one command to the next: the poses looked at include those where a controller is asked again."""


def obstacle_ahead(
    costmap: Costmap,
    footprint: Footprint,
    pose: Pose,
    command: Twist,
    duration: float,
    *,
    leaves_collisions: bool = False,
    may_overhang: bool = False,
) -> str:
    """Where the motion would touch obstacles or the map's border deeper than now, as a text; empty if it is free.

    Parameters
    ----------
    pose : Pose
        Of the base, in the frame of the costmap.
    command : Twist
        Kept for ``duration`` [s].
    leaves_collisions : bool
        Whether the motion was chosen to lead out of a collision, however deep it is.
    may_overhang : bool
        Whether the footprint may reach over the map's border as long as the base does not leave the map.
    """

    def blocked_at(x: float, y: float, yaw: float) -> tuple[int, int]:
        return blocked_cells(costmap, footprint, x, y, yaw, counts_border=not may_overhang)

    collision = (LETHAL,) if may_overhang else (LETHAL, OUTSIDE)
    check = check_of(footprint, costmap.resolution)
    allowed, _ = blocked_at(pose.x, pose.y, pose.yaw)
    touches = allowed > 0 and not leaves_collisions
    on_map = costmap.contains(pose.x, pose.y)
    outline_speed = command.speed + abs(command.wz) * footprint.circumscribed_radius
    step = float(np.clip(0.5 * costmap.resolution / max(outline_speed, 1e-6), duration / 100.0, duration))
    if step < duration:
        step = CYCLE / math.ceil(CYCLE / step)
    ahead = arc_poses((pose.x, pose.y, pose.yaw), command.vx, command.vy, command.wz, duration, step)
    if allowed == 0 and _stays_inside(costmap, footprint, ahead):
        first = check.first_collision(costmap, ahead)
        ahead = ahead[first:] if first >= 0 else ahead[:0]
    worse = first_deeper_pose(costmap, footprint, pose, ahead, counts_border=not may_overhang)[0] if touches else -1
    for index, (x, y, yaw) in enumerate(ahead.tolist()):
        blocked, covered = blocked_at(x, y, yaw)
        if touches:
            deeper, touches = index == worse, blocked > 0
        else:
            deeper = blocked > allowed and (allowed > 0 or check.cost(costmap, x, y, yaw) in collision)
        leaves_map = may_overhang and on_map and not costmap.contains(x, y)
        if deeper or leaves_map or (blocked == covered and not leaves_collisions):
            return obstacle_text(f"({x:.2f}, {y:.2f}, {yaw:.2f} rad)")
        allowed = allowed if blocked else 0
    return ""


def _stays_inside(costmap: Costmap, footprint: Footprint, poses: FloatArray) -> bool:
    """Whether all of a footprint with an area stays on the map at poses (n, 3: x, y, yaw)."""
    reach = footprint.circumscribed_radius + costmap.resolution
    low, high = poses[:, :2].min(axis=0) - reach, poses[:, :2].max(axis=0) + reach
    return len(footprint.vertices) > 2 and costmap.contains(*low.tolist()) and costmap.contains(*high.tolist())


def blocked_cells(
    costmap: Costmap, footprint: Footprint, x: float, y: float, yaw: float, *, counts_border: bool = True
) -> tuple[int, int]:
    """How many of the cells under the footprint are lethal or, if the border counts, off the map; how many in all.

    Each cell counts once, whatever part of it is covered. So a robot that backs out of a collision touches less and
    less; counted by samples, an obstacle weighs more under the outline, where they are denser.
    """
    blocked, covered = blocked_under(costmap.cells, on_cells(costmap, footprint, x, y, yaw), counts_border)
    return int(blocked), int(covered)


def nearest_lethal(costmap: Costmap, pose: Pose, within: float) -> tuple[float, float, float] | None:
    """Offset [m] of the nearest lethal cell's centre, along the axes of the map; None if none is ``within`` [m]."""
    reach = math.ceil(within / costmap.resolution) + 1
    ix, iy = costmap.world_to_cell_clamped(pose.x, pose.y)
    x0, y0 = max(ix - reach, 0), max(iy - reach, 0)
    rows, columns = np.nonzero(costmap.cells[y0 : iy + reach + 1, x0 : ix + reach + 1] == LETHAL)
    if rows.size == 0:
        return None
    offsets = costmap.cells_to_world(np.column_stack([columns + x0, rows + y0])) - (pose.x, pose.y)
    distances = np.hypot(*offsets.T)
    nearest = int(np.argmin(distances))
    dx, dy = offsets[nearest].tolist()
    return (dx, dy, 0.0) if distances[nearest] <= within else None
