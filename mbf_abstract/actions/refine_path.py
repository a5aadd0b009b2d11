"""The ``refine_path`` action: a better path between the same two poses, e.g. a smoother one."""

from __future__ import annotations

from typing import Any

from mbf_abstract.actions.action import Action, GoalJob
from mbf_abstract.events import EventKind
from mbf_abstract.execution.plugin_run import PluginRun
from mbf_abstract.execution.refiner import RefinerExecution
from mbf_abstract.execution.runtime import Runtime
from mbf_abstract.geometry import Path
from mbf_abstract.goals.goal_types import NoFeedback, RefinePathGoal, RefinePathResult
from mbf_abstract.goals.handle import GoalHandle
from mbf_abstract.outcomes import RefinePathOutcome
from mbf_abstract.plugins import AbstractRefiner, PluginKind, RefineResult
from mbf_abstract.server.plugin_table import PluginTable

Handle = GoalHandle[RefinePathGoal, RefinePathResult, NoFeedback]
Job = GoalJob[RefinePathGoal, RefinePathResult, NoFeedback]


class RefinePathAction(Action[RefinePathGoal, RefinePathResult, NoFeedback]):
    """Refines paths."""

    name = "refine_path"
    canceled_outcome = RefinePathOutcome.CANCELED
    invalid_plugin_outcome = RefinePathOutcome.FAILURE
    internal_error_outcome = RefinePathOutcome.INTERNAL_ERROR

    def __init__(self, runtime: Runtime, plugins: PluginTable) -> None:
        super().__init__(runtime)
        self._plugins = plugins

    def _check(self, goal: RefinePathGoal) -> tuple[int, str] | None:
        """1. Accept only a loaded refiner and a path with poses."""
        problem = self._plugins.problem(PluginKind.REFINER, goal.refiner)
        if not problem and len(goal.path) == 0:
            problem = "the path has no poses"
        return (RefinePathOutcome.FAILURE, problem) if problem else None

    def execute(self, job: Job) -> RefinePathResult:
        """2. and 3.: refine, on the slot's thread."""
        handle = job.handle
        plugin = self._plugins.get(PluginKind.REFINER, handle.goal.refiner)
        self.runtime.events.emit(
            EventKind.GOAL_STARTED, self.name, goal_id=handle.id, slot=job.slot, plugin=plugin.name
        )
        # 2. Refine under the planner's patience: a refiner that hangs must not hold its slot.
        run: PluginRun[AbstractRefiner] = PluginRun(
            self.runtime,
            plugin,
            handle,
            patience=lambda: self.runtime.parameters.planner_patience,
            on_abandon=lambda: job.abandon(*self._hung(plugin.name, handle)),
        )
        with run, run.map_in_use():
            result = RefinerExecution(run, handle.goal.path).execute()
        # 3. Measure what changed.
        return self._measured(result, handle.goal.path, plugin.name)

    def _measured(self, result: RefineResult, original: Path, refiner: str) -> RefinePathResult:
        if not result.success:
            return RefinePathResult(int(result.outcome), result.message, refined_path=original, refiner=refiner)
        refined = result.path
        if refined is None or len(refined) == 0:
            text = f"refiner {refiner!r} reported success but gave no poses"
            return RefinePathResult(RefinePathOutcome.INTERNAL_ERROR, text, refined_path=original, refiner=refiner)
        return RefinePathResult(
            int(result.outcome),
            result.message,
            refined_path=refined,
            final_position_error=refined[-1].distance_to(original[-1]),
            final_orientation_error=refined[-1].angle_to(original[-1]),
            path_length_ratio=refined.length / original.length if original.length > 0.0 else 1.0,
            refiner=refiner,
        )

    def _hung(self, refiner: str, handle: Handle) -> tuple[int, str]:
        if handle.cancel_requested:
            return RefinePathOutcome.CANCELED, f"{handle.cancel_reason}; refiner {refiner!r} has not ended yet"
        patience = self.runtime.parameters.planner_patience
        return RefinePathOutcome.STOPPED, f"refiner {refiner!r} gave no answer within {patience:g} s and its grace"

    def make_result(self, handle: Handle, outcome: int, message: str) -> RefinePathResult:
        """Result with the path as it was."""
        return RefinePathResult(int(outcome), message, refined_path=handle.goal.path, refiner=handle.goal.refiner)

    def _goal_data(self, goal: RefinePathGoal) -> dict[str, Any]:
        return {"refiner": goal.refiner, "poses": len(goal.path)}
