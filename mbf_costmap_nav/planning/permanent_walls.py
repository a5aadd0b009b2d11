"""Whether a goal is permanently unreachable, or a start blocked: by walls and keep-out areas alone.

On the current map a wall and a movable box look the same. So the search is repeated on the map of those layers that no
sensor writes: where even that has no path, waiting and trying again are useless.
"""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import Pose
from mbf_costmap_nav.grid.costmap import INSCRIBED, UNKNOWN, Costmap
from mbf_costmap_nav.grid.footprint_check import FootprintCheck
from mbf_costmap_nav.map.layered_costmap import LayeredCostmap
from mbf_costmap_nav.map.pose_checks import find_valid_pose
from mbf_costmap_nav.planning.passage import too_narrow
from mbf_costmap_nav.planning.widest_disc import in_reach

EIGHT_NEIGHBOURS = np.ones((3, 3), dtype=bool)

_pieces_of: WeakKeyDictionary[Costmap, dict[int, NDArray[np.unsignedinteger]]] = WeakKeyDictionary()
"""Connected pieces of free space by the least cost that is not free; the costmap is the same until walls change."""


def is_in_walls(costmap: LayeredCostmap, pose: Pose, lethal_cost: int = INSCRIBED) -> bool:
    """Whether permanent walls cover the cell of a pose; ``lethal_cost`` is the planner's."""
    walls = costmap.permanent_costmap()
    cell = None if walls is None else walls.world_to_cell(pose.x, pose.y)
    return walls is not None and cell is not None and max(lethal_cost, INSCRIBED) <= walls.cost(*cell) != UNKNOWN


def touches_walls(costmap: LayeredCostmap, pose: Pose) -> bool:
    """Whether the robot's outline touches a permanent wall at a pose."""
    walls = costmap.permanent_costmap()
    if walls is None:
        return False
    return FootprintCheck(costmap.footprint, walls.resolution).touched(walls, pose.x, pose.y, pose.yaw) is not None


def is_permanently_unreachable(
    costmap: LayeredCostmap, start: Pose, goal: Pose, tolerance: float, lethal_cost: int = INSCRIBED
) -> bool:
    """Whether permanent walls separate a start from all cells within ``tolerance`` [m] of a goal.

    The test is conservative: unknown cells, cut corners and costs below the inscribed one count as free, and the answer
    is false for a start in a wall and for poses off the map. ``lethal_cost`` is the planner's.
    """
    walls = costmap.permanent_costmap()
    if walls is None or not (walls.contains(start.x, start.y) and walls.contains(goal.x, goal.y)):
        return False
    threshold = max(lethal_cost, INSCRIBED)
    ix, iy = walls.world_to_cell_clamped(start.x, start.y)
    if threshold <= walls.cells[iy, ix] != UNKNOWN:
        return False
    reach = tolerance / walls.resolution + 1.0 if tolerance > 0.0 else 0.0
    return not in_reach(_pieces(walls, threshold), (ix, iy), walls.world_to_cell_clamped(goal.x, goal.y), reach)


def is_permanently_too_narrow(costmap: LayeredCostmap, start: Pose, goal: Pose, tolerance: float) -> bool:
    """Whether permanent walls leave no way that is wide enough for the robot to within ``tolerance`` [m] of a goal."""
    walls = costmap.permanent_costmap()
    if walls is None or not (walls.contains(start.x, start.y) and walls.contains(goal.x, goal.y)):
        return False
    return too_narrow(walls, costmap.footprint, start, goal, tolerance) is not None


def never_fits(costmap: LayeredCostmap, goal: Pose, tolerance: float, angle_tolerance: float) -> bool:
    """Whether the outline touches permanent walls at all poses within both tolerances [m, rad] of a goal.

    The outline is taken a quarter of a cell smaller: so much may lie between the samples that planners look at.
    """
    walls = costmap.permanent_costmap()
    if walls is None or not walls.contains(goal.x, goal.y):
        return False
    spare = 0.25 * walls.resolution
    if len(costmap.footprint.vertices) < 3 or costmap.footprint.inscribed_radius <= spare:
        return False
    return find_valid_pose(walls, costmap.footprint.padded(-spare), goal, tolerance, angle_tolerance).pose is None


def _pieces(walls: Costmap, threshold: int) -> NDArray[np.unsignedinteger]:
    """Number (height, width) of the connected piece of free or unknown space that a cell belongs to, 0 in walls."""
    found = _pieces_of.setdefault(walls, {})
    if threshold not in found:
        from scipy import ndimage  # takes 0.13 s to import, and most plans are found

        free = (walls.cells < threshold) | (walls.cells == UNKNOWN)
        pieces, count = ndimage.label(free, EIGHT_NEIGHBOURS)
        found[threshold] = pieces.astype(np.min_scalar_type(count))  # mostly a byte a cell, as the map itself
    return found[threshold]
