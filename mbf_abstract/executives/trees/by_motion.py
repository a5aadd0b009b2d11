"""Who is in the way, and what is done about how that one moves: ``PickByMotion`` and ``EndDrive``."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from mbf_abstract.drive.robot import RobotStateError
from mbf_abstract.executives.mission import MissionContext
from mbf_abstract.executives.nodes import Leaf, PickedChild
from mbf_abstract.geometry.transform import TransformError
from mbf_abstract.goals.result_types import ActionResult
from mbf_abstract.maps.tracking.blocking import ALONG, Blockage
from mbf_abstract.maps.tracking.objects import Motion
from mbf_abstract.outcomes import ExePathOutcome

MARGIN = 0.2
"""Who is this near [m] to the robot's outline on its path may keep its controller from following that."""
LONGEST_PASSING = 3.0
"""So far [m] from where a detour was taken the robot still passes who stands there."""
MEETING, QUEUE = 6.0, 10.0
"""Who was seen to move and has stood for so long [s] before a robot that creeps does not go on before that one. The
second is for who went where the robot goes, and may wait for somebody ahead who loads and turns."""
TOGETHER, FACING = 2.5, 3.0
"""Who came along the path, and had stood for no longer than the first [s] when the robot was seen to creep, stopped for
the robot; after the second [s] it does not go on before the robot."""
SAME_STOP = 0.5
"""Two estimates [s] of when somebody stopped that are this near are of one stop."""


class PickByMotion(PickedChild):
    """Run the child for how the first tracked object on the path ahead moves. What the others remember stays.

    Parameters
    ----------
    by_motion : mapping of Motion to Behaviour
        A motion that is missing makes the node fail. One node may stand for several motions, and for nobody.
    nobody : Behaviour
        Where no tracked object is in the way.
    came : Behaviour, optional
        For one that waits for the robot: it was seen to come along the path before it stood, or to move at all, and
        has stood for ``MEETING``, or ``QUEUE``. None = as ``by_motion`` has it.
    length : float
        How far ahead along the path [m] counts.
    standing : float
        What stands for less than this [s] counts as moving: it may have been seen for too short a time to know.
    margin : float
        Who is this near [m] to the robot's outline on the path is in the way: a controller cuts the path's corners.
    """

    def __init__(
        self,
        name: str,
        by_motion: Mapping[Motion, Behaviour],
        nobody: Behaviour,
        came: Behaviour | None = None,
        length: float = 3.0,
        standing: float = 0.0,
        margin: float = MARGIN,
    ) -> None:
        special = [] if came is None else [came]
        super().__init__(name, list(dict.fromkeys([*by_motion.values(), *special, nobody])))
        self.by_motion = dict(by_motion)
        self.nobody, self.came = nobody, came
        self.length = length
        self.standing = standing
        self.margin = margin

    def pick(self) -> Behaviour | None:
        """Ask the map; where it cannot say, nobody is in the way."""
        first = first_in_the_way(self.mission, self.length, self.margin)
        if first is None:
            self.feedback_message = "nobody"
            return self.nobody
        motion = first.by.motion if first.by.standing >= self.standing else Motion.MOVING
        self.feedback_message = f"{motion.value}, {first.distance:.1f} m ahead"
        picked = self.by_motion.get(motion)
        return self.came or picked if motion is Motion.WAITING and waits_for_robot(first) else picked


def blockages_ahead(mission: MissionContext, margin: float) -> list[Blockage]:
    """The tracked objects on the rest of the mission's path, the first one first; none where the map cannot say."""
    if mission.path is not None:
        with suppress(TransformError, RobotStateError):
            return list(mission.navigator.server.queries.what_blocks(mission.path_to_follow(), margin=margin))
    return []


def waits_for_robot(first: Blockage) -> bool:
    """Whether one that stands on the path came along it, or was seen to move and stands for longer than to load."""
    moved = first.by.course != (0.0, 0.0)
    return first.along <= -ALONG or (moved and first.by.standing >= _longest_stand(first))


def _longest_stand(first: Blockage) -> float:
    """How long [s] one that was seen to move stands for another reason than the robot."""
    return QUEUE if first.along >= ALONG else MEETING


def first_in_the_way(mission: MissionContext, length: float, margin: float) -> Blockage | None:
    """The first tracked object on the next ``length`` [m] of the mission's path."""
    return next((found for found in blockages_ahead(mission, margin) if found.distance <= length), None)


class EndDrive(Leaf):
    """End the drive beside which it runs: one that waits for the robot has stood in the way for too long.

    Neither gets on until one gives way. The mission's failure becomes BLOCKED_PATH; where that one has stood for less,
    the robot is more than half past it, or a detour around it is driven, the node fails.
    """

    def __init__(self, name: str, length: float = 3.0) -> None:
        super().__init__(name)
        self.length = length
        self._met = (0, 0.0)  # number of the last one, and when [s] it stopped
        self._together = False  # whether the robot was seen to creep soon after that

    def update(self) -> Status:
        """Ask who it is, and for how long it stands."""
        first = first_in_the_way(self.mission, self.length, MARGIN)
        if first is None or first.by.standing < self._patience_with(first) or first.ahead < 0.0 or self._passes():
            return Status.FAILURE
        text = f"object {first.by.number} waits for the robot and has stood for {first.by.standing:.1f} s"
        self.mission.fail(ActionResult(int(ExePathOutcome.BLOCKED_PATH), text))
        return Status.SUCCESS

    def _patience_with(self, first: Blockage) -> float:
        """Less with one that came along the path and stopped when the robot crept already: it stopped for the robot."""
        number, stopped = self._met
        stops = self.mission.clock.now() - first.by.standing
        if first.by.number != number or abs(stops - stopped) > SAME_STOP:
            self._met, self._together = (first.by.number, stops), first.by.standing <= TOGETHER
        stopped_for_robot = self._together and first.along <= -ALONG
        return FACING if stopped_for_robot else _longest_stand(first)

    def _passes(self) -> bool:
        """Whether the robot drives a detour that was taken near here."""
        taken = self.mission.detour_taken
        if taken is None or self.mission.plan is not taken[1]:
            return False
        with suppress(RobotStateError):
            return taken[0].distance_to(self.mission.robot_pose()) <= LONGEST_PASSING
        return True
