"""What inertia asks of a controller: commands that the robot can reach, turns that end in time, slowly into bends.

When to use: in controllers that steer to a point ahead, on all maps. When not: samplers, whose rollouts accelerate as
the robot does. Without ``acc_lim_x`` and ``acc_lim_theta`` the robot is taken to follow at once, as small robots on
wheels nearly do.
"""

from __future__ import annotations

import math

import numpy as np

from mbf_abstract.execution.path_tracker import PathTracker
from mbf_abstract.geometry import FloatArray, Twist
from mbf_abstract.geometry.arithmetic import arctan2, norm
from mbf_abstract.maps.controllers.room_to_turn import CREEPING
from mbf_abstract.parameters import PluginParameters, parameter

SPACING, ARM = 0.1, 2
"""Distance [m] of the points of a path ahead; a bend is what it turns by over so many of them."""
PLANNED = 0.7
"""Share of its braking that is planned with: a robot that cuts its path comes to the end sooner than by its length."""
OFF_ARC = 0.1
"""So far [rad] a robot may fall behind the heading of an arc until it turns as fast as that asks for at its speed."""
LONG_TURN = 1.5
"""A robot that stands turns first to its path if that takes longer [s]; it would come far beside it on its way."""
STILL = 0.02
"""Slower [m/s] it stands."""
ROUNDING = 1e-9
"""With less than this share of its speed a robot stands."""
NO_TURN = 1e-9
"""A yaw rate [rad/s] of at most so much is rounding: that of a robot which is exactly on a straight path."""
SINGLE = 1e-6
"""A change larger than allowed by less than this share of it is rounding, also of samples in single precision."""
LOOKS = 4.0
"""So often a robot is asked at least while it drives as far as it looks ahead."""


class InertiaParameters(PluginParameters):
    """What a robot can change of its velocity."""

    acc_lim_x: float = parameter(
        math.inf, "Largest change of speed; inf = it follows at once.", unit="m/s^2", gt=0.0, allow_inf=True
    )
    acc_lim_theta: float = parameter(
        math.inf, "Largest change of the yaw rate; inf = it follows at once.", unit="rad/s^2", gt=0.0, allow_inf=True
    )
    control_period: float = parameter(0.05, "Time between two calls, for accelerations.", unit="s", gt=0.0, le=1.0)

    @property
    def follows_at_once(self) -> bool:
        """Whether nothing is stated."""
        return self.acc_lim_x == self.acc_lim_theta == math.inf

    @property
    def reaction_time(self) -> float:
        """Time [s] in which a robot goes on as before; 0 for one that follows at once."""
        return self.control_period if self.acc_lim_x < math.inf else 0.0

    def time_on_arc(self, motion: Twist) -> float:
        """Time [s] for which an arc must be free, as it is driven on until the robot has braked along it.

        Half a period is for what it was faster before.
        """
        return 1.5 * self.reaction_time + 0.5 * self.stops_after(motion)

    def reachable(
        self, command: Twist, measured: Twist, turning: float = math.inf, begin: Twist | None = None
    ) -> Twist:
        """What the robot can do of a command until the next one: an arc is kept, it brakes before a turn.

        ``turning`` [rad/s] is its largest yaw rate, ``begin`` what it goes on from; None = from what is measured.
        """
        if self.follows_at_once:
            return command
        gain, turn_gain = self.acc_lim_x * self.control_period, self.acc_lim_theta * self.control_period
        begin = measured if begin is None else begin
        speed = within(command.vx, begin.vx, gain)
        turn = command.wz * speed / command.vx if command.vx != 0.0 else command.wz
        if command.vx == 0.0 != command.wz and abs(within(0.0, measured.vx, gain)) > CREEPING:
            turn = 0.0
        return Twist.planar(speed, command.vy, within(within(turn, begin.wz, turn_gain), 0.0, turning))

    def reached(self, command: Twist, measured: Twist) -> Twist:
        """What a robot makes of a command until the next one, its speed and its turn each by itself."""
        if self.follows_at_once:
            return command
        gain, turn_gain = self.acc_lim_x * self.control_period, self.acc_lim_theta * self.control_period
        return reached(command, measured, (gain, gain, turn_gain))

    def speed_on_arc(self, curvature: float, turning: float) -> float:
        """The speed [m/s] at which a robot that turns at ``turning`` [rad/s] takes up an arc of a curvature [1/m].

        A yaw rate that lags by w while the speed stays leaves the heading behind by w^2 / (2 acc_lim_theta).
        """
        if self.acc_lim_theta == math.inf or curvature == 0.0:
            return math.inf
        lag = math.sqrt(2.0 * OFF_ARC * self.acc_lim_theta)
        return max((lag + math.copysign(turning, turning * curvature)) / abs(curvature), CREEPING)

    def turns_after(self, angle: float, turning: float) -> float:
        """Time [s] in which a robot turns by ``angle`` [rad] from rest to rest; ``turning`` is its largest yaw rate."""
        return max(abs(angle) / turning, 2.0 * math.sqrt(abs(angle) / self.acc_lim_theta))

    def turns_first(self, angle: float, measured: Twist, turning: float) -> bool:
        """Whether a robot that is ``measured`` to stand turns by ``angle`` [rad] on the spot, as it turns so slowly."""
        stands = self.acc_lim_theta < math.inf and abs(measured.vx) <= STILL
        return stands and self.turns_after(angle, turning) > LONG_TURN

    def stops_after(self, motion: Twist) -> float:
        """Time [s] in which a motion is braked along its arc: what takes longer, the speed or the turn, decides."""
        return max(math.hypot(motion.vx, motion.vy) / self.acc_lim_x, abs(motion.wz) / self.acc_lim_theta)

    def braked(self, arc: Twist, measured: Twist) -> Twist:
        """The arc of a command as slowly as a robot can drive it that is ``measured`` to move so; zero if it stops.

        A turn on the spot is no arc; it is stopped by zero.
        """
        squares = arc.vx * arc.vx + arc.vy * arc.vy
        if self.acc_lim_x == math.inf or squares == 0.0:
            return Twist()
        rolls = max(min((measured.vx * arc.vx + measured.vy * arc.vy) / squares, 1.0), 0.0)
        share = rolls - self.control_period / self.stops_after(arc)
        if share < ROUNDING:
            return Twist()
        return Twist.planar(share * arc.vx, share * arc.vy, share * arc.wz)

    def turn_rate(self, rate: float, angle: float) -> float:
        """A yaw rate [rad/s] from which the robot can stop when it has turned by ``angle`` [rad], by half its braking.

        A rate in proportion to the angle asks for up to twice as much braking as the rate at which this limit begins.
        """
        if self.acc_lim_theta == math.inf or abs(rate) <= NO_TURN:
            return rate
        most = stopping_speed(abs(angle), 0.5 * self.acc_lim_theta, self.control_period)
        return max(-most, min(rate, most))


def within(wanted: float, now: float, change: float) -> float:
    """The value nearest to a wanted one that differs from that of now by ``change`` at most."""
    return max(now - change, min(wanted, now + change))


def reached(command: Twist, measured: Twist, changes: tuple[float, float, float]) -> Twist:
    """What comes of a command where vx, vy [m/s] and the yaw rate [rad/s] change by so much, vx and vy together.

    What can be reached is returned as it is, bit for bit.
    """
    ahead, left, turn = command.vx - measured.vx, command.vy - measured.vy, command.wz
    parts, vx, vy = math.hypot(ahead / changes[0], left / changes[1]), command.vx, command.vy
    if parts > 1.0 + SINGLE:
        vx, vy = measured.vx + ahead / parts, measured.vy + left / parts
    if abs(turn - measured.wz) > (1.0 + SINGLE) * changes[2]:
        turn = within(turn, measured.wz, changes[2])
    return Twist.planar(vx, vy, turn)


def stopping_speed(distance: float, deceleration: float, reaction_time: float = 0.0) -> float:
    """Speed from which a robot stops within a distance, of which it drives a part until it begins to brake.

    Units agree: m, m/s^2 and s, or those of angles.
    """
    if deceleration == math.inf:
        return math.inf
    lost = deceleration * reaction_time
    return math.sqrt(lost * lost + 2.0 * deceleration * max(distance, 0.0)) - lost


def braking_distance(speed: float, deceleration: float) -> float:
    """Length [m] that a robot rolls until it creeps; 0 for one that creeps or stands, or follows at once."""
    return max(speed**2 - CREEPING**2, 0.0) / (2.0 * deceleration)


def speed_on_path(tracker: PathTracker, speed: float, look_ahead: float, p: InertiaParameters, turning: float) -> float:
    """The speed [m/s] at which a robot comes along its path; inf where it does not need to be slower.

    Parameters
    ----------
    speed : float
        Of the robot now [m/s].
    look_ahead : float
        How far ahead [m] lies the point it steers to; bends before it are the business of the steering.
    turning : float
        Its largest yaw rate [rad/s].
    """
    if p.acc_lim_x == math.inf:
        return math.inf
    reach = look_ahead + braking_distance(speed, PLANNED * p.acc_lim_x) + 2.0 * abs(speed) * p.control_period
    end = min(tracker.progress + reach, tracker.next_cusp)
    points = tracker.points_at(np.arange(tracker.progress, end + SPACING, SPACING))[:, :2]
    bends = speed_before_bends(points, look_ahead, p, turning)
    return min(bends, look_ahead / (LOOKS * p.control_period))


def speed_before_bends(points: FloatArray, look_ahead: float, p: InertiaParameters, turning: float) -> float:
    """The speed [m/s] from which a robot has braked for every bend of a path ahead.

    Parameters
    ----------
    points : (n, 2) float64
        Of the path, ``SPACING`` [m] apart, from the robot on.
    """
    if len(points) <= 2 * ARM:
        return math.inf
    chords = points[ARM:] - points[:-ARM]
    yaws = arctan2(chords[:, 1], chords[:, 0])
    turns = np.abs((yaws[ARM:] - yaws[:-ARM] + math.pi) % (2.0 * math.pi) - math.pi)
    is_end = norm(chords) < 0.5 * SPACING
    turns[is_end[ARM:] | is_end[:-ARM]] = 0.0
    braking = PLANNED * p.acc_lim_x
    times = np.maximum(turns / turning, 2.0 * np.sqrt(turns / p.acc_lim_theta))
    speeds = np.maximum(look_ahead / np.maximum(times, 1e-9), CREEPING)
    room = np.maximum(SPACING * (ARM + np.arange(len(turns))) - look_ahead, 0.0)
    lost = braking * p.control_period
    return max(float(np.min(np.sqrt(lost * lost + speeds * speeds + 2.0 * braking * room) - lost)), CREEPING)
