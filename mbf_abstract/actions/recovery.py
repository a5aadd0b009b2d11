"""The ``recovery`` action: run one behaviour that gets the robot out of trouble.

Unlike upstream the final state follows the outcome (a behaviour that failed is ABORTED, not SUCCEEDED), patience has
its own code (PAT_EXCEEDED), and ``used_plugin`` is the name of the behaviour that ran, also for the default.
"""

from __future__ import annotations

from typing import Any

from mbf_abstract.actions.action import Action, GoalJob
from mbf_abstract.events import EventKind
from mbf_abstract.execution.plugin_run import PluginRun
from mbf_abstract.execution.recovery import RecoveryExecution
from mbf_abstract.execution.runtime import Runtime
from mbf_abstract.goals.goal_types import NoFeedback, RecoveryGoal, RecoveryResultMessage
from mbf_abstract.goals.handle import GoalHandle
from mbf_abstract.outcomes import RecoveryOutcome, is_success
from mbf_abstract.plugins import AbstractRecovery, PluginKind
from mbf_abstract.server.plugin_table import PluginTable

Handle = GoalHandle[RecoveryGoal, RecoveryResultMessage, NoFeedback]
Job = GoalJob[RecoveryGoal, RecoveryResultMessage, NoFeedback]


class RecoveryAction(Action[RecoveryGoal, RecoveryResultMessage, NoFeedback]):
    """Runs recovery behaviours."""

    name = "recovery"
    canceled_outcome = RecoveryOutcome.CANCELED
    invalid_plugin_outcome = RecoveryOutcome.INVALID_PLUGIN
    internal_error_outcome = RecoveryOutcome.INTERNAL_ERROR

    def __init__(self, runtime: Runtime, plugins: PluginTable) -> None:
        super().__init__(runtime)
        self._plugins = plugins

    def _check(self, goal: RecoveryGoal) -> tuple[int, str] | None:
        """1. Accept only a behaviour that is loaded and available."""
        problem = self._plugins.problem(PluginKind.RECOVERY, goal.behavior)
        return (RecoveryOutcome.INVALID_PLUGIN, problem) if problem else None

    def execute(self, job: Job) -> RecoveryResultMessage:
        """2. and 3.: run the behaviour, on the slot's thread."""
        handle = job.handle
        plugin = self._plugins.get(PluginKind.RECOVERY, handle.goal.behavior)
        self.runtime.events.emit(EventKind.RECOVERY, self.name, goal_id=handle.id, slot=job.slot, plugin=plugin.name)
        # 2. Run the behaviour, with the maps kept alive, under patience.
        run: PluginRun[AbstractRecovery] = PluginRun(
            self.runtime,
            plugin,
            handle,
            patience=lambda: self.runtime.parameters.recovery_patience,
            on_abandon=lambda: self._abandon(job, run, execution),
        )
        execution = RecoveryExecution(run)
        with run, run.map_in_use():
            result = execution.execute()
        # 3. Its outcome is the goal's; a text is never missing.
        verdict = "done" if is_success(result.outcome) else "failed"
        message = result.message or f"recovery {plugin.name!r} {verdict}"
        return RecoveryResultMessage(int(result.outcome), message, used_plugin=plugin.name)

    def _abandon(self, job: Job, run: PluginRun[AbstractRecovery], execution: RecoveryExecution) -> None:
        """Stop the robot under a behaviour that hangs, then end its goal."""
        execution.motion.revoke("the behaviour hangs")
        if job.handle.cancel_requested:
            text = f"{job.handle.cancel_reason}; {run.suspect} has not ended yet"
            job.abandon(RecoveryOutcome.CANCELED, text)
        else:
            patience = self.runtime.parameters.recovery_patience
            text = f"{run.suspect} did not come back within {patience:g} s and its grace"
            job.abandon(RecoveryOutcome.PAT_EXCEEDED, text)

    def make_result(self, handle: Handle, outcome: int, message: str) -> RecoveryResultMessage:
        """Result of a goal that ended before or without its behaviour."""
        return RecoveryResultMessage(int(outcome), message, used_plugin=handle.goal.behavior)

    def _goal_data(self, goal: RecoveryGoal) -> dict[str, Any]:
        return {"behavior": goal.behavior}
