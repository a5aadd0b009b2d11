"""Past somebody who goes the robot's way, but slower: ``IsHeldUp`` and ``Overtake``, beside a drive.

When to use: with a controller that keeps to its path, on a map whose layers track objects: it would drive behind for as
long as both go the same way. The map's layer ``moving_obstacles`` costs where that one will be for as long as passing
takes, so that a plan leads past. When not: for who stands (``detours.py``), or comes, or crosses, who is waited for.
"""

from __future__ import annotations

import math
from contextlib import suppress

import numpy as np
from py_trees.common import Status

from mbf_abstract.drive.robot import RobotStateError
from mbf_abstract.executives.detours import SHORT_DETOUR, UpdatePath
from mbf_abstract.executives.mission import MissionContext
from mbf_abstract.executives.nodes import Leaf
from mbf_abstract.executives.trees.by_motion import MARGIN, first_in_the_way
from mbf_abstract.geometry import Path, Pose
from mbf_abstract.geometry.transform import TransformError
from mbf_abstract.goals.result_types import ActionResult, GetPathResult
from mbf_abstract.maps.queries import CellState
from mbf_abstract.maps.tracking.blocking import ALONG, Blockage
from mbf_abstract.maps.tracking.objects import Motion, TrackedObject
from mbf_abstract.maps.tracking.prediction import SLOW

AHEAD = 3.0
"""So far ahead [m] along the path somebody holds the robot up."""
ONWARD = 5.0
"""Where there was no room to pass none is looked for until the robot has come so much [m] farther."""
PAUSE = 4.0
"""For so long [s] a path past somebody is driven before another one is asked for."""
MOST = 6
"""After so many of these in a row the robot stays behind as where there was no room: it does not get past."""
BESIDE = 1.0
"""Who was begun to be passed is so until the path keeps farther [m] from there than this."""
SIDEWAYS = (0.6, 0.9, 1.2, 1.8, 2.4)
"""So far [m] beside the path room to pass is looked for, to the left and to the right."""
KEPT = 0.3
"""Beside somebody who moves a robot that keeps this distance [m] is hardly slowed down, see ``tracking/contact.py``."""
BEGINNING = 0.5
"""On so much [m] of a path past somebody the robot comes out from beside or behind them."""
SPACING = 0.25
"""Length of the path [m] between two places that are looked at."""
HELD_UP = 0.7
"""A robot is held up below this share of its pace; less than ``SLOW``, so that who is passed stays slow enough."""


class IsHeldUp(Leaf):
    """Succeed while somebody ahead goes along the path, slower than the robot has driven, and so does the robot.

    Who was begun to be passed counts until they are behind, also while the robot drives fast.
    """

    def __init__(self, name: str = "held up?") -> None:
        super().__init__(name)
        self._pace = 0.0  # the fastest that the robot was seen to drive [m/s]
        self._passed = 0  # number of the object that is being passed

    def update(self) -> Status:
        """Compare both speeds with what the robot has driven at."""
        try:
            speed = self.mission.navigator.server.runtime.robot.velocity().speed
        except RobotStateError as error:
            self.feedback_message = str(error)
            return Status.FAILURE
        self._pace = max(self._pace, speed)
        held_up_by = self._passed_now() or self._met_now(speed)
        self._passed = 0 if held_up_by is None else held_up_by.number
        self.feedback_message = f"by object {self._passed}" if self._passed else "by nobody"
        return Status.SUCCESS if self._passed else Status.FAILURE

    def _passed_now(self) -> TrackedObject | None:
        """The one that is being passed, while it goes on and is slow; the path may lead around it by now."""
        first = first_in_the_way(self.mission, AHEAD, BESIDE) if self._passed else None
        known = first is not None and first.by.number == self._passed and first.along > 0.0
        return first.by if first is not None and known and self._is_slow(first.by, SLOW) else None

    def _met_now(self, speed: float) -> TrackedObject | None:
        """The first one ahead of a robot of this speed [m/s], if it is slow and goes along the path."""
        first = first_in_the_way(self.mission, AHEAD, MARGIN) if speed <= HELD_UP * self._pace else None
        if first is None or first.along < ALONG or not self._is_slow(first.by, HELD_UP):
            return None
        with suppress(TransformError, RobotStateError):
            return first.by if has_room_beside(self.mission, first) else None
        return None

    def _is_slow(self, known: TrackedObject, share: float) -> bool:
        return known.motion is Motion.MOVING and known.speed <= share * self._pace


def has_room_beside(mission: MissionContext, first: Blockage) -> bool:
    """Whether the robot fits beside its path up to behind somebody on it, far enough from that one."""
    path = mission.path_to_follow()
    lengths = path.length - path.remaining_lengths
    looks = np.arange(0.0, min(first.distance + AHEAD, path.length), SPACING)
    poses = [path[index] for index in np.searchsorted(lengths, looks).tolist()]
    queries = mission.navigator.server.queries
    for shift in (side * distance for distance in SIDEWAYS for side in (1.0, -1.0)):
        beside = Path.from_poses([_beside(pose, shift) for pose in poses], path.stamp)
        met = any(other.by.number == first.by.number for other in queries.what_blocks(beside, margin=KEPT))
        if not met and queries.check_path(beside).state is CellState.FREE:
            return True
    return False


def _beside(pose: Pose, shift: float) -> Pose:
    """The pose so far [m] to the left."""
    x, y = pose.x - shift * math.sin(pose.yaw), pose.y + shift * math.cos(pose.yaw)
    return Pose((x, y, pose.z), pose.orientation, pose.frame_id, pose.stamp)


class Overtake(UpdatePath):
    """Plan past those who hold the robot up; fails where the path is long, or does not keep clear of them."""

    def __init__(self, name: str, planner: str, slot: int, longest: float, refiner: str) -> None:
        super().__init__(name, planner, slot, longest, refiner, once=True)
        self._asked: tuple[Pose, float] | None = None  # where, and when [s], the last plan was asked for
        self._taken = False
        self._in_a_row = 0

    def update(self) -> Status:
        """Plan, unless that was done a short way or time ago."""
        if self.handle is None:
            try:
                here, now = self.mission.robot_pose(), self.mission.clock.now()
            except RobotStateError as error:
                self.feedback_message = str(error)
                return Status.FAILURE
            if self._asked is not None and self._is_early(here, now):
                self.feedback_message = "asked for just now"
                return Status.FAILURE
            goes_on = self._asked is not None and now < self._asked[1] + 2.0 * PAUSE
            self._in_a_row = self._in_a_row + 1 if goes_on else 1
            self._asked, self._taken = (here, now), False
        status = super().update()
        if status == Status.RUNNING:
            return status
        return Status.SUCCESS if self._taken else Status.FAILURE

    def _is_early(self, here: Pose, now: float) -> bool:
        assert self._asked is not None
        where, when = self._asked
        if self._taken and self._in_a_row < MOST:
            return now < when + PAUSE
        return here.distance_to(where) < ONWARD

    def take_result(self, result: ActionResult) -> None:
        """Keep the path of a success on which nobody is met who moves now."""
        if isinstance(result, GetPathResult) and result.path is not None and self._meets_somebody(result.path):
            self.feedback_message = "no room to pass"
            return
        super().take_result(result)
        self._taken = self.mission.plan is result

    def _meets_somebody(self, path: Path) -> bool:
        """Whether somebody who moves is on a path, once it has left where the robot is, or the map cannot say."""
        begin = min(int(np.searchsorted(path.length - path.remaining_lengths, BEGINNING)), len(path) - 1)
        with suppress(TransformError):
            met = self.mission.navigator.server.queries.what_blocks(path[begin:], margin=MARGIN)
            return any(blockage.by.motion is Motion.MOVING for blockage in met)
        return True

    def is_too_long(self, length: float, present: float) -> bool:
        """Passing costs a few metres; more is not worth it."""
        return length > present + SHORT_DETOUR or super().is_too_long(length, present)
