"""A robot's encounters with what moves by itself: how near the others are, how fast, and who moved at a near miss."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from types import MappingProxyType

from mbf_abstract.geometry import Pose
from terrain.physics.contact_depth import placed
from terrain.physics.motion_sample import MotionSample, Other
from terrain.physics.protocols import Actor
from terrain.physics.robot_models import RobotSpec
from terrain.worlds.upright_solids import UprightSolid

WATCHED = 1.0  # m; what is farther from the robot's outline is not looked at
TOUCHING = 0.05  # m; the nearest thing of a kind that is touched is the one that is touched, if it is as near as this
GROWTH = 0.05  # m; a gap that has grown so much above its smallest was a near miss
FORGOTTEN = 1.5  # times the gap of a near miss; beyond that the next approach is a new one
NOBODY: Mapping[str, Actor] = MappingProxyType({})


class Mover(Enum):
    """Who moved in an encounter. What stands is never at fault."""

    ROBOT = "robot"
    OTHER = "other"
    BOTH = "both"
    NEITHER = "neither"

    @classmethod
    def of(cls, robot: bool, other: bool) -> Mover:
        """Return who moved."""
        if robot:
            return cls.BOTH if other else cls.ROBOT
        return cls.OTHER if other else cls.NEITHER


class Surroundings:
    """Looks at the actors around a robot, at a steady rate.

    Parameters
    ----------
    fellows : mapping of str to Actor
        Other robots that navigate, by name.
    """

    def __init__(self, spec: RobotSpec, actors: Sequence[Actor], fellows: Mapping[str, Actor] = NOBODY) -> None:
        self._spec = spec
        self._outline = spec.footprint_array()
        counts: Counter[str] = Counter()
        self._actors: list[tuple[str, Actor]] = []
        for actor in actors:
            counts[actor.thing.value] += 1
            self._actors.append((f"{actor.thing.value} {counts[actor.thing.value]}", actor))
        self._actors += fellows.items()
        self._last: list[Pose] = []
        self._stamp = -math.inf

    def look(self, robot: Pose) -> tuple[Other, ...]:
        """Return the others near the robot, which is at this stamped pose; speeds are those since the last look."""
        poses = [actor.pose() for _, actor in self._actors]
        passed = robot.stamp - self._stamp
        near = []
        for number, ((name, actor), pose) in enumerate(zip(self._actors, poses, strict=True)):
            gap = self._gap(robot, UprightSolid(pose, actor.size))
            if gap <= WATCHED:
                speed = pose.distance_to(self._last[number]) / passed if self._last and passed > 0.0 else 0.0
                near.append(Other(name, actor.thing, gap, speed))
        self._last, self._stamp = poses, robot.stamp
        return tuple(near)

    def _gap(self, robot: Pose, solid: UprightSolid) -> float:
        """Distance [m] between the outlines; inf where they are far apart or on different storeys."""
        height = solid.size[-1]
        apart = abs(robot.z + 0.5 * self._spec.height - solid.pose.z)
        if apart > 0.5 * (self._spec.height + height):
            return math.inf
        if solid.distance(robot.x, robot.y) > self._spec.circumscribed_radius + WATCHED:
            return math.inf
        return solid.gap(placed(self._outline, robot.x, robot.y, robot.yaw))


def touched_other(sample: MotionSample, thing: object) -> Other | None:
    """Return the nearest of the others of this kind, if it is near enough to be what the robot touches."""
    near = [other for other in sample.others if other.thing is thing and other.gap <= TOUCHING]
    return min(near, key=lambda other: other.gap, default=None)


@dataclass(frozen=True)
class Approach:
    """The closest moment of an encounter: with whom, where and when the robot was, its speed [m/s], and who moved."""

    other: Other
    pose: Pose
    speed: float
    moved: Mover


class NearMisses:
    """Finds encounters in which the outlines came nearer than ``gap`` [m] without touching, and somebody moved.

    Each counts once, as soon as the gap grows again; the next one with the same actor after it has been farther away.
    """

    def __init__(self, gap: float) -> None:
        self._gap = gap
        self._closest: dict[str, Approach] = {}
        self._ended: set[str] = set()

    def update(self, sample: MotionSample, robot_moves: bool, standing_speed: float) -> list[Approach]:
        """Take one sample; return the near misses that have ended since the last."""
        gaps = {other.name: other.gap for other in sample.others}
        for other in sample.others:
            if other.gap < self._gap:
                self._take(other, sample, Mover.of(robot_moves, other.speed > standing_speed))
        missed = []
        for name in list(self._closest):
            closest, gap = self._closest[name], gaps.get(name, math.inf)
            if name not in self._ended and gap > min(closest.other.gap + GROWTH, self._gap):
                self._ended.add(name)
                if closest.moved is not Mover.NEITHER:
                    missed.append(closest)
            if gap > FORGOTTEN * self._gap:
                del self._closest[name]
                self._ended.discard(name)
        return missed

    def _take(self, other: Other, sample: MotionSample, moved: Mover) -> None:
        if other.thing in sample.touched and touched_other(sample, other.thing) is other:
            self._ended.add(other.name)  # a collision, which is no near miss
        before = self._closest.get(other.name)
        if before is None or other.gap < before.other.gap:
            self._closest[other.name] = Approach(other, sample.pose, sample.velocity.speed, moved)
