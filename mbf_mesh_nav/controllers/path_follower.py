"""Pure pursuit in the robot's tangent plane: steers along the arc through a point ahead on the path.

Strengths: needs only poses (any planner's path), a dozen lines of law, robust: a skid-steered robot that turns
slower than commanded still converges, since the arc is computed anew every cycle. Slows down on slopes, in bends and
towards the goal, and turns on the spot when the path leads elsewhere. Known failure: cuts corners by about
``look_ahead_dist``² / (8 x bend radius); stops before new obstacles (BLOCKED_PATH) but does not drive around
it: plan anew while driving, or use ``mesh.mppi``.
Cost: below 0.2 ms a cycle. Law: Coulter, "Implementation of the pure pursuit path tracking algorithm", CMU, 1992.
"""

from __future__ import annotations

import math

import numpy as np

from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.geometry.arcs import arc_to, in_robot_frame, poses_on_arc
from mbf_abstract.geometry.arithmetic import norm, rotated
from mbf_abstract.geometry.tangent_plane import heading_error
from mbf_abstract.maps.controllers.driving_out import Gears, LeavesContacts, OnPath
from mbf_abstract.maps.controllers.failures import blocked_path, missed_path
from mbf_abstract.maps.controllers.inertia import PLANNED, InertiaParameters, speed_on_path, stopping_speed
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.parameters import parameter
from mbf_abstract.plugins import ControlRequest, ControlResult
from mbf_mesh_nav.arrays import FloatArray
from mbf_mesh_nav.map.places import FORBIDDEN_COST
from mbf_mesh_nav.motion.goal_approach import GoalApproach, clamp, tracker_on_surface
from mbf_mesh_nav.motion.surface_follower import OBSTACLE_STEP, SteeringFollower

SHARES = (1.0, 0.5, 0.25)
"""Shares of the look-ahead that are tried where the arc to a point farther ahead cuts a corner that is not free."""
ARC_STEP = 0.05
"""Distance [m] of the places on an arc that are looked at."""
CLOSELY = 1.0
"""Time [s] that a robot takes at least to a point nearer than the usual one."""


class PathFollowerParameters(InertiaParameters):
    """Parameters of ``mesh.path_follower``."""

    look_ahead_dist: float = parameter(0.6, "Distance of the pursued point along the path.", unit="m", gt=0.0, le=10.0)
    max_vel_x: float = parameter(0.8, "Forward speed on a flat, straight path.", unit="m/s", gt=0.0, le=5.0)
    min_speed: float = parameter(0.08, "Lowest forward speed while driving.", unit="m/s", gt=0.0, le=1.0)
    max_vel_theta: float = parameter(1.0, "Yaw rate limit, in both directions.", unit="rad/s", gt=0.0, le=5.0)
    decel_lim_x: float = parameter(0.4, "Deceleration planned before the goal.", unit="m/s^2", gt=0.0)
    max_lateral_acceleration: float = parameter(0.6, "Limits the speed in bends.", unit="m/s^2", gt=0.0)
    rotate_to_heading_min_angle: float = parameter(
        0.9, "Beyond this heading error the robot turns on the spot.", unit="rad", gt=0.0, le=math.pi
    )
    turn_gain: float = parameter(2.0, "Yaw rate per heading error when turning on the spot.", unit="1/s", gt=0.0)
    slow_slope: float = parameter(
        0.5, "Slope of the surface at which the speed is down to slope_speed_factor.", unit="rad", gt=0.0, le=1.5
    )
    slope_speed_factor: float = parameter(0.5, "Share of the speed left on slow_slope and beyond.", gt=0.0, le=1.0)
    goal_distance: float = parameter(
        0.08, "Nearer to the goal than this the robot only turns to the final heading.", unit="m", gt=0.0, le=1000.0
    )
    max_path_distance: float = parameter(
        1.0, "Farther from the path than this the path is missed.", unit="m", gt=0.0, allow_inf=True
    )
    check_ahead_dist: float = parameter(
        1.0,
        "How far ahead the path must be free on the current map; 0 = it is not checked.",
        unit="m",
        was="obstacle_distance",
        ge=0.0,
        le=20.0,
    )
    cost_limit: float = parameter(1.0, "Surface whose cost reaches this is an obstacle.", gt=0.0, allow_inf=True)
    max_surface_distance: float = parameter(
        1.0, "Farther from the surface than this the robot is out of the map.", unit="m", gt=0.0
    )


class PathFollower(LeavesContacts, SteeringFollower):
    """Pure pursuit on the surface."""

    Parameters = PathFollowerParameters
    parameters: PathFollowerParameters
    _measured = Twist()

    @classmethod
    def reach(cls, parameters: PathFollowerParameters) -> float:
        """To the end of the path that is checked, from a robot beside it."""
        ahead = parameters.check_ahead_dist
        return max(ahead + parameters.max_path_distance if ahead else 0.0, parameters.max_surface_distance)

    def set_plan(self, path: Path) -> bool:
        """Take over a path of at least one pose in the map's frame."""
        if why := self.not_on_mesh(path):
            return self.refuse(why)
        self._tracker = tracker_on_surface(self.mesh_map, path, self.parameters.max_surface_distance)
        self._approach = GoalApproach(path[-1], self.parameters.goal_distance)
        self._keeping.set_plan(path)
        return True

    def free_motion(self, request: ControlRequest) -> ControlResult:
        """One cycle: locate, project onto the path, pursue the point ahead."""
        pose, self._measured = request.pose, request.velocity
        cycle = self.begin_cycle(pose, self.parameters.max_surface_distance)
        if isinstance(cycle, ControlResult):
            return cycle
        surface, approach = cycle
        self._tracker.update(surface.point)
        is_turning = approach.is_only_turning(pose, self._tracker)
        missed = missed_path(self._tracker, self.parameters.max_path_distance * self.limit_factor)
        if missed and not self.is_leaving:
            return missed
        if not is_turning and (out := self._drive_out(pose)) is not None:
            return self._command(out.vx, out.wz)
        if is_turning:
            off = heading_error(pose, approach.goal)
            if obstacle := self.outline_on(pose, Twist.planar(wz=off), 1.0):
                return blocked_path(self.mesh_map, pose, obstacle)
            return self._command(0.0, self._turn(off).wz)
        if obstacle := self._obstacle_on_path(surface.point):
            return blocked_path(self.mesh_map, pose, obstacle)
        slope = math.acos(clamp(float(self.mesh_map.face_normals[surface.face, 2]), 1.0))
        slope_factor = 1.0 - (1.0 - self.parameters.slope_speed_factor) * min(slope / self.parameters.slow_slope, 1.0)
        fastest = slope_factor * self.parameters.max_vel_x
        return self.closely(request, fastest) or self._pursue(request, fastest)

    def _obstacle_on_path(self, here: FloatArray) -> str:
        """The first place on the path that the map forbids now, as a text; empty without one in reach."""
        ahead = np.arange(0.0, self.parameters.check_ahead_dist / self.limit_factor, OBSTACLE_STEP)
        places = np.concatenate([here[None], self._tracker.points_at(self._tracker.progress + ahead)])
        return self.obstacle_along(places, self.parameters.max_surface_distance, self.parameters.cost_limit)

    def _drive_out(self, pose: Pose) -> Twist | None:
        """The motion straight out of what the robot touches; None without one, or where it may drive on such ground."""
        if self.parameters.cost_limit > FORBIDDEN_COST or not self.leaving.concerns(self.mesh_map, pose):
            return None
        bearing, _ = arc_to(pose, self._target())
        gears, on_path = Gears(reverses=self.may_reverse), OnPath(self._tracker, pose)
        return self.leaving.command(self.mesh_map, pose, bearing, self._turn, gears, on_path)

    def _turn(self, angle: float) -> Twist:
        return Twist.planar(wz=self.parameters.turn_rate(self.parameters.turn_gain * angle, angle))

    def _target(self, share: float = 1.0) -> FloatArray:
        """The pursued point (3,) [m], or one at a share of its distance."""
        tracker, ahead = self._tracker, share * self.parameters.look_ahead_dist
        return tracker.point_at(tracker.progress + ahead) if tracker.on_last_section else tracker.carried_on(ahead)

    def _pursue(self, request: ControlRequest, fastest: float) -> ControlResult:
        """Drive the arc that is tangent to the robot's heading and passes through the point ahead, or turn to that.

        Where the way to it is not free it is a nearer one; a point may lie behind a corner. A robot that states no
        inertia turns to any, and drives to the nearest.
        """
        p, pose, obstacle = self.parameters, request.pose, ""
        for share in SHARES:
            target = self._target(share)
            bearing, curvature = arc_to(pose, target)
            turns = abs(bearing) > p.rotate_to_heading_min_angle
            turns = turns or p.turns_first(bearing, self._measured, p.max_vel_theta)
            wanted = self._turn(bearing) if turns else self._arc(pose, target, curvature, fastest, share)
            command, anyway = self._reachable(wanted), p.acc_lim_x == math.inf and (turns or share == SHARES[-1])
            anyway = anyway and not self.mesh_map.check_footprint
            obstacle = self._obstacle_to(pose, target, bearing, 0.0 if turns else curvature, command)
            ahead = share * p.look_ahead_dist
            arc = Twist.planar(wz=bearing) if turns else Twist.planar(ahead, wz=ahead * curvature)
            obstacle = obstacle or self.outline_on(pose, arc, 1.0)
            if anyway or not obstacle:
                return ControlResult(ExePathOutcome.SUCCESS, "", command)
        return self.closely(request, fastest, is_stuck=True) or blocked_path(self.mesh_map, pose, obstacle)

    def _arc(self, pose: Pose, target: FloatArray, curvature: float, fastest: float, share: float) -> Twist:
        """The motion on an arc to a target, as fast as the robot may be there."""
        p, tracker = self.parameters, self._tracker
        # A robot that ran past the goal has no path left, but still a distance to drive back; the height of its frame
        # above the surface does not count.
        left = tracker.to_cusp
        if tracker.on_last_section:
            left = max(left, math.hypot(*in_robot_frame(pose, target)[:2]))
        speed = min(
            fastest,
            math.sqrt(p.max_lateral_acceleration / max(abs(curvature), 1e-6)),
            p.max_vel_theta / max(abs(curvature), 1e-6),
            stopping_speed(left, min(p.decel_lim_x, PLANNED * p.acc_lim_x), p.reaction_time),
            p.speed_on_arc(curvature, self._measured.wz),
            speed_on_path(tracker, self._measured.vx, p.look_ahead_dist, p, p.max_vel_theta),
            share * p.look_ahead_dist / CLOSELY if share < 1.0 else math.inf,
        )
        speed = max(speed, min(p.min_speed, p.max_vel_theta / max(abs(curvature), 1e-6)))
        return Twist.planar(speed, wz=speed * curvature)

    def _obstacle_to(self, pose: Pose, target: FloatArray, bearing: float, curvature: float, command: Twist) -> str:
        """What forbids the way to a target, or the arc of a command until the robot has stopped on it."""
        p = self.parameters
        if p.check_ahead_dist == 0.0:
            return ""
        length = float(norm(target - np.asarray(pose.position)))
        if curvature != 0.0:  # an arc, which cuts the corners of the path; else the straight line
            length, bearing = length * bearing / math.sin(bearing), 0.0
        obstacle, rolls_on = (
            self._obstacle_within(pose, length, bearing, curvature),
            command.vx * p.time_on_arc(command),
        )
        if obstacle or rolls_on <= 0.0:
            return obstacle
        return self._obstacle_within(pose, rolls_on, 0.0, command.wz / command.vx)

    def _obstacle_within(self, pose: Pose, length: float, bearing: float, curvature: float) -> str:
        """The first place that the map forbids on an arc of a length [m] that begins at a bearing [rad]; "" if none."""
        p, times = self.parameters, np.linspace(0.0, length, max(math.ceil(length / ARC_STEP), 1) + 1)[1:]
        local = np.zeros((len(times) + 1, 3))
        local[1:, :2] = poses_on_arc((0.0, 0.0, bearing), 1.0, 0.0, curvature, times)[:, :2]
        places = rotated(pose.rotation, local) + np.asarray(pose.position)
        return self.obstacle_along(places, p.max_surface_distance, p.cost_limit)

    def _command(self, speed: float, turn: float) -> ControlResult:
        return ControlResult(ExePathOutcome.SUCCESS, "", self._reachable(Twist.planar(vx=speed, wz=turn)))

    def _reachable(self, motion: Twist) -> Twist:
        p = self.parameters
        command = Twist.planar(vx=motion.vx, wz=clamp(motion.wz, p.max_vel_theta))
        return self.reachable(command, self._measured, p.max_vel_theta)
