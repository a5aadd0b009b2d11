"""What controllers on meshes share about arriving: the goal test, and the approach to the end of a path."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mbf_abstract.execution.path_tracker import PathTracker
from mbf_abstract.geometry import Path, Pose
from mbf_abstract.geometry.tangent_plane import ground_distance, heading_error
from mbf_abstract.maps.controllers.turn_at_goal import TurnAtGoal
from mbf_mesh_nav.map.mesh_map import MeshMap


def is_at_goal(pose: Pose, goal: Pose, dist_tolerance: float, angle_tolerance: float) -> bool:
    """Whether ``pose`` is within ``dist_tolerance`` [m] and its heading within ``angle_tolerance`` [rad] of the goal.

    Distances and headings are those in the robot's tangent plane, so a goal given without the height and slope of
    the surface can be reached.
    """
    return ground_distance(pose, goal) <= dist_tolerance and abs(heading_error(pose, goal)) <= angle_tolerance


def tracker_on_surface(mesh_map: MeshMap, path: Path, reach: float) -> PathTracker:
    """Track a path whose last pose is put onto the surface, at most ``reach`` [m] away: no robot drives up to it."""
    end = mesh_map.locate_one(path.positions[-1], reach)
    if end is None:
        return PathTracker(path)
    return PathTracker(replace(path, positions=np.concatenate([path.positions[:-1], end.point[None]])))


class GoalApproach:
    """How a robot approaches the end of its path: along the path, then to the position, then to the heading.

    Parameters
    ----------
    goal : Pose
        Last pose of the path as requested.
    reach : float
        Distance [m] at which the position counts as reached, unless the goal's tolerance is less.
    straying : float
        So many times its deviation from the path a robot may be short of the path's end; for controllers that do not
        keep to the path.
    """

    def __init__(self, goal: Pose, reach: float, straying: float = 0.0) -> None:
        self.goal = goal
        self._straying = straying
        self._turn_at_goal = TurnAtGoal(reach)

    def is_reached(self, pose: Pose, tracker: PathTracker, dist_tolerance: float, angle_tolerance: float) -> bool:
        """Whether the robot has driven to the end of the path and stands there within the tolerances [m, rad]."""
        self._turn_at_goal.take_tolerances(dist_tolerance, angle_tolerance)
        tracker.update(pose.position)
        driven = self._has_driven(tracker, dist_tolerance)
        return driven and is_at_goal(pose, self.goal, dist_tolerance, angle_tolerance)

    def is_only_turning(self, pose: Pose, tracker: PathTracker) -> bool:
        """Whether only the heading is left, with the pose of this cycle, see ``TurnAtGoal``."""
        limit = self._turn_at_goal.limit
        is_near = self._has_driven(tracker, limit) and ground_distance(pose, self.goal) <= limit
        return self._turn_at_goal.update(is_near, heading_error(pose, self.goal))

    def _has_driven(self, tracker: PathTracker, reach: float) -> bool:
        return tracker.has_arrived(reach + self._straying * tracker.deviation)


def clamp(value: float, limit: float) -> float:
    """Limit a value symmetrically to [-limit, limit]."""
    return max(-limit, min(limit, value))
