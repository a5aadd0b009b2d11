"""The ``refine_path`` action: a better path between the same two poses, e.g. a smoother one."""

from __future__ import annotations

from functools import partial
from typing import Any

from mbf_abstract.actions.action import GoalJob
from mbf_abstract.actions.plugin_action import PluginAction
from mbf_abstract.execution.plan_check import leaves_map
from mbf_abstract.execution.refiner import RefinerExecution
from mbf_abstract.geometry import Path
from mbf_abstract.geometry.transform import TransformError
from mbf_abstract.goals.feedback_types import NoFeedback
from mbf_abstract.goals.goal_types import RefinePathGoal
from mbf_abstract.goals.handle import GoalHandle
from mbf_abstract.goals.result_types import RefinePathResult
from mbf_abstract.outcomes import RefinePathOutcome
from mbf_abstract.plugins import AbstractRefiner, PluginKind, RefineResult

Handle = GoalHandle[RefinePathGoal, RefinePathResult, NoFeedback]
Job = GoalJob[RefinePathGoal, RefinePathResult, NoFeedback]


class RefinePathAction(PluginAction[RefinePathGoal, RefinePathResult, NoFeedback, AbstractRefiner]):
    """Refines paths."""

    name = "refine_path"
    kind = PluginKind.REFINER
    canceled_outcome = RefinePathOutcome.CANCELED
    patience_outcome = RefinePathOutcome.STOPPED
    invalid_plugin_outcome = RefinePathOutcome.INVALID_PLUGIN
    internal_error_outcome = RefinePathOutcome.INTERNAL_ERROR

    @property
    def patience(self) -> float:
        """Time [s] for all calls of the refiner together, as for a planner: one that hangs must not hold its slot."""
        return self.runtime.parameters.planner_patience

    def _plugin_name(self, goal: RefinePathGoal) -> str:
        return goal.refiner

    def _problem(self, goal: RefinePathGoal) -> tuple[int, str] | None:
        """1. Accept only a path with poses."""
        return (RefinePathOutcome.FAILURE, "the path has no poses") if len(goal.path) == 0 else None

    def execute(self, job: Job) -> RefinePathResult:
        """2. and 3.: refine, on the slot's thread."""
        handle, plugin = job.handle, self._plugin(job)
        job.report_started(plugin=plugin.name)
        # 2. Refine under patience and retries.
        run = self._supervise(job, plugin)
        with run, run.map_in_use():
            result = RefinerExecution(run, handle.goal.path).execute()
            # 3. Refuse a path that leaves the map or leads elsewhere, else measure what changed.
            judge = partial(self._measured, result, handle.goal.path, plugin.name)
            return run.call_beside("the map's path_problem()", judge)

    def _measured(self, result: RefineResult, original: Path, refiner: str) -> RefinePathResult:
        if not result.success:
            return RefinePathResult(int(result.outcome), result.message, refined_path=original, refiner=refiner)
        refined = result.path
        if refined is None or len(refined) == 0:
            text = f"refiner {refiner!r} reported success but gave no poses"
            return RefinePathResult(RefinePathOutcome.INTERNAL_ERROR, text, refined_path=original, refiner=refiner)
        if refined is not original and (problem := self._elsewhere(refined, original)):
            text = f"the path of refiner {refiner!r} is refused: {problem}"
            return RefinePathResult(RefinePathOutcome.INTERNAL_ERROR, text, refined_path=original, refiner=refiner)
        if refined is not original and (problem := leaves_map(refined, self.runtime)):
            outcome, text = RefinePathOutcome.INTERNAL_ERROR, f"the path of refiner {refiner!r} is refused: {problem}"
            if before := leaves_map(original, self.runtime):
                outcome, text = RefinePathOutcome.MAP_ERROR, f"before it was refined, {before}"
            return RefinePathResult(outcome, text, refined_path=original, refiner=refiner)
        return RefinePathResult(
            int(result.outcome),
            result.message,
            refined_path=refined,
            final_position_error=refined[-1].distance_to(original[-1]),
            final_orientation_error=refined[-1].angle_to(original[-1]),
            path_length_ratio=refined.length / original.length if original.length > 0.0 else 1.0,
            refiner=refiner,
        )

    def _elsewhere(self, refined: Path, original: Path) -> str:
        """Which end of a refined path lies elsewhere than that of the path; empty if none does."""
        allowed = self.runtime.parameters.plan_end_tolerance
        try:
            there = self.runtime.transforms.transform_path(refined, original.frame_id)
        except TransformError as error:
            return str(error)
        for name, index in (("begins", 0), ("ends", -1)):
            if (off := there[index].distance_to(original[index])) > allowed:
                return f"it {name} {off:.2f} m from where the plan {name}, allowed {allowed:.2f} m"
        return ""

    def make_result(self, handle: Handle, outcome: int, message: str) -> RefinePathResult:
        """Result with the path as it was."""
        return RefinePathResult(int(outcome), message, refined_path=handle.goal.path, refiner=handle.goal.refiner)

    def _goal_data(self, goal: RefinePathGoal) -> dict[str, Any]:
        return {"refiner": goal.refiner, "poses": len(goal.path)}
