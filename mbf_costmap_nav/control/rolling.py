"""A robot that rolls does not stand at once: how it is slowed down, and where it rolls until it drives a command.

When to use: before a motion that is meant for a robot that creeps or stands is given to one that may still roll: an arc
to a point close ahead, a turn on the spot. When not: commands that differ from the present speed by what can be changed
until the next one; those are driven as they are.
"""

from __future__ import annotations

import math

import numpy as np

from mbf_abstract.geometry import FloatArray, Pose, Twist
from mbf_abstract.maps.controllers.end_of_path import swept_poses
from mbf_abstract.maps.controllers.inertia import braking_distance, within
from mbf_abstract.maps.controllers.room_to_turn import CREEPING, SMALL_TURN, angle_to_path
from mbf_costmap_nav.control.path_handling import ControlCycle
from mbf_costmap_nav.control.pursuit_steering import PursuitSteering

SLACK = 1e-9
"""[m/s, steps] What rounding may add."""
SWEEP_STEP = 0.1
"""[cells] The outline moves so far from pose to pose of a turn on the spot."""


def rolled_poses(
    pose: Pose,
    speed: float,
    command: Twist,
    acceleration: float,
    fastest_turn: float,
    *,
    step: float,
    duration: float,
    turning: float,
) -> tuple[FloatArray, FloatArray]:
    """Poses (n, 3: x, y [m], yaw [rad]) of a robot that changes its ``speed`` [m/s] to that of a command.

    An arc it keeps to, as far as it can turn so fast; on the spot it turns for ``turning`` [s]. Also how far [m] (n,)
    it has driven at each pose.

    Parameters
    ----------
    acceleration, fastest_turn : float
        [m/s^2], and yaw rate [rad/s] on arcs.
    step, duration : float
        Time [s] from pose to pose, the start left out, and to the last one.
    """
    ends = step * np.arange(1, math.ceil(duration / step - SLACK) + 1)
    gap = command.vx - speed
    speeds = speed + np.copysign(np.minimum(acceleration * (ends - 0.5 * step), abs(gap)), gap)
    if command.vx != 0.0:
        rates = np.clip(command.wz / command.vx * speeds, -fastest_turn, fastest_turn)
    else:
        rates = np.where(ends <= turning, command.wz, 0.0)
    yaws = pose.yaw + np.cumsum(step * rates)
    along = yaws - 0.5 * step * rates
    x, y = pose.x + np.cumsum(step * speeds * np.cos(along)), pose.y + np.cumsum(step * speeds * np.sin(along))
    return np.column_stack([x, y, yaws]), np.cumsum(step * np.abs(speeds))


def sweep_step(cycle: ControlCycle) -> float:
    """Angle [rad] from pose to pose of a turn on the spot, which must look the same from every heading in it."""
    resolution = cycle.costmap.resolution
    return SWEEP_STEP * resolution / max(cycle.footprint.footprint.circumscribed_radius, resolution)


class RollingPursuit(PursuitSteering):
    """Pursuit of a robot that cannot stand at once."""

    def _rolls(self, cycle: ControlCycle, command: Twist) -> bool:
        """Whether the robot is faster than a command, and than creeping, by more than it can brake until the next."""
        speed, change = cycle.request.velocity.vx, self.parameters.acc_lim_x * self.parameters.period
        return min(abs(speed) - CREEPING, abs(command.vx - speed)) > change + SLACK

    def _rolls_on(self, cycle: ControlCycle) -> float:
        """Length [m] that it rolls until it creeps."""
        return braking_distance(cycle.request.velocity.vx, self.parameters.acc_lim_x)

    def _reachable(self, cycle: ControlCycle, command: Twist) -> Twist:
        """What a robot whose control period is stated can do of a command until the next one; others do all of it."""
        return self.reachable(command, cycle.request.velocity, self.parameters.max_vel_theta)

    def _can_turn_where_it_stops(self, cycle: ControlCycle, backward: bool) -> bool:
        """Whether a robot that brakes straight on has to turn to its path there, and nothing is in the way."""
        pose, rolls_on = cycle.request.pose, self._rolls_on(cycle)
        ahead = math.copysign(rolls_on, cycle.request.velocity.vx)
        there = Pose.planar(pose.x + ahead * math.cos(pose.yaw), pose.y + ahead * math.sin(pose.yaw), pose.yaw)
        turn = angle_to_path(cycle.tracker, there, backward, rolls_on)
        swept = swept_poses(there, turn, sweep_step(cycle))
        return abs(turn) > SMALL_TURN and cycle.first_collision_of_turn(swept) < 0

    def _slowed(self, motion: Twist, velocity: Twist) -> Twist:
        """The same arc as slowly as the robot can drive it by now; a wider one where that is too fast to turn."""
        change = self.parameters.acc_lim_x * self.parameters.period
        speed = within(motion.vx, self.goes_on_from(motion, velocity).vx, change)
        most = self.parameters.max_vel_theta
        return Twist.planar(speed, wz=min(max(motion.wz / motion.vx * speed, -most), most))

    def _rolled(self, cycle: ControlCycle, command: Twist, duration: float) -> tuple[FloatArray, float]:
        """Poses (n, 3) of the next ``duration`` [s], or until the robot stands, and the time [s] between them."""
        p, speed = self.parameters, cycle.request.velocity.vx
        turning = 0.0
        if command.vx == 0.0:
            turning = min(abs(self._angle_left(cycle) / command.wz), duration) if command.wz != 0.0 else 0.0
            duration = max(turning, min(abs(speed) / p.acc_lim_x, duration))
        turn = abs(command.wz / command.vx * speed) if command.vx != 0.0 else abs(command.wz)
        step = self._step(cycle, abs(speed) + turn * cycle.footprint.footprint.circumscribed_radius)
        pose, times = cycle.request.pose, {"step": step, "duration": duration, "turning": turning}
        poses, driven = rolled_poses(pose, speed, command, p.acc_lim_x, p.max_vel_theta, **times)
        return poses[: max(int(np.searchsorted(driven, cycle.tracker.to_cusp)), 1)], step

    def _step(self, cycle: ControlCycle, outline_speed: float) -> float:
        """Time [s] from pose to pose that moves the outline by half a cell; among them are those of the next cycles."""
        period = self.parameters.period
        return period / math.ceil(period * outline_speed / (0.5 * cycle.costmap.resolution) + 1e-9)
