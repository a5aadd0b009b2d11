"""Detects when driving goes wrong: tipped over, slipping, high-centred, stuck, collided. It works on samples alone.

Use it on the simulator's ground truth, to count the incidents of a run; it is no input for a controller. Each
kind has a condition that must hold for a while, then counts once until it has been false again.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum

from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.geometry.tilt import tilt_of


class Thing(Enum):
    """What the robot can touch that is not the ground; everything fixed is a wall."""

    WALL = "wall"
    DOOR = "door"
    PERSON = "person"
    ROBOT = "robot"


class IncidentKind(Enum):
    """What went wrong; a collision counts as such, by what was hit, and once more if the robot moved by itself."""

    TIPPED_OVER = "tipped_over"
    SLIPPING = "slipping"
    HIGH_CENTRED = "high_centred"
    STUCK = "stuck"
    COLLISION = "collision"
    COLLISION_WHILE_MOVING = "collision_while_moving"
    COLLISION_WITH_WALL = "collision_with_wall"
    COLLISION_WITH_DOOR = "collision_with_door"
    COLLISION_WITH_PERSON = "collision_with_person"
    COLLISION_WITH_ROBOT = "collision_with_robot"


COLLISIONS_WITH = {thing: IncidentKind(f"collision_with_{thing.value}") for thing in Thing}


@dataclass(frozen=True)
class MotionSample:
    """State of a robot at one instant.

    Attributes
    ----------
    pose, velocity : Pose, Twist
        Ground truth of base_link; velocity in the base frame.
    commanded : Twist
        Motion asked for.
    rolling : Twist
        Motion that the turning wheels would make without slip.
    body_on_ground : bool
        Whether the body touches the ground.
    touched : frozenset of Thing
        What any part touches that is not ground.
    power : float
        Mechanical power of the motors [W], losses counted positive.
    """

    pose: Pose
    velocity: Twist
    commanded: Twist
    rolling: Twist
    body_on_ground: bool = False
    touched: frozenset[Thing] = frozenset()
    power: float = 0.0


@dataclass(frozen=True)
class Incident:
    """Something that went wrong, when [s] and where."""

    kind: IncidentKind
    stamp: float
    pose: Pose


@dataclass(frozen=True)
class IncidentLimits:
    """When a motion counts as an incident.

    Attributes
    ----------
    tilt : float
        [rad], counts after ``tilt_hold`` [s].
    slip_speed : float
        [m/s], counts after ``slip_hold`` [s].
    asked_speed : float
        Commands below it [m/s, rad/s] do not ask for motion.
    standing_speed, standing_yaw_rate : float
        A robot whose command and wheels stay below both [m/s, rad/s] stands, also while something pushes it.
    progress_distance, progress_angle : float
        A robot that is asked to move and neither moves [m] nor turns [rad] this far is stuck after ``stuck_hold`` [s];
        if its body lies on the ground it is high-centred, already after ``high_centred_hold`` [s].
    """

    tilt: float = math.radians(60.0)
    tilt_hold: float = 0.3
    slip_speed: float = 0.25
    slip_hold: float = 0.5
    asked_speed: float = 0.05
    standing_speed: float = 0.02
    standing_yaw_rate: float = 0.05
    progress_distance: float = 0.05
    progress_angle: float = 0.1
    high_centred_hold: float = 1.5
    stuck_hold: float = 3.0


def roll_pitch(pose: Pose) -> tuple[float, float]:
    """Roll and pitch [rad] of the fixed-axis (REP-103) convention; nose down is positive pitch."""
    x, y, z, w = pose.orientation
    roll = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    return roll, math.asin(max(-1.0, min(1.0, 2.0 * (w * y - z * x))))


@dataclass
class IncidentMonitor:
    """Counts incidents and keeps the extremes of a run; call ``update`` at a steady rate (20 Hz is enough).

    Attributes
    ----------
    counts : Counter of IncidentKind
    max_roll, max_pitch : float
        Largest magnitudes so far [rad].
    slipped : float
        Distance [m] between what the wheels rolled and what the robot moved, summed.
    distance : float
        Distance driven [m].
    energy : float
        Work of the motors [J].
    """

    limits: IncidentLimits = field(default_factory=IncidentLimits)
    counts: Counter[IncidentKind] = field(default_factory=Counter)
    max_roll: float = 0.0
    max_pitch: float = 0.0
    slipped: float = 0.0
    distance: float = 0.0
    energy: float = 0.0
    _since: dict[IncidentKind, float] = field(default_factory=dict)
    _counted: set[IncidentKind] = field(default_factory=set)
    _last: MotionSample | None = None
    _anchor: Pose | None = None
    _moved_in_contact: bool = False

    def update(self, sample: MotionSample) -> list[Incident]:
        """Take one sample, stamped by its pose; return the incidents that count from this instant on."""
        self._watch_contact(sample)
        self._sum_up(sample)
        limits, standing = self.limits, self._standing_time(sample)
        conditions: list[tuple[IncidentKind, float, Callable[[MotionSample], bool]]] = [
            (IncidentKind.TIPPED_OVER, limits.tilt_hold, self._is_tipped),
            (IncidentKind.SLIPPING, limits.slip_hold, lambda s: slip_speed(s) > limits.slip_speed),
            (IncidentKind.HIGH_CENTRED, 0.0, lambda s: s.body_on_ground and standing >= limits.high_centred_hold),
            (IncidentKind.STUCK, 0.0, lambda s: standing >= limits.stuck_hold),
            (IncidentKind.COLLISION, 0.0, lambda s: bool(s.touched)),
            (IncidentKind.COLLISION_WHILE_MOVING, 0.0, lambda s: self._moved_in_contact),
            *((kind, 0.0, lambda s, t=thing: t in s.touched) for thing, kind in COLLISIONS_WITH.items()),
        ]
        return [
            Incident(kind, sample.pose.stamp, sample.pose)
            for kind, hold, condition in conditions
            if self._begins(kind, hold, condition(sample), sample.pose.stamp)
        ]

    def _sum_up(self, sample: MotionSample) -> None:
        roll, pitch = roll_pitch(sample.pose)
        self.max_roll, self.max_pitch = max(self.max_roll, abs(roll)), max(self.max_pitch, abs(pitch))
        if self._last is not None:
            passed = sample.pose.stamp - self._last.pose.stamp
            self.distance += sample.pose.distance_to(self._last.pose)
            self.slipped += slip_speed(sample) * passed
            self.energy += sample.power * passed
        self._last = sample

    def _watch_contact(self, sample: MotionSample) -> None:
        """Note whether the robot has moved by itself in this contact, or when it began.

        What turns its wheels after that may be what pushes it, so only its command counts then.
        """
        limits, before = self.limits, self._last
        if not sample.touched:
            self._moved_in_contact = False
            return
        motions = [sample.commanded]
        if before is not None and not before.touched:
            motions.append(before.rolling)
        self._moved_in_contact |= not all(
            motion.is_stopped(limits.standing_speed, limits.standing_yaw_rate) for motion in motions
        )

    def _begins(self, kind: IncidentKind, hold: float, holds: bool, now: float) -> bool:
        """Whether ``kind`` has held long enough and was not counted yet."""
        if not holds:
            self._since.pop(kind, None)
            self._counted.discard(kind)
            return False
        if kind in self._counted or now - self._since.setdefault(kind, now) < hold:
            return False
        self._counted.add(kind)
        self.counts[kind] += 1
        return True

    def _is_tipped(self, sample: MotionSample) -> bool:
        return tilt_of(sample.pose) > self.limits.tilt

    def _standing_time(self, sample: MotionSample) -> float:
        """How long [s] the robot has been asked to move without getting anywhere; wheels that twitch do not count."""
        limits = self.limits
        is_asked = not sample.commanded.is_stopped(limits.asked_speed, limits.asked_speed)
        if self._anchor is None or not is_asked or self._has_progressed(self._anchor, sample.pose):
            self._anchor = sample.pose
        return sample.pose.stamp - self._anchor.stamp

    def _has_progressed(self, before: Pose, now: Pose) -> bool:
        limits = self.limits
        return now.distance_to(before) > limits.progress_distance or now.angle_to(before) > limits.progress_angle


def slip_speed(sample: MotionSample) -> float:
    """Speed [m/s] at which the robot moves other than its wheels roll: sliding forward, backward or sideways."""
    return math.hypot(sample.rolling.vx - sample.velocity.vx, sample.velocity.vy)
