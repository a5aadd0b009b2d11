"""Where a regulated pure pursuit steers: the carrot, the arc through it, and turns on the spot.

When to use: as the base of ``costmap.regulated_pure_pursuit``, which chooses between them and looks whether they are
free. When not: controllers that sample motions.
"""

from __future__ import annotations

import math

import numpy as np

from mbf_abstract.geometry import Twist, normalize_angle
from mbf_abstract.maps.controllers.inertia import PLANNED, braking_distance, speed_on_path, stopping_speed, within
from mbf_abstract.maps.controllers.room_to_turn import off_course
from mbf_costmap_nav.control.close_steering import FARTHEST, SLIGHT, steer_closely
from mbf_costmap_nav.control.path_geometry import look_ahead_point
from mbf_costmap_nav.control.path_handling import ControlCycle, to_base_frame
from mbf_costmap_nav.control.regulated_speed import RegulatedFollower
from mbf_costmap_nav.grid.costmap import FREE


class PursuitSteering(RegulatedFollower):
    """Steering to a carrot on the path."""

    _at_goal = False
    _fastest = math.inf
    """Speed [m/s] that leaves room to brake before a tight place."""

    def _backward(self, cycle: ControlCycle) -> bool:
        return self.parameters.allow_reversing and cycle.tracker.driving_backward

    def _angle_left(self, cycle: ControlCycle) -> float:
        """Angle [rad] to the carrot."""
        carrot = self._carrot(cycle)
        return off_course(math.atan2(carrot[1], carrot[0]), self._backward(cycle))

    def _turn(self, cycle: ControlCycle, angle: float) -> Twist:
        fastest = Twist.planar(wz=math.copysign(self.parameters.rotate_to_heading_vel, angle))
        return Twist.planar(wz=self.rotation_speed(angle, self.goes_on_from(fastest, cycle.request.velocity).wz))

    def _carrot(self, cycle: ControlCycle) -> tuple[float, float]:
        """Look-ahead point in the base frame; past a cusp it lies straight on."""
        tracker, distance = cycle.tracker, self.look_ahead_distance(cycle.request.velocity.vx)
        wanted = distance + tracker.deviation
        points = tracker.ahead(min(wanted, tracker.to_cusp))
        if wanted > tracker.to_cusp and not tracker.on_last_section:
            points = np.vstack([points, tracker.carried_on(wanted)])
        local = to_base_frame(points, cycle.request.pose)
        x, y = look_ahead_point(local, distance)
        return float(x), float(y)

    def _turn_at_goal(self, cycle: ControlCycle) -> float | None:
        """Angle to the goal's heading once the robot stands at the goal's position."""
        if not self.rotates:
            return None
        goal, pose = cycle.tracker.goal, cycle.request.pose
        # Once inside, twice the tolerance keeps the robot turning although it slides a little while it stops.
        reach = self.goal_dist_tolerance * (2.0 if self._at_goal else 1.0)
        near = math.hypot(goal.x - pose.x, goal.y - pose.y) <= reach
        self._at_goal = near and cycle.tracker.has_arrived(reach)
        return normalize_angle(goal.yaw - pose.yaw) if self._at_goal else None

    def _curvature_to(self, carrot: tuple[float, float]) -> float:
        """Of the arc [1/m] through the carrot, or the tightest."""
        curvature = 2.0 * carrot[1] / max(carrot[0] ** 2 + carrot[1] ** 2, 1e-6)
        tightest = 1.0 / self.turning_radius if self.turning_radius > 0.0 else math.inf
        return min(max(curvature, -tightest), tightest)

    def _drive(self, cycle: ControlCycle, curvature: float, backward: bool) -> Twist:
        """Command along an arc."""
        p, velocity = self.parameters, cycle.request.velocity
        cost = cycle.costmap.cost_at(cycle.request.pose.x, cycle.request.pose.y) or FREE
        regulated = min(self.regulated_speed(curvature, cost, cycle.tracker.to_cusp), cycle.speed_limit, self._fastest)
        on_arc = self.inertia.speed_on_arc(-curvature if backward else curvature, velocity.wz)
        regulated = min(regulated, self._stopping_speed(cycle), on_arc)
        wanted = -regulated if backward else regulated
        begin = self.goes_on_from(Twist.planar(wanted, wz=wanted * curvature), velocity)
        speed = within(wanted, begin.vx, p.acc_lim_x * p.period)
        if abs(speed * curvature) > p.max_vel_theta:
            speed = math.copysign(p.max_vel_theta / abs(curvature), speed)
        return Twist.planar(vx=speed, wz=speed * curvature)

    def _stopping_speed(self, cycle: ControlCycle) -> float:
        """Speed [m/s] from which the robot can brake for the end of its path, and for bends beyond the carrot."""
        p, speed = self.parameters, cycle.request.velocity.vx
        stopping = stopping_speed(cycle.tracker.to_cusp, PLANNED * p.acc_lim_x, p.period)
        look_ahead, on_path = self.look_ahead_distance(speed), math.inf
        if p.control_period is not None or braking_distance(speed, p.acc_lim_x) > look_ahead:
            on_path = speed_on_path(cycle.tracker, speed, look_ahead, self.known_inertia, p.max_vel_theta)
        return min(max(stopping, p.min_approach_vel), on_path)

    def _swiftly(self, cycle: ControlCycle, backward: bool, slowest: float) -> Twist | None:
        """The arc by which a car keeps best to a nearly straight path, at the speed that this allows.

        None where the path is not, where the arc is not, and where that is no faster than ``slowest`` [m/s].
        """
        p, slight = self.parameters, SLIGHT / self.turning_radius
        curvature = self._curvature_to(self._carrot(cycle))
        wanted = self._drive(cycle, math.copysign(slight, curvature), backward).vx
        seen = FARTHEST * max(1.0, self.turning_radius) * cycle.limit_factor
        speed = math.copysign(min(abs(wanted), seen / max(p.check_ahead_time, p.period)), wanted)
        if abs(curvature) > slight or abs(speed) <= abs(slowest):
            return None
        chosen = steer_closely(cycle, self.turning_radius, speed, p)
        if chosen is None or abs(chosen) > slight:
            return None
        return Twist.planar(speed, wz=abs(speed) * chosen)
