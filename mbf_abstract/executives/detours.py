"""What a robot does about who stands on its path, while it drives: a newer path, or a detour."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import replace

import numpy as np
from py_trees.common import Status

from mbf_abstract.drive.robot import RobotStateError
from mbf_abstract.executives.leaves import GetPath
from mbf_abstract.executives.trees.by_motion import MARGIN, blockages_ahead
from mbf_abstract.geometry import Path
from mbf_abstract.geometry.transform import TransformError
from mbf_abstract.goals.goal_types import GetPathGoal
from mbf_abstract.goals.result_types import ActionResult, GetPathResult
from mbf_abstract.maps.queries import CellState
from mbf_abstract.maps.tracking.objects import Motion
from mbf_abstract.outcomes import ExePathOutcome

SAME_PLACE = 1.0
"""A detour that was asked for less than this far away [m] was asked for here."""
TAKEN_PAUSE = 2.0
"""For so long [s] a detour that was taken is driven before another one is asked for at the same place."""
BEHIND, LEAST_BEHIND = 2.0, 0.8
"""So far [m] behind where the path meets somebody who stands a detour leads back to it; at least so far, where somebody
else moves there."""
SHORT_DETOUR = 5.0
"""A detour is taken in any case if it is longer by no more than this [m]."""


class UpdatePath(GetPath):
    """Plan beside a driving robot. Its failure does not become the mission's: the robot has a path.

    Parameters
    ----------
    longest : float
        A path that is longer than this many times the rest of the present one is not taken; waiting is better then.
    once : bool
        A plan that fails is not tried again: the robot has a path, and who stands in its way may be gone before that.
    """

    def __init__(
        self,
        name: str = "update path",
        planner: str = "",
        slot: int = 0,
        longest: float = math.inf,
        refiner: str = "",
        *,
        once: bool = False,
    ) -> None:
        super().__init__(name, planner, slot=slot, refiner=refiner)
        self.longest = longest
        self.once = once

    def make_goal(self) -> GetPathGoal:
        """Plan from where the robot is."""
        goal = super().make_goal()
        return replace(goal, max_retries=0) if self.once else goal

    def take_result(self, result: ActionResult) -> None:
        """Keep the path of a success only; one that sets the robot back once too often is a failure of its drive."""
        if not result.success or not isinstance(result, GetPathResult) or result.path is None:
            return
        length = result.path.length
        present = math.inf if self.mission.path is None else self.mission.path_to_follow().length
        if self.is_too_long(length, present):
            self.feedback_message = f"{length:.1f} m instead of {present:.1f} m: not taken"
        elif problem := self.mission.drives and self.mission.stuck.note_new_path(length, present):
            self.feedback_message = problem
            self.mission.fail(ActionResult(int(ExePathOutcome.BLOCKED_PATH), problem))
        else:
            super().take_result(result)

    def is_too_long(self, length: float, present: float) -> bool:
        """Whether a path of this length [m] is not taken instead of the rest of the present one [m]."""
        return length > self.longest * present


class Detour(UpdatePath):
    """Plan around who stands on the path; fails where the detour is too long, or was asked for here just now.

    Where there was none worth taking there will be none soon, and one that was taken needs time to be driven. All
    nodes of a mission remember together, so the second planner and a recovery do not both ask. A plan takes what moves
    to stay where it is now; where somebody moves on the path behind the first one, who has left before the robot is
    there, a plan is asked for first that leads back to the path just behind the first one.

    Parameters
    ----------
    asked_again : float
        After a detour that was not taken none is asked for at this place for so long [s].
    taken_pause : float
        The same [s] after one that was taken.
    """

    def __init__(
        self,
        name: str,
        planner: str,
        slot: int,
        longest: float,
        refiner: str,
        asked_again: float,
        taken_pause: float = TAKEN_PAUSE,
    ) -> None:
        super().__init__(name, planner, slot, longest, refiner, once=True)
        self.asked_again = asked_again
        self.taken_pause = taken_pause
        self._taken = False
        self._rest: Path | None = None

    def initialise(self) -> None:
        """Forget the plan of an earlier entry."""
        super().initialise()
        self._taken, self._rest = False, None

    def make_goal(self) -> GetPathGoal:
        """Plan to the goal, or to the path behind who stands on it."""
        goal = super().make_goal()
        return goal if self._rest is None else replace(goal, target_pose=self._rest[0], dist_tolerance=0.0)

    def update(self) -> Status:
        """Plan, unless the answer is known; remember where."""
        try:
            here, now = self.mission.robot_pose(), self.mission.clock.now()
        except RobotStateError as error:
            self.feedback_message = str(error)
            return Status.FAILURE
        asked = self.mission.detour_asked
        if self.handle is None and asked and here.distance_to(asked[0]) <= SAME_PLACE:
            _, when, taken = asked
            if now < when + (self.taken_pause if taken else self.asked_again):
                self.feedback_message = "asked for here just now"
                return Status.FAILURE
        if self.handle is None:
            self._rest = self._path_behind()
        status = super().update()
        if status != Status.RUNNING and not self._taken and self._rest is not None:
            self._rest, self.handle = None, None
            status = super().update()
        if status == Status.RUNNING:
            return status
        self.mission.detour_asked = here, now, self._taken
        if self._taken and self.mission.plan is not None:
            self.mission.detour_taken = here, self.mission.plan
        return Status.SUCCESS if self._taken else Status.FAILURE

    def _path_behind(self) -> Path | None:
        """The path from behind the first object on it, where another one moves there; else None."""
        if self.mission.path is None:
            return None
        ahead = blockages_ahead(self.mission, MARGIN)
        moving = [other.distance for other in ahead[1:] if other.by.motion is Motion.MOVING]
        if not moving:
            return None
        first, path = ahead[0].distance, self.mission.path_to_follow()
        driven = path.length - path.remaining_lengths
        nearest, farthest = first + LEAST_BEHIND, min(first + BEHIND, moving[0])  # before who moves
        begin, end = np.searchsorted(driven, (nearest, max(farthest, nearest))).tolist()
        fits = self._last_fitting(path[begin : end + 1])
        behind = len(path) if fits is None else begin + fits
        return path[behind:] if behind < len(path) - 1 else None

    def _last_fitting(self, path: Path) -> int | None:
        """The last pose with most room for the robot; None where it fits nowhere, as somebody moves there."""
        with suppress(TransformError):
            states = [answer.state for answer in self.mission.navigator.server.queries.check_poses(path)]
            best = min(states, default=CellState.OUTSIDE)
            return len(states) - 1 - states[::-1].index(best) if best <= CellState.INSCRIBED else None
        return None

    def take_result(self, result: ActionResult) -> None:
        """Keep the path of a success that is not too long, with the rest of the present one where it leads there."""
        if self._rest is not None and isinstance(result, GetPathResult) and result.path is not None:
            path = Path.from_poses([*result.path, *self._rest[1:]], result.path.stamp)
            result = replace(result, path=path)
        super().take_result(result)
        self._taken = self.mission.plan is result

    def is_too_long(self, length: float, present: float) -> bool:
        """A detour of a few metres costs less than to give way, however near the end of the path is."""
        return length > present + SHORT_DETOUR and super().is_too_long(length, present)
