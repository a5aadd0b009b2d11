"""A map for a round robot, on which the recoveries and queries of the core run.

When to use: derive ``DiscMap`` in a map backend of your own. When not: robots whose outline matters, surfaces above
each other.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import replace
from numbers import Real

import numpy as np

from mbf_abstract.config.findings import describe_value
from mbf_abstract.geometry import FloatArray, Pose, Twist
from mbf_abstract.geometry.arcs import arc_poses
from mbf_abstract.maps.controllers.failures import obstacle_text
from mbf_abstract.maps.navigation_map import NavigationMap
from mbf_abstract.maps.queries import CellState, PlaceAnswer, PlaceCheck, PlaceQuery, PoseAnswer
from mbf_abstract.parameters import ParameterError

STRIDE = 0.05
"""Distance [m] between two checked places of a motion."""


def disc_radius(footprint: object) -> float:
    """Radius [m] that stands for an outline in ``set_footprint`` of a map for a disc; ParameterError if it is none."""
    if isinstance(footprint, bool) or not isinstance(footprint, Real):
        text = "footprint: expected a radius in m, because this map treats the robot as a disc"
        raise ParameterError(f"{text}, got {describe_value(footprint)}")
    return float(footprint)


class DiscMap(NavigationMap):
    """A map for a disc.

    Attributes
    ----------
    robot_radius : float
        Radius [m] of the disc.
    """

    robot_radius: float

    @abstractmethod
    def place(self, x: float, y: float, safety_dist: float = 0.0) -> PlaceAnswer:
        """State and cost at a place [m] for a disc grown by ``safety_dist`` [m]; INSCRIBED where it would touch."""

    @abstractmethod
    def candidates(self, x: float, y: float, dist_tolerance: float) -> FloatArray:
        """Places (n, 3) [m] where the robot might fit, in any order; those beyond the tolerance [m] are ignored."""

    @abstractmethod
    def obstacles_near(self, x: float, y: float, within: float) -> FloatArray:
        """Places (n, 2) [m] of all obstacles within a distance [m]; others may be there, and what is off the map."""

    @property
    def inscribed_radius(self) -> float:
        """Radius [m] of the disc."""
        return self.robot_radius

    def point_check(self) -> PlaceCheck:
        """State and cost of points: INSCRIBED where a robot would touch something."""
        return lambda pose: self.place(pose.x, pose.y)

    def pose_check(self, query: PlaceQuery, *, center_only: bool = False) -> PlaceCheck:
        """State and cost of the disc: LETHAL where it touches something, INSCRIBED where it covers such a centre."""
        if center_only:
            return self.point_check()

        def check(pose: Pose) -> PlaceAnswer:
            answer = self.place(pose.x, pose.y, query.safety_dist)
            if answer.state is CellState.INSCRIBED:
                return replace(answer, state=CellState.LETHAL)
            around = self.place(pose.x, pose.y, query.safety_dist + self.robot_radius)
            is_near = answer.state is CellState.FREE and around.state is CellState.INSCRIBED
            return replace(answer, state=CellState.INSCRIBED) if is_near else answer

        return check

    def find_valid_pose(
        self, pose: Pose, dist_tolerance: float, angle_tolerance: float, query: PlaceQuery
    ) -> PoseAnswer:
        """Return the pose itself if the disc fits, else the nearest free candidate within ``dist_tolerance`` [m].

        The heading stays.
        """
        check = self.pose_check(query)
        first = check(pose)
        if first.state < CellState.LETHAL:
            return PoseAnswer(first.state, first.cost, pose)
        points = self.candidates(pose.x, pose.y, dist_tolerance)
        distances = np.hypot(points[:, 0] - pose.x, points[:, 1] - pose.y)
        for index in np.argsort(distances, kind="stable"):
            if distances[index] > dist_tolerance:
                break
            x, y, z = points[index].tolist()
            there = replace(pose, position=(x, y, z))
            answer = check(there)
            if answer.state < CellState.LETHAL:
                return PoseAnswer(answer.state, answer.cost, there)
        return PoseAnswer(first.state, first.cost, None)

    def obstacle_ahead(self, pose: Pose, command: Twist, duration: float) -> str:
        """Where within ``duration`` [s] the disc would come to touch an obstacle, or nearer to one it touches."""
        if command.speed == 0.0:
            return ""
        step = min(STRIDE / command.speed, duration)
        ahead = arc_poses((pose.x, pose.y, pose.yaw), command.vx, command.vy, command.wz, duration, step)
        before = self.clearance(pose.x, pose.y)
        for x, y, _ in ahead.tolist():
            clearance = self.clearance(x, y)
            if clearance < self.robot_radius and clearance < before:
                return obstacle_text(f"({x:.2f}, {y:.2f})")
            before = clearance
        return ""

    def nearest_obstacle(self, pose: Pose, within: float) -> tuple[float, float, float] | None:
        """Offset [m] to the nearest obstacle; None if none is ``within`` [m]."""
        offsets = self.obstacles_near(pose.x, pose.y, within) - (pose.x, pose.y)
        distances = np.hypot(offsets[:, 0], offsets[:, 1])
        if len(distances) == 0 or distances.min() > within:
            return None
        dx, dy = offsets[int(np.argmin(distances))].tolist()
        return dx, dy, 0.0

    def clearance(self, x: float, y: float) -> float:
        """Distance [m] of the nearest obstacle from a place; may be inf beyond the radius of the disc."""
        offset = self.nearest_obstacle(Pose.planar(x, y, frame_id=self.frame_id), self.robot_radius)
        return math.inf if offset is None else math.hypot(*offset)
