"""From the points that a search has found to a path: joined legs, heights and headings."""

from __future__ import annotations

import math

import numpy as np

from mbf_abstract.geometry import FloatArray, Path, Pose, quaternion_from_yaw
from mbf_abstract.geometry.polyline import polyline_lengths
from mbf_abstract.plugins import PlanRequest
from mbf_costmap_nav.kernels.map.path_poses import level_path
from mbf_costmap_nav.planning.manoeuvres import Fitted


def heights_along(points: FloatArray, request: PlanRequest) -> FloatArray:
    """Heights [m] of a path on a flat map: interpolated linearly from the start's to the goal's."""
    along = polyline_lengths(points)
    share = along / along[-1] if along[-1] > 0.0 else along
    return np.asarray(request.start.z + share * (request.goal.z - request.start.z))


def assembled(
    pieces: list[Fitted], request: PlanRequest, goal: Pose, frame_id: str, stamp: float
) -> tuple[Path, float]:
    """Join the legs; poses head along the path or as the manoeuvres do, the first and the last one as requested.

    Returns the path and its length [m].
    """
    joined = pieces[0].points
    if len(pieces) > 1:
        joined = np.concatenate([joined, *(piece.points[1:] for piece in pieces[1:])])
    positions, orientations, length = level_path(np.ascontiguousarray(joined), request.start.z, request.goal.z)
    first = 0
    for piece in pieces:
        if piece.yaws is not None:
            for index in np.flatnonzero(~np.isnan(piece.yaws)).tolist():
                if index > 0 or first == 0:  # where legs meet the heading is that of the first one
                    orientations[first + index] = quaternion_from_yaw(piece.yaws[index])
        first += len(piece.points) - 1
    orientations[-1], orientations[0] = goal.orientation, request.start.orientation
    if not math.isfinite(length):  # heights at the end of what a float can be
        return Path(positions, orientations, frame_id, stamp), length
    return Path.of_checked_arrays(positions, orientations, frame_id, stamp), length
