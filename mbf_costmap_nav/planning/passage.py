"""Whether any way to a goal is wide enough for a robot's outline, asked after searches that found none.

When to use: by ``car_search``, before it looks at more states, and for the walls that stay (``permanent_walls``). When
not: to find a path; that there is a wide way does not mean that a car gets round its corners.
"""

from __future__ import annotations

from dataclasses import dataclass

from mbf_abstract.geometry import Pose
from mbf_costmap_nav.grid.costmap import Costmap
from mbf_costmap_nav.grid.footprint import Footprint
from mbf_costmap_nav.planning.outline_reach import where_outline_is_stuck
from mbf_costmap_nav.planning.widest_disc import disc_gets_there, widest_disc


@dataclass(frozen=True)
class TooNarrow:
    """Why no way to a goal is wide enough; ``text`` is the rest of a sentence on a path."""

    text: str


def too_narrow(costmap: Costmap, footprint: Footprint, start: Pose, goal: Pose, tolerance: float) -> TooNarrow | None:
    """Why the outline gets from a pose nowhere within ``tolerance`` [m] of another; None if it may get there."""
    if not disc_gets_there(costmap, footprint, start, goal, tolerance):
        return TooNarrow(f"no way there is as wide as the robot, {2.0 * widest_disc(footprint)[2]:.2f} m")
    stuck = where_outline_is_stuck(costmap, footprint, start, goal, tolerance)
    if stuck is None:
        return None
    (x, y), (length, width) = stuck, footprint.vertices.max(axis=0) - footprint.vertices.min(axis=0)
    text = f"no way there leaves the robot, {length:.2f} m x {width:.2f} m, room to turn or to pass; it gets no farther"
    return TooNarrow(f"{text} than ({x:.2f}, {y:.2f})")
