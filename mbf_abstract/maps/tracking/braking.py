"""How a robot moves from a command until it has stopped, for the check of contacts.

A robot has the command for a reaction time, then it brakes. How fast it takes up a command is not known, so three
motions are checked:

===================  ===============================================================================================
it obeys             on the arc of the command, also while it brakes
it goes on           from the measured velocity, which changes towards the command by no more than the deceleration
it turns or speeds   as before, but a component that grows is that of the command at once
up at once
===================  ===============================================================================================

A robot that follows its command already has one motion, but for its turns, which may last longer than its driving.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from mbf_abstract.geometry import FloatArray, Pose, Twist
from mbf_abstract.geometry.arcs import poses_on_arc

STEP = 0.1
"""Longest time [s] between two looks at robot and objects."""


class Decelerations(NamedTuple):
    """How fast the robot slows down, driving [m/s^2] and turning [rad/s^2], after its reaction time [s]."""

    driving: float
    turning: float
    reaction_time: float


def motions_to_standstill(
    pose: Pose, velocity: Twist, command: Twist, share: float, limits: Decelerations
) -> Iterator[tuple[FloatArray, FloatArray]]:
    """What the robot may do that follows a share of a command for the reaction time and then brakes.

    Parameters
    ----------
    pose : Pose
        Of the robot.
    velocity : Twist
        Measured.
    command : Twist
        Not zero.

    Yields
    ------
    times : (n,) float64
        [s] from now, the last one that at which it stands.
    poses : (n, 3) float64
        x, y [m] and yaw [rad] then.
    """
    start = pose.x, pose.y, pose.yaw
    times, driven = _on_the_arc(velocity, command, share, limits)
    yield times, poses_on_arc(start, command.vx, command.vy, command.wz, driven)
    driving = _Change((velocity.vx, velocity.vy), (share * command.vx, share * command.vy), limits.driving)
    turning = _Change((velocity.wz, 0.0), (share * command.wz, 0.0), limits.turning)
    yield _changing(start, driving, turning, limits.reaction_time)
    if driving.speeds_up or turning.speeds_up:
        yield _changing(start, driving.at_once(), turning.at_once(), limits.reaction_time)


def _on_the_arc(velocity: Twist, command: Twist, share: float, limits: Decelerations) -> tuple[FloatArray, FloatArray]:
    """Times (n,) [s] until the robot stands, and the motion by then as a time (n,) [s] of following the whole command.

    The pace is the motion as a share of the command, first what the measured velocity has of it.
    """
    if command.speed > 0.0:
        along = velocity.vx * command.vx + velocity.vy * command.vy
        now, slowing = along / (command.speed * command.speed), limits.driving / command.speed
    else:
        now, slowing = velocity.wz / command.wz, limits.turning / abs(command.wz)
    react = limits.reaction_time
    now = min(max(now, 0.0), 1.0)
    pace = max(share, now - slowing * react)
    times = _looks(react + pace / slowing)
    braked = np.maximum(times - react, 0.0)
    before = np.minimum(times, react) * max(share, 0.5 * (now + pace))
    return times, before + braked * (pace - 0.5 * slowing * braked)


class _Change(NamedTuple):
    """A velocity of two components that changes at a constant rate to another one, and after a while to zero."""

    first: tuple[float, float]
    target: tuple[float, float]
    rate: float

    @property
    def speeds_up(self) -> bool:
        """Whether the target is faster and not backward."""
        (ax, ay), (bx, by) = self.first, self.target
        return math.hypot(bx, by) > math.hypot(ax, ay) and ax * bx + ay * by >= 0.0

    def at_once(self) -> _Change:
        """The same, but the target is reached now where it is faster."""
        return self._replace(first=self.target) if self.speeds_up else self

    def _duration(self) -> float:
        return math.hypot(self.target[0] - self.first[0], self.target[1] - self.first[1]) / self.rate

    def _last(self, react: float) -> tuple[float, float]:
        """The velocity after ``react`` [s]."""
        duration = self._duration()
        done = react / duration if duration > react else 1.0
        first, target = self.first, self.target
        return first[0] + done * (target[0] - first[0]), first[1] + done * (target[1] - first[1])

    def standstill(self, react: float) -> float:
        """When [s] it is zero, if it changes to zero after ``react`` [s]."""
        return react + math.hypot(*self._last(react)) / self.rate

    def travelled(self, times: FloatArray, react: float) -> tuple[FloatArray, FloatArray]:
        """Both components (n,) of the displacement [m] after some times (n,) [s]."""
        duration, stopping = self._duration(), self.standstill(react) - react
        reacting, braked = np.minimum(times, react), np.clip(times - react, 0.0, stopping)
        changing = np.minimum(reacting, duration)
        towards = 0.5 * changing * changing / duration + (reacting - changing) if duration > 0.0 else reacting
        slowed = braked - 0.5 * braked * braked / stopping if stopping > 0.0 else braked
        first, target, last = self.first, self.target, self._last(react)
        x, y = (first[k] * reacting + (target[k] - first[k]) * towards + last[k] * slowed for k in (0, 1))
        return x, y


def _changing(
    start: tuple[float, float, float], driving: _Change, turning: _Change, react: float
) -> tuple[FloatArray, FloatArray]:
    """Times and poses of a robot whose driving and turning change by themselves.

    Between two looks it drives along the mean of both headings.
    """
    times = _looks(max(driving.standstill(react), turning.standstill(react)))
    along, aside = (np.diff(way, prepend=0.0) for way in driving.travelled(times, react))
    yaws = start[2] + turning.travelled(times, react)[0]
    middle = 0.5 * (yaws + np.concatenate([[start[2]], yaws[:-1]]))
    c, s = np.cos(middle), np.sin(middle)
    return times, np.column_stack(
        [start[0] + np.cumsum(c * along - s * aside), start[1] + np.cumsum(s * along + c * aside), yaws]
    )


def _looks(end: float) -> FloatArray:
    """Times (n,) [s] up to ``end``, the start left out."""
    return np.linspace(0.0, end, max(1, math.ceil(end / STEP)) + 1)[1:]
