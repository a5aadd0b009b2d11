"""Leaves that run an action: ``GetPath``, ``ExePath``, ``Recovery``, ``MoveBase``.

A leaf sends its goal when it is entered, is RUNNING until the goal is final, and cancels the goal when the tree leaves
it early. Results go to the mission: paths to follow, and failures whose code picks a recovery.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import replace
from typing import Any

from py_trees.common import Status

from mbf_abstract.executives.nodes import Leaf
from mbf_abstract.geometry import Path, Pose
from mbf_abstract.goals.arrival_tolerance import planned_tolerance, tolerance_left
from mbf_abstract.goals.goal_types import ExePathGoal, GetPathGoal, MoveBaseGoal, RecoveryGoal, RefinePathGoal
from mbf_abstract.goals.handle import AnyGoalHandle
from mbf_abstract.goals.result_types import ActionResult, ExePathResult, GetPathResult, RefinePathResult
from mbf_abstract.outcomes import is_success


class ActionLeaf(Leaf):
    """One goal of one action; derive it for a goal of your own.

    Attributes
    ----------
    moves_robot : bool
        Wait until an interrupted goal has let go of the robot before sending the own one.
    """

    moves_robot = True

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self.handle: AnyGoalHandle | None = None

    @abstractmethod
    def make_goal(self) -> Any:
        """Return the goal to send, made of the mission as it is now."""

    def take_result(self, result: ActionResult) -> None:
        """Write a result to the mission; this one keeps failures."""
        if not result.success:
            self.mission.fail(result)

    def own_result(self, result: ActionResult) -> ActionResult:
        """The result of the leaf, made of that of the last goal; here it is that."""
        return result

    def following_goal(self, result: ActionResult) -> Any:
        """Return a goal to send after the one with this result, None if that was the last; here it always was."""
        return None

    def initialise(self) -> None:
        """Forget the goal of an earlier entry."""
        self.handle = None

    def update(self) -> Status:
        """Send the goal, and those that follow it; return RUNNING until all are final, then whether it succeeded."""
        if self.handle is None:
            if self.moves_robot and self.mission.robot_is_stopping:
                self.feedback_message = "waiting until the robot has stopped"
                return Status.RUNNING
            self.handle = self.mission.send(self.make_goal())
        result = self.handle.result
        if result is None:
            self.feedback_message = self.handle.status.value
            return Status.RUNNING
        following = self.following_goal(result)
        if following is not None:
            self.handle = self.mission.send(following)
            return Status.RUNNING
        self.feedback_message = f"{result.outcome_name}: {result.message}"
        result = self.own_result(result)
        self.take_result(result)
        return Status.SUCCESS if result.success else Status.FAILURE

    def terminate(self, new_status: Status) -> None:
        """Cancel the goal if it still runs."""
        if self.handle is not None and not self.handle.done:
            self.handle.cancel(f"{self.name!r} was interrupted")


class GetPath(ActionLeaf):
    """Plan to the mission's target, or to a fixed one; the path, refined or not, becomes the mission's path.

    Parameters
    ----------
    planner : str
        Empty = the first one loaded.
    dist_tolerance, angle_tolerance : float
        As in ``GetPathGoal`` [m, rad]; without a distance a path to the mission's target leaves some of the server's
        tolerance for the drive.
    slot : int
        Give a second planner that runs beside the first a slot of its own.
    refiner : str
        Refiner that a plan goes through; one that it cannot refine is kept as it is. Empty = none.
    """

    moves_robot = False

    def __init__(
        self,
        name: str = "get path",
        planner: str = "",
        target: Pose | None = None,
        dist_tolerance: float | None = None,
        angle_tolerance: float | None = None,
        slot: int = 0,
        refiner: str = "",
    ) -> None:
        super().__init__(name)
        self.planner = planner
        self.refiner = refiner
        self._plan: GetPathResult | None = None
        self.target = target
        self.dist_tolerance = dist_tolerance
        self.angle_tolerance = angle_tolerance
        self.slot = slot

    def make_goal(self) -> GetPathGoal:
        """Plan from where the robot is."""
        return GetPathGoal(
            self.target or self.mission.required_target(),
            planner=self.planner,
            dist_tolerance=self._planned_tolerance(),
            angle_tolerance=self.angle_tolerance,
            concurrency_slot=self.slot,
        )

    def _planned_tolerance(self) -> float | None:
        """How far [m] from the target the path may end; None = as ``get_path`` has it."""
        if self.dist_tolerance is not None or self.target is not None:
            return self.dist_tolerance
        return planned_tolerance(self.mission.navigator.server.runtime.parameters.dist_tolerance)

    def following_goal(self, result: ActionResult) -> Any:
        """Refine a plan, where a refiner is given."""
        if not self.refiner or not isinstance(result, GetPathResult) or not result.success or result.path is None:
            return None
        self._plan = result
        return RefinePathGoal(result.path, self.refiner, self.slot)

    def own_result(self, result: ActionResult) -> ActionResult:
        """The plan, with the refined path where there is one."""
        if isinstance(result, RefinePathResult) and self._plan is not None:
            return replace(self._plan, path=result.refined_path)  # without success the path of the plan
        return result

    def take_result(self, result: ActionResult) -> None:
        """Keep the path, or the failure."""
        super().take_result(result)
        if isinstance(result, GetPathResult) and result.path is not None:
            self.mission.take_plan(result)


class ExePath(ActionLeaf):
    """Follow the mission's path; a new path that appears there while driving is followed without stopping.

    Entered again, e.g. after a recovery, it drives the rest of the same path: a failure of control alone needs no plan.
    """

    def __init__(self, name: str = "exe path", controller: str = "", slot: int = 0) -> None:
        super().__init__(name)
        self.controller = controller
        self.slot = slot
        self._path: Path | None = None

    def make_goal(self) -> ExePathGoal:
        """Follow what is left of the path."""
        path = self._path = self.mission.path = self.mission.path_to_follow()
        tolerance = self._tolerance_left(path)
        return ExePathGoal(path, controller=self.controller, concurrency_slot=self.slot, dist_tolerance=tolerance)

    def _tolerance_left(self, path: Path) -> float | None:
        """What a path that ends off the mission's target leaves of the server's tolerance [m]; None = all of it."""
        target = self.mission.target
        if target is None or target.frame_id != path.frame_id:
            return None
        tolerance = self.mission.navigator.server.runtime.parameters.dist_tolerance
        return tolerance_left(tolerance, path[-1].distance_to(target))

    def update(self) -> Status:
        """Hand over a new path, pass feedback on, and wait for the end."""
        if self.handle is not None and not self.handle.done and self.mission.path is not self._path:
            self.handle = self.mission.send(self.make_goal())
        status = super().update()
        feedback = None if self.handle is None else self.handle.feedback
        if feedback is not None:
            self.mission.feedback = feedback
            if not is_success(feedback.outcome):
                self.mission.refused = self.mission.clock.now()
            if status == Status.RUNNING:
                self.feedback_message = f"{feedback.distance_along_path:.2f} m to go: {feedback.message}"
        return status

    def take_result(self, result: ActionResult) -> None:
        """Keep the result; a path that was driven to its end is done with."""
        super().take_result(result)
        if isinstance(result, ExePathResult):
            self.mission.drive = result
        if result.success:
            self.mission.path = None


class Recovery(ActionLeaf):
    """Run one recovery behaviour. Its failure does not become the mission's: that stays what it was called for."""

    def __init__(self, behavior: str, name: str = "", slot: int = 0) -> None:
        super().__init__(name or f"recover: {behavior}")
        self.behavior = behavior
        self.slot = slot

    def make_goal(self) -> RecoveryGoal:
        """Run the behaviour."""
        return RecoveryGoal(self.behavior, concurrency_slot=self.slot)

    def take_result(self, result: ActionResult) -> None:
        """Leave the failure as it is, and note what was tried against it."""
        self.mission.stuck.note_recovery(self.behavior, result.outcome)


class MoveBase(ActionLeaf):
    """Go to a pose with the one-shot action; ``fields`` are those of ``MoveBaseGoal``."""

    def __init__(self, name: str = "move base", target: Pose | None = None, **fields: Any) -> None:
        super().__init__(name)
        self.target = target
        self.fields = fields

    def make_goal(self) -> MoveBaseGoal:
        """Go to the own or the mission's target."""
        return MoveBaseGoal(self.target or self.mission.required_target(), **self.fields)
