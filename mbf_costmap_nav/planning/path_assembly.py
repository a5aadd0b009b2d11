"""From the points that a search has found to a path: exact ends, joined legs, heights and headings."""

from __future__ import annotations

import numpy as np

from mbf_abstract.geometry import FloatArray, Path, Pose, quaternion_from_yaw
from mbf_abstract.geometry.polyline import polyline_lengths
from mbf_abstract.plugins import PlanRequest
from mbf_costmap_nav.kernels.map.path_poses import level_path
from mbf_costmap_nav.planning.manoeuvres import Fitted
from mbf_costmap_nav.planning.search_grid import SearchGrid

NEAR_END = 0.75
"""Points this near [cells] to an exact start or goal are dropped: going there first would be a step back."""

FIRST = 8
"""So many points are looked at at a time for the first that is far enough."""


def with_exact_ends(grid: SearchGrid, points: FloatArray, start: Pose, goal: Pose | None) -> FloatArray:
    """Replace the cell centres at the ends by the exact start, and by the exact goal if it was reached."""
    points = _from_exactly(grid, np.array([start.x, start.y]), points)
    return points if goal is None else _from_exactly(grid, np.array([goal.x, goal.y]), points[::-1])[::-1]


def _from_exactly(grid: SearchGrid, exact: FloatArray, points: FloatArray) -> FloatArray:
    """Begin with a point of the first point's cell instead of that point, and of what lies as near.

    Where the line from there to the rest is blocked, all points are kept: a line within one cell is free.
    """
    if len(points) == 1:
        return np.stack([exact, points[0]])
    rest = points[1 + _near(points[1:-1], exact, NEAR_END * grid.costmap.resolution) :]
    return np.vstack([exact, rest if grid.is_free_line(exact, rest[0]) else points])


def _near(points: FloatArray, exact: FloatArray, distance: float) -> int:
    """How many of the first points (n, 2) are at most a distance [m] from a point; mostly only few are looked at."""
    for begin in range(0, len(points), FIRST):
        far = np.hypot(*(points[begin : begin + FIRST] - exact).T) > distance
        if far.any():
            return begin + int(np.argmax(far))
    return len(points)


def heights_along(points: FloatArray, request: PlanRequest) -> FloatArray:
    """Heights [m] of a path on a flat map: interpolated linearly from the start's to the goal's."""
    along = polyline_lengths(points)
    share = along / along[-1] if along[-1] > 0.0 else along
    return np.asarray(request.start.z + share * (request.goal.z - request.start.z))


def assembled(pieces: list[Fitted], request: PlanRequest, goal: Pose, frame_id: str, stamp: float) -> Path:
    """Join the legs; poses head along the path or as the manoeuvres do, the first and the last one as requested."""
    points = np.concatenate([pieces[0].points, *(piece.points[1:] for piece in pieces[1:])])
    yaws = np.concatenate([pieces[0].yaws, *(piece.yaws[1:] for piece in pieces[1:])])
    positions, orientations = level_path(np.ascontiguousarray(points), request.start.z, request.goal.z)
    for index in np.flatnonzero(~np.isnan(yaws[:-1])).tolist():
        orientations[index] = quaternion_from_yaw(yaws[index])
    orientations[-1], orientations[0] = goal.orientation, request.start.orientation
    return Path(positions, orientations, frame_id, stamp)
