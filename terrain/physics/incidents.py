"""Detects when driving goes wrong: tipped over, slipping, high-centred, stuck, collided. It works on samples alone.

Use it on the simulator's ground truth, to count the incidents of a run; it is no input for a controller. Each
kind has a condition that must hold for a while, then counts once until it has been false again.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.geometry.tilt import tilt_of
from terrain.physics.encounters import Mover, NearMisses, touched_other
from terrain.physics.motion_sample import MotionSample, Other, Thing


class IncidentKind(Enum):
    """What went wrong; a collision counts as such, by what was hit, and once more if the robot moved by itself.

    A near miss is an encounter with something that moves by itself, without a contact.
    """

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
    NEAR_MISS = "near_miss"


COLLISIONS_WITH = {thing: IncidentKind(f"collision_with_{thing.value}") for thing in Thing}
ANY_COLLISION = (IncidentKind.COLLISION, IncidentKind.COLLISION_WHILE_MOVING)
CONTACTS = {*ANY_COLLISION, *COLLISIONS_WITH.values()}


@dataclass(frozen=True)
class Incident:
    """Something that went wrong.

    Attributes
    ----------
    stamp : float
        When it counted from [s].
    pose : Pose
        Where the robot was; at a near miss, when the gap was smallest.
    speed : float
        How fast it was [m/s]; at a contact, just before.
    moved : Mover or None
        Who moved, at a contact or a near miss.
    other : Other or None
        Whom the robot met; None for a wall, and where nobody was met.
    """

    kind: IncidentKind
    stamp: float
    pose: Pose
    speed: float = 0.0
    moved: Mover | None = None
    other: Other | None = None

    def to_json(self) -> dict[str, Any]:
        """Return the data of its event, metres and metres per second rounded to a micrometre."""
        data: dict[str, Any] = {"what": self.kind.value, "robot_speed": round(self.speed, 6)}
        data |= {key: round(value, 6) for key, value in zip("xyz", self.pose.position, strict=True)}
        if self.moved is not None:
            data["moved"] = self.moved.value
        if self.other is not None:
            gap, speed = round(self.other.gap, 6), round(self.other.speed, 6)
            data |= {"other": self.other.name, "other_speed": speed, "gap": gap}
        return data


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
    near_miss_gap : float
        Outlines nearer than this [m] without a contact, while somebody moves, are a near miss.
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
    near_miss_gap: float = 0.2


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
    _pushed: bool = False
    _rolls_by_itself: bool = False

    def __post_init__(self) -> None:
        self._near_misses = NearMisses(self.limits.near_miss_gap)

    def update(self, sample: MotionSample) -> list[Incident]:
        """Take one sample, stamped by its pose; return the incidents that count from this instant on."""
        before, moves = self._last or sample, self._moves(sample)
        self._moved_in_contact = bool(sample.touched) and (self._moved_in_contact or moves)
        self._sum_up(sample)
        limits, standing = self.limits, self._standing_time(sample)
        conditions = [
            (IncidentKind.TIPPED_OVER, limits.tilt_hold, tilt_of(sample.pose) > limits.tilt),
            (IncidentKind.SLIPPING, limits.slip_hold, sample.slip_speed > limits.slip_speed),
            (IncidentKind.HIGH_CENTRED, 0.0, sample.body_on_ground and standing >= limits.high_centred_hold),
            (IncidentKind.STUCK, 0.0, standing >= limits.stuck_hold),
            (IncidentKind.COLLISION, 0.0, bool(sample.touched)),
            (IncidentKind.COLLISION_WHILE_MOVING, 0.0, self._moved_in_contact),
            *((kind, 0.0, thing in sample.touched) for thing, kind in COLLISIONS_WITH.items()),
        ]
        begun = [
            self._incident(kind, sample, before, moves)
            for kind, hold, holds in conditions
            if self._begins(kind, hold, holds, sample.pose.stamp)
        ]
        return begun + self._missed(sample, moves)

    def _incident(self, kind: IncidentKind, sample: MotionSample, before: MotionSample, moves: bool) -> Incident:
        stamp, pose = sample.pose.stamp, sample.pose
        if kind not in CONTACTS:
            return Incident(kind, stamp, pose, sample.velocity.speed)
        things = [thing for thing in sample.touched if kind in (COLLISIONS_WITH[thing], *ANY_COLLISION)]
        others = [other for other in (touched_other(sample, thing) for thing in things) if other is not None]
        other = min(others, key=lambda one: (one.gap, one.name), default=None)
        other_moves = other is not None and other.speed > self.limits.standing_speed
        return Incident(kind, stamp, pose, before.velocity.speed, Mover.of(moves, other_moves), other)

    def _missed(self, sample: MotionSample, moves: bool) -> list[Incident]:
        missed = self._near_misses.update(sample, moves, self.limits.standing_speed)
        self.counts[IncidentKind.NEAR_MISS] += len(missed)
        stamp = sample.pose.stamp
        return [Incident(IncidentKind.NEAR_MISS, stamp, a.pose, a.speed, a.moved, a.other) for a in missed]

    def _sum_up(self, sample: MotionSample) -> None:
        roll, pitch = roll_pitch(sample.pose)
        self.max_roll, self.max_pitch = max(self.max_roll, abs(roll)), max(self.max_pitch, abs(pitch))
        if self._last is not None:
            passed = sample.pose.stamp - self._last.pose.stamp
            self.distance += sample.pose.distance_to(self._last.pose)
            self.slipped += sample.slip_speed * passed
            self.energy += sample.power * passed
        self._last = sample

    def _moves(self, sample: MotionSample) -> bool:
        """Whether the robot moves by itself: by its command, or by its wheels before a contact.

        What turns its wheels in a contact may be what pushes it, so only its command counts then, and afterwards until
        it has come to rest: wheels that stand while it slides roll again when they grip.
        """
        by_command, rolls = not self._stands(sample.commanded), not self._stands(sample.rolling)
        slides = not self._stands(sample.velocity)
        moves = by_command or self._rolls_by_itself
        if sample.touched:
            self._pushed = not (moves or self._moved_in_contact)
            self._rolls_by_itself = False
            return moves
        self._pushed = self._pushed and (rolls or slides) and not by_command
        self._rolls_by_itself = rolls and not self._pushed
        return moves or self._rolls_by_itself

    def _stands(self, motion: Twist) -> bool:
        return motion.is_stopped(self.limits.standing_speed, self.limits.standing_yaw_rate)

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
