"""Whether a goal is permanently unreachable: separated by walls and keep-out areas alone.

On the current map a wall and a movable box look the same. So the search is repeated on the map of those layers that no
sensor writes: where even that has no path, waiting and trying again are useless.
"""

from __future__ import annotations

import numpy as np

from mbf_abstract.geometry import Pose
from mbf_costmap_nav.grid.costmap import INSCRIBED, UNKNOWN
from mbf_costmap_nav.map.layered_costmap import LayeredCostmap

EIGHT_NEIGHBOURS = np.ones((3, 3), dtype=bool)


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
    free = (walls.cells < max(lethal_cost, INSCRIBED)) | (walls.cells == UNKNOWN)
    ix, iy = walls.world_to_cell_clamped(start.x, start.y)
    if not free[iy, ix]:
        return False
    from scipy import ndimage  # takes 0.13 s to import, and most plans are found

    pieces, _ = ndimage.label(free, EIGHT_NEIGHBOURS)
    goal_x, goal_y = walls.world_to_cell_clamped(goal.x, goal.y)
    reach = tolerance / walls.resolution + 1.0 if tolerance > 0.0 else 0.0
    near = int(min(reach, max(pieces.shape)))  # the tolerance may be inf
    left, below = max(goal_x - near, 0), max(goal_y - near, 0)
    around = pieces[below : goal_y + near + 1, left : goal_x + near + 1]
    rows, columns = np.nonzero(around == pieces[iy, ix])
    return bool(((columns + left - goal_x) ** 2 + (rows + below - goal_y) ** 2 > reach * reach).all())
