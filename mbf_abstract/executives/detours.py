"""What a robot does about who stands on its path, while it drives: a newer path, a detour, or by how they move."""

from __future__ import annotations

import math
from collections.abc import Generator, Mapping
from contextlib import suppress

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from mbf_abstract.drive.robot import RobotStateError
from mbf_abstract.executives.leaves import GetPath
from mbf_abstract.executives.nodes import Composite
from mbf_abstract.geometry.transform import TransformError
from mbf_abstract.goals.result_types import ActionResult, GetPathResult
from mbf_abstract.maps.tracking.blocking import Blockage
from mbf_abstract.maps.tracking.objects import Motion

SAME_PLACE = 1.0
"""A detour that was asked for less than this far away [m] was asked for here."""
TAKEN_PAUSE = 2.0
"""For so long [s] a detour that was taken is driven before another one is asked for at the same place."""
SHORT_DETOUR = 5.0
"""A detour is taken in any case if it is longer by no more than this [m]."""


class UpdatePath(GetPath):
    """Plan beside a driving robot. Its failure does not become the mission's: the robot has a path.

    Parameters
    ----------
    longest : float
        A path that is longer than this many times the rest of the present one is not taken; waiting is better then.
    """

    def __init__(
        self, name: str = "update path", planner: str = "", slot: int = 0, longest: float = math.inf, refiner: str = ""
    ) -> None:
        super().__init__(name, planner, slot=slot, refiner=refiner)
        self.longest = longest

    def take_result(self, result: ActionResult) -> None:
        """Keep the path of a success only."""
        if result.success and isinstance(result, GetPathResult) and result.path is not None:
            present = math.inf if self.mission.path is None else self.mission.path_to_follow().length
            if not self.is_too_long(result.path.length, present):
                super().take_result(result)
            else:
                self.feedback_message = f"{result.path.length:.1f} m instead of {present:.1f} m: not taken"

    def is_too_long(self, length: float, present: float) -> bool:
        """Whether a path of this length [m] is not taken instead of the rest of the present one [m]."""
        return length > self.longest * present


class Detour(UpdatePath):
    """Plan around who stands on the path; fails where the detour is too long, or was asked for here just now.

    Where there was none worth taking there will be none soon, and one that was taken needs time to be driven. All
    nodes of a mission remember together, so the second planner and a recovery do not both ask.

    Parameters
    ----------
    asked_again : float
        After a detour that was not taken none is asked for at this place for so long [s].
    """

    def __init__(self, name: str, planner: str, slot: int, longest: float, refiner: str, asked_again: float) -> None:
        super().__init__(name, planner, slot, longest, refiner)
        self.asked_again = asked_again
        self._taken = False

    def initialise(self) -> None:
        """Forget the plan of an earlier entry."""
        super().initialise()
        self._taken = False

    def update(self) -> Status:
        """Plan, unless the answer is known; remember where."""
        try:
            here, now = self.mission.robot_pose(), self.mission.clock.now()
        except RobotStateError as error:
            self.feedback_message = str(error)
            return Status.FAILURE
        asked = self.mission.detour_asked
        if self.handle is None and asked and now < asked[1] and here.distance_to(asked[0]) <= SAME_PLACE:
            self.feedback_message = "asked for here just now"
            return Status.FAILURE
        status = super().update()
        if status == Status.RUNNING:
            return status
        self.mission.detour_asked = here, now + (TAKEN_PAUSE if self._taken else self.asked_again)
        return Status.SUCCESS if self._taken else Status.FAILURE

    def take_result(self, result: ActionResult) -> None:
        """Keep the path of a success that is not too long."""
        super().take_result(result)
        self._taken = self.mission.plan is result

    def is_too_long(self, length: float, present: float) -> bool:
        """A detour of a few metres costs less than to give way, however near the end of the path is."""
        return length > present + SHORT_DETOUR and super().is_too_long(length, present)


class PickByMotion(Composite):
    """Run the child for how the first tracked object on the path ahead moves. What the others remember stays.

    Parameters
    ----------
    by_motion : mapping of Motion to Behaviour
        A motion that is missing makes the node fail. One node may stand for several motions, and for nobody.
    nobody : Behaviour
        Where no tracked object is in the way.
    length : float
        How far ahead along the path [m] counts.
    standing : float
        What stands for less than this [s] counts as moving: it may have been seen for too short a time to know.
    """

    children_remember = True

    def __init__(
        self,
        name: str,
        by_motion: Mapping[Motion, Behaviour],
        nobody: Behaviour,
        length: float = 3.0,
        standing: float = 0.0,
    ) -> None:
        super().__init__(name, list(dict.fromkeys([*by_motion.values(), nobody])))
        self.by_motion = dict(by_motion)
        self.nobody = nobody
        self.length = length
        self.standing = standing
        self._picked: Behaviour | None = None

    def initialise(self) -> None:
        """Ask the map when entered; where it cannot say, nobody is in the way."""
        first = self._first_in_the_way()
        if first is None:
            self._picked, self.feedback_message = self.nobody, "nobody"
            return
        motion = first.by.motion if first.by.standing >= self.standing else Motion.MOVING
        self._picked = self.by_motion.get(motion)
        self.feedback_message = f"{motion.value}, {first.distance:.1f} m ahead"

    def _first_in_the_way(self) -> Blockage | None:
        if self.mission.path is None:
            return None
        with suppress(TransformError, RobotStateError):
            blockages = self.mission.navigator.server.queries.what_blocks(self.mission.path_to_follow())
            return next((blockage for blockage in blockages if blockage.distance <= self.length), None)
        return None

    def tick_children(self) -> Generator[Behaviour, None, Status]:
        """Tick the picked child."""
        if self._picked is None:
            return Status.FAILURE
        return (yield from self.tick_child(self._picked))
