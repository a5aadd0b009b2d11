"""Drive along the vector field a planner hands on with its path: turn towards the local direction, slow by the error.

Strengths: needs no projection onto a path; the field leads to the goal from wherever a disturbance pushes the robot, so
it never has to return to a line. Known failure: knows only what the plan knew, stops before obstacles seen later
(BLOCKED_PATH) and does not drive around them (``mesh.mppi`` does); a path without a field (``mesh.astar``) is refused.
Cost: below 1 ms a cycle, most of it for looking ahead.

The law is that of mesh_navigation's mesh controller, with its faults corrected: the yaw rate is limited on both sides,
the speed fades towards the goal, rounding cannot break the angle, and the field is the plan's own.
"""

from __future__ import annotations

import math

import numpy as np

from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.geometry.arithmetic import norm, rotated_back
from mbf_abstract.geometry.tangent_plane import ground_distance, heading_error
from mbf_abstract.maps.controllers.failures import blocked_path
from mbf_abstract.maps.controllers.inertia import PLANNED, InertiaParameters, speed_before_bends, stopping_speed
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.parameters import parameter
from mbf_abstract.plugins import ControlRequest, ControlResult
from mbf_mesh_nav.arrays import FloatArray
from mbf_mesh_nav.mesh.locate import SurfacePoint
from mbf_mesh_nav.motion.goal_approach import GoalApproach, clamp, tracker_on_surface
from mbf_mesh_nav.motion.surface_follower import OBSTACLE_STEP, SteeringFollower
from mbf_mesh_nav.motion.vector_field import VectorField

STRAYING = 2.0
"""The field leads to the goal from anywhere, not back to the path: a robot off the path comes to its end otherwise."""

NO_FIELD = "it brings no vector field along; plans of mesh.cvp do, as long as nothing refines or copies them"


class VectorFieldParameters(InertiaParameters):
    """Parameters of ``mesh.vector_field``."""

    max_vel_x: float = parameter(1.0, "Forward speed limit.", unit="m/s", gt=0.0, le=5.0)
    max_vel_theta: float = parameter(0.5, "Yaw rate limit, in both directions.", unit="rad/s", gt=0.0, le=2.0)
    rotate_to_heading_min_angle: float = parameter(
        math.radians(20.0), "Beyond this heading error the robot turns on the spot.", unit="rad", gt=0.0, le=math.pi
    )
    lin_vel_factor: float = parameter(1.0, "Multiplies the speed before it is limited.", ge=0.1, le=10.0)
    ang_vel_factor: float = parameter(7.0, "Multiplies the yaw rate before it is limited.", ge=0.1, le=10.0)
    arrival_fading: float = parameter(0.5, "The speed falls linearly within this distance.", unit="m", gt=0.0, le=5.0)
    min_speed: float = parameter(0.08, "Speed at which fading ends.", unit="m/s", gt=0.0, le=1.0)
    goal_distance: float = parameter(
        0.08, "Nearer to the goal than this the robot only turns to the final heading.", unit="m", gt=0.0, le=1000.0
    )
    check_ahead_dist: float = parameter(
        1.0,
        "How far ahead the field must be free on the current map; 0 = it is not checked.",
        unit="m",
        was="obstacle_distance",
        ge=0.0,
        le=20.0,
    )
    cost_limit: float = parameter(1.0, "Surface whose cost reaches this is an obstacle.", gt=0.0, allow_inf=True)
    via_distance: float = parameter(0.3, "A via point counts as passed within this distance.", unit="m", gt=0.0)
    max_surface_distance: float = parameter(
        0.4, "Farther from the surface than this the robot is out of the map.", unit="m", gt=0.0, le=2.0
    )


class VectorFieldController(SteeringFollower):
    """Follows the field of the plan it executes."""

    Parameters = VectorFieldParameters
    parameters: VectorFieldParameters

    _face = -1
    _measured = Twist()

    def set_plan(self, path: Path) -> bool:
        """Take over a path that brings its vector fields along; refuse others, and those of another mesh or frame."""
        fields = path.guidance if isinstance(path.guidance, tuple) else ()
        if why := self.not_on_mesh(path):
            return self.refuse(why)
        if not fields or not all(isinstance(one, VectorField) for one in fields):
            return self.refuse(NO_FIELD)
        if not all(one.topology is self.mesh_map.topology for one in fields):
            return self.refuse("its vector field belongs to another mesh, plan again")
        self._fields: tuple[VectorField, ...] = fields
        self._tracker = tracker_on_surface(self.mesh_map, self._last_leg(path), self.parameters.max_surface_distance)
        self._approach = GoalApproach(path[-1], self.parameters.goal_distance, STRAYING)
        self._leg, self._face = 0, -1
        self._keeping.set_plan(path)
        return True

    def free_motion(self, request: ControlRequest) -> ControlResult:
        """One cycle: locate, look up the direction, apply the law."""
        pose, self._measured = request.pose, request.velocity
        cycle = self.begin_cycle(pose, self.parameters.max_surface_distance, self._face)
        if isinstance(cycle, ControlResult):
            return cycle
        spot, approach = cycle
        self._face = spot.face
        self._pass_via(spot.point)
        if self._on_last_leg and approach.is_only_turning(pose, self._tracker):
            off = heading_error(pose, approach.goal)
            if obstacle := self.outline_on(pose, Twist.planar(wz=off), 1.0):
                return blocked_path(self.mesh_map, pose, obstacle)
            return self._command(0.0, self._turn_rate(off))
        direction = self._fields[self._leg].direction_at(self.mesh_map, spot)
        if direction is None:
            return ControlResult(ExePathOutcome.MISSED_PATH, "the vector field does not lead on from here")
        p = self.parameters
        if (closely := self.closely(request, p.max_vel_x)) is not None:
            return closely
        places = self._places_ahead(spot)
        if obstacle := self.obstacle_along(places, p.max_surface_distance, p.cost_limit):
            return blocked_path(self.mesh_map, pose, obstacle)
        ahead = rotated_back(pose.rotation, direction)
        is_slow = p.acc_lim_x < math.inf
        fastest = speed_before_bends(places[:, :2], OBSTACLE_STEP, p, p.max_vel_theta) if is_slow else math.inf
        result = self._steer(math.atan2(ahead[1], ahead[0]), ground_distance(pose, approach.goal), fastest)
        return self.fitting(request, result, p.max_vel_x, 1.0)

    def is_goal_reached(self, pose: Pose, dist_tolerance: float, angle_tolerance: float) -> bool:
        """Whether the last leg has been driven to its end, and the last pose of the plan is reached."""
        if self._approach is None or not self._on_last_leg:
            self._keeping.update(pose, dist_tolerance, angle_tolerance)
            return False
        return super().is_goal_reached(pose, dist_tolerance, angle_tolerance)

    @property
    def _on_last_leg(self) -> bool:
        return self._leg == len(self._fields) - 1

    def _last_leg(self, path: Path) -> Path:
        """Part of the path behind its last via point."""
        if len(self._fields) == 1:
            return path
        return path[int(np.argmin(norm(path.positions - self._fields[-2].goal))) :]

    def _pass_via(self, point: FloatArray) -> None:
        """Go on to the next leg where its via point is passed; on the last leg keep the progress."""
        if self._on_last_leg:
            self._tracker.update(point)
        else:
            self._leg += bool(norm(self._fields[self._leg].goal - point) <= self.parameters.via_distance)

    def _places_ahead(self, spot: SurfacePoint) -> FloatArray:
        """Places (n, 3) [m] where the field leads from here, ``OBSTACLE_STEP`` apart."""
        p, field, places = self.parameters, self._fields[self._leg], [spot.point]
        there: SurfacePoint | None = spot
        for _ in range(math.ceil(p.check_ahead_dist / self.limit_factor / OBSTACLE_STEP)):
            direction = None if there is None else field.direction_at(self.mesh_map, there)
            if there is None or direction is None or norm(field.goal - there.point) <= OBSTACLE_STEP:
                break
            places.append(there.point + OBSTACLE_STEP / float(norm(direction)) * direction)
            there = self.mesh_map.locate_one(places[-1], p.max_surface_distance, there.face)
        return np.array(places)

    def _steer(self, error: float, distance_to_goal: float, fastest: float) -> ControlResult:
        """Apply the law to a heading error [rad, left positive], within ``fastest`` [m/s], ``distance_to_goal`` [m]."""
        p = self.parameters
        if abs(error) > p.rotate_to_heading_min_angle:
            return self._command(0.0, self._turn_rate(error))
        speed = p.max_vel_x * (1.0 - abs(error) / p.rotate_to_heading_min_angle) * p.lin_vel_factor
        fading = min(1.0, distance_to_goal / p.arrival_fading) if self._on_last_leg else 1.0
        seen = p.check_ahead_dist or math.inf
        seen = min(distance_to_goal, seen) if self._on_last_leg else seen
        stopping = stopping_speed(seen, PLANNED * p.acc_lim_x, p.reaction_time)
        faded = max(min(p.max_vel_x * fading, stopping, fastest), p.min_speed)
        return self._command(min(speed, faded, p.max_vel_x), self._turn_rate(error))

    def _turn_rate(self, error: float) -> float:
        p = self.parameters
        return p.turn_rate(error * p.max_vel_theta / math.pi * p.ang_vel_factor, error)

    def _command(self, speed: float, turn: float) -> ControlResult:
        p = self.parameters
        command = Twist.planar(vx=speed, wz=clamp(turn, p.max_vel_theta))
        return ControlResult(ExePathOutcome.SUCCESS, "", self.reachable(command, self._measured, p.max_vel_theta))
