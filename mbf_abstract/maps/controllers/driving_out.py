"""How a robot that touches something drives out of it, on any map: straight, after a turn where that is needed.

When to use: in controllers of robots that turn on the spot. When not: in recoveries, which drive a given motion.

On an arc a robot rubs along what it touches, and friction turns it towards it: pushed against a pillar it presses on
along its path until it is stuck. So it drives straight, forward or backward, if that leads out steeply. Else it turns
to its path, if a straight drive leads out there; else it drives straight on, if that does; else it turns farther, away
from its path. What it has chosen it does until it is clear: as an outline turns it touches things and leaves them.

It does so only where its path leads out of what it touches. Where that leads farther into it, or along it, the robot
is stopped or driven as ever, and the executive decides; but see ``Gears.leaves_faces``.

Backward it creeps whatever a controller's own parameters say, as recoveries do; the server's ``min_vel_x`` forbids it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from mbf_abstract.execution.path_tracker import PathTracker
from mbf_abstract.geometry import Pose, Twist, normalize_angle
from mbf_abstract.geometry.arcs import arc_poses
from mbf_abstract.maps.controllers.room_to_turn import CREEPING, SMALL_TURN, poses_ahead
from mbf_abstract.maps.navigation_map import NavigationMap

WITHIN, DEPTHS = 0.15, 3.0
"""It must touch nothing any more within ``WITHIN`` [m], or ``DEPTHS`` times as far as it is deep in a contact."""
STEEP, AT_LEAST = 2.0, 0.05
"""A drive that leads out within ``AT_LEAST`` [m], or ``STEEP`` times as far as it is deep, does so steeply."""
OFF_PATH = (0.25, 0.5, 1.0, 1.5, 2.25, 3.0)
"""Angles [rad] to both sides of the direction to the path, tried in this order: it may lead along what is touched."""
OFF_FACES = OFF_PATH[:2]
LESS = 0.01
"""A path leads out where a robot that follows it lies so much less deep [m], or in nothing; along a wall it varies."""
OUT, ALONG, INTO = "out", "along", "into"
"""Where a path leads."""
CLEAR = 0.03
"""So far [m] it drives on straight once it touches nothing."""
ELSEWHERE, TURNED = 0.1, 0.3
"""A robot that is so far [m, rad] from where it was asked last has been driven by somebody else."""
BEGUN = 0.01
"""A robot that has turned by more [rad] since it chose does as it chose."""
SAME_PLACE = 0.2
"""A robot that begins anew within this [m] of where it began last has come back: every second time it turns first."""


@dataclass(frozen=True)
class Gears:
    """How a robot may drive out."""

    backward: bool = False
    """Whether its path is to be driven backward."""
    reverses: bool = False
    """Whether it may drive out both ways."""
    leaves_faces: bool = False
    """Whether it turns off a little, up to 0.5 rad, from a path that leads along what it touches, and not out."""


class DriveOut:
    """The way a robot has chosen out of what it touches, from cycle to cycle."""

    def __init__(self) -> None:
        self._heading = self._speed = self._chose_at = 0.0
        self.last: Pose | None = None  # where it was asked last; None where it has chosen no way
        self._free_at: Pose | None = None
        self._began: Pose | None = None
        self._turns_first = False

    def concerns(self, navigation_map: NavigationMap, pose: Pose) -> bool:
        """Whether a robot at ``pose``, in the frame of the map, touches something, or is not clear since it did."""
        return self.last is not None or navigation_map.contact_depth(pose) > 0.0

    def command(
        self,
        navigation_map: NavigationMap,
        pose: Pose,
        bearing: float,
        turn: Callable[[float], Twist],
        gears: Gears,
        on_path: Callable[[float], Iterable[Pose]],
    ) -> Twist | None:
        """The motion that leads straight out; None if the robot is clear, its path does not lead out, or nothing does.

        Parameters
        ----------
        pose : Pose
            Of the robot, in the frame of the map.
        bearing : float
            Angle [rad] from the direction of driving to the path.
        turn : callable
            How the robot turns on the spot by an angle [rad].
        on_path : callable
            See ``OnPath``.
        """
        depth, last = navigation_map.contact_depth(pose), self.last
        self.last = None
        if last is None and depth == 0.0:
            return None
        self._free_at = (self._free_at or pose) if depth == 0.0 else None
        if self._free_at is not None and pose.distance_to(self._free_at) >= CLEAR:
            self._free_at = None
            return None
        if last is None or _elsewhere(pose, last) or not self._goes_on(navigation_map, pose, depth):
            self._free_at = None
            if last is None:
                returns = self._began is not None and pose.distance_to(self._began) <= SAME_PLACE
                self._began, self._turns_first = pose, returns and not self._turns_first
            elif not _elsewhere(pose, last):  # it has come upon something else: back it would come upon the first
                self._turns_first = True
            gears = self._gears(gears)
            leads = path_leads(navigation_map, depth, on_path(max(WITHIN, DEPTHS * depth))) if depth > 0.0 else INTO
            chosen = None
            if leads == OUT:
                chosen = _choose(navigation_map, pose, bearing, gears, depth)
            elif leads == ALONG and gears.leaves_faces:
                chosen = _turn_off(navigation_map, pose, bearing, gears, depth, OFF_FACES)
            if chosen is None:
                return None
            angle, self._speed = chosen
            self._heading = pose.yaw + angle
            self._chose_at = pose.yaw
        elif self._has_not_begun(pose) and (speed := _straight_out(navigation_map, pose, self._gears(gears), depth)):
            self._heading, self._speed = pose.yaw, speed  # who was in the way has left
        self.last = pose
        angle = self._turns_from(pose)
        return turn(angle) if angle != 0.0 else Twist.planar(self._speed)

    def _turns_from(self, pose: Pose) -> float:
        """The angle [rad] that is left to turn by; 0 where the robot drives straight."""
        angle = normalize_angle(self._heading - pose.yaw)
        return angle if abs(angle) > SMALL_TURN else 0.0

    def _has_not_begun(self, pose: Pose) -> bool:
        """Whether it is to turn and has not: whoever walks by may have to pass first."""
        return self._turns_from(pose) != 0.0 and abs(normalize_angle(pose.yaw - self._chose_at)) <= BEGUN

    def _gears(self, gears: Gears) -> Gears:
        return replace(gears, reverses=gears.reverses and not self._turns_first)

    def _goes_on(self, navigation_map: NavigationMap, pose: Pose, depth: float) -> bool:
        return _leads_out(navigation_map, pose, self._turns_from(pose), self._speed, max(WITHIN, DEPTHS * depth))


class LeavesContacts:
    """What every controller that leaves contacts has."""

    @cached_property
    def leaving(self) -> DriveOut:
        """How it leaves the present contact."""
        return DriveOut()

    @property
    def is_leaving(self) -> bool:
        """Whether the robot has begun to; it does not stop half way, however far it gets from its path."""
        return self.leaving.last is not None


class OnPath:
    """Where the robot comes to if it follows its path.

    Parameters
    ----------
    pose : Pose
        Of the robot, in the frame of the path.
    backward : bool
        Whether it drives backward there.
    on_map : callable, optional
        A pose in the frame of the path in that of the map; without it they are the same.
    """

    def __init__(
        self,
        tracker: PathTracker,
        pose: Pose,
        backward: bool = False,
        on_map: Callable[[Pose], Pose] | None = None,
    ) -> None:
        self._tracker, self._pose, self._backward, self._on_map = tracker, pose, backward, on_map

    def __call__(self, distance: float) -> Iterator[Pose]:
        """Yield poses in the frame of the map, from where the robot has got to and over a distance [m]."""
        tracker, pose = self._tracker, self._pose
        poses = poses_ahead(tracker, distance, self._backward)
        lengths = tracker.progress + np.linspace(0.0, min(distance, tracker.to_cusp), len(poses))
        heights = np.interp(lengths, tracker.lengths, tracker.path.positions[:, 2])
        for (x, y, yaw), z in zip(poses.tolist(), heights.tolist(), strict=True):
            there = Pose.planar(x, y, yaw, z, pose.frame_id, pose.stamp)
            yield there if self._on_map is None else self._on_map(there)


def path_leads(navigation_map: NavigationMap, depth: float, poses: Iterable[Pose]) -> str:
    """Whether a robot that lies ``depth`` [m] deep and follows ``poses`` comes out, first lies deeper, or neither."""
    for pose in poses:
        there = navigation_map.contact_depth(pose)
        if there <= max(depth - LESS, 0.0):
            return OUT
        if there > depth + LESS:
            return INTO
    return ALONG


def _elsewhere(pose: Pose, last: Pose) -> bool:
    return pose.distance_to(last) > ELSEWHERE or abs(normalize_angle(pose.yaw - last.yaw)) > TURNED


def _choose(
    navigation_map: NavigationMap, pose: Pose, bearing: float, gears: Gears, depth: float
) -> tuple[float, float] | None:
    """Angle [rad] to turn by, and the speed [m/s] of the straight drive after it; None if nothing leads out."""
    if straight := _straight_out(navigation_map, pose, gears, depth):
        return 0.0, straight
    return _turn_off(navigation_map, pose, bearing, gears, depth, OFF_PATH)


def _straight_out(navigation_map: NavigationMap, pose: Pose, gears: Gears, depth: float) -> float:
    """The speed [m/s] of a straight drive that leads out steeply; 0 if none does."""
    speed, within = -CREEPING if gears.backward else CREEPING, max(AT_LEAST, STEEP * depth)
    both = (speed, -speed) if gears.reverses else (speed,)
    return next((straight for straight in both if _leads_out(navigation_map, pose, 0.0, straight, within)), 0.0)


def _turn_off(
    navigation_map: NavigationMap, pose: Pose, bearing: float, gears: Gears, depth: float, off_path: Sequence[float]
) -> tuple[float, float] | None:
    """As ``_choose``, where nothing leads out steeply: to the path, straight on, and to both sides by these angles."""
    speed = -CREEPING if gears.backward else CREEPING
    angles = [0.0] if abs(bearing) <= SMALL_TURN else [bearing, 0.0]
    angles += [bearing + side * angle for angle in off_path for side in (1.0, -1.0)]
    distance = max(WITHIN, DEPTHS * depth)
    angle = next((angle for angle in angles if _leads_out(navigation_map, pose, angle, speed, distance)), None)
    return None if angle is None else (angle, speed)


def _leads_out(navigation_map: NavigationMap, pose: Pose, angle: float, speed: float, distance: float) -> bool:
    """Whether the robot touches nothing after a turn by ``angle`` [rad] and a straight drive of ``distance`` [m]."""
    if angle != 0.0 and navigation_map.obstacle_on_path(pose, Twist.planar(wz=math.copysign(1.0, angle)), abs(angle)):
        return False
    duration = distance / CREEPING
    turned = Pose.planar(pose.x, pose.y, pose.yaw + angle, pose.z, pose.frame_id, pose.stamp)
    if navigation_map.obstacle_on_path(turned, Twist.planar(speed), duration):
        return False
    x, y, _ = arc_poses((turned.x, turned.y, turned.yaw), speed, 0.0, 0.0, duration, duration)[-1].tolist()
    return navigation_map.contact_depth(replace(turned, position=(x, y, pose.z))) == 0.0
