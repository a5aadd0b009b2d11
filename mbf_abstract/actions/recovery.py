"""The ``recovery`` action: run one behaviour that gets the robot out of trouble.

Unlike upstream the final state follows the outcome (a behaviour that failed is ABORTED, not SUCCEEDED), patience has
its own code (PAT_EXCEEDED), and ``used_plugin`` is the name of the behaviour that ran, also for the default. A goal may
bring parameters of its own; one whose parameters are not legal is rejected with FAILURE.
"""

from __future__ import annotations

from typing import Any

from mbf_abstract.actions.action import GoalJob
from mbf_abstract.actions.plugin_action import PluginAction
from mbf_abstract.events import EventKind
from mbf_abstract.execution.recovery import RecoveryExecution
from mbf_abstract.goals.feedback_types import NoFeedback
from mbf_abstract.goals.goal_types import RecoveryGoal
from mbf_abstract.goals.handle import GoalHandle
from mbf_abstract.goals.result_types import RecoveryResultMessage
from mbf_abstract.outcomes import RecoveryOutcome
from mbf_abstract.parameters import with_changes
from mbf_abstract.plugins import AbstractRecovery, PluginKind

Handle = GoalHandle[RecoveryGoal, RecoveryResultMessage, NoFeedback]
Job = GoalJob[RecoveryGoal, RecoveryResultMessage, NoFeedback]


class RecoveryAction(PluginAction[RecoveryGoal, RecoveryResultMessage, NoFeedback, AbstractRecovery]):
    """Runs recovery behaviours."""

    name = "recovery"
    kind = PluginKind.RECOVERY
    canceled_outcome = RecoveryOutcome.CANCELED
    patience_outcome = RecoveryOutcome.PAT_EXCEEDED
    invalid_plugin_outcome = RecoveryOutcome.INVALID_PLUGIN
    internal_error_outcome = RecoveryOutcome.INTERNAL_ERROR

    @property
    def patience(self) -> float:
        """Time [s] for the behaviour."""
        return self.runtime.parameters.recovery_patience

    def _plugin_name(self, goal: RecoveryGoal) -> str:
        return goal.behavior

    def _problem(self, goal: RecoveryGoal) -> tuple[int, str] | None:
        """Refuse parameters that the behaviour does not have, or values that are not legal."""
        if not goal.parameters:
            return None
        plugin = self._plugins.get(self.kind, goal.behavior)
        try:
            with_changes(plugin.instance.parameters, goal.parameters)
        except ValueError as error:
            return RecoveryOutcome.FAILURE, f"parameters of recovery {plugin.name!r}: {error}"
        return None

    def execute(self, job: Job) -> RecoveryResultMessage:
        """2. and 3.: run the behaviour, on the slot's thread."""
        handle, plugin = job.handle, self._plugin(job)
        self.runtime.events.emit(EventKind.RECOVERY, self.name, goal_id=handle.id, slot=job.slot, plugin=plugin.name)
        # 2. Run the behaviour, with the maps kept alive, under patience.
        run = self._supervise(job, plugin, lambda reason: execution.motion.revoke(reason))
        execution = RecoveryExecution(run, handle.goal.parameters)
        with run, run.map_in_use():
            result = execution.execute()
        # 3. Its outcome is the goal's; a text is never missing.
        message = result.message or f"recovery {plugin.name!r} done"
        return RecoveryResultMessage(int(result.outcome), message, used_plugin=plugin.name)

    def make_result(self, handle: Handle, outcome: int, message: str) -> RecoveryResultMessage:
        """Result of a goal that ended before or without its behaviour."""
        return RecoveryResultMessage(int(outcome), message, used_plugin=handle.goal.behavior)

    def _goal_data(self, goal: RecoveryGoal) -> dict[str, Any]:
        return {"behavior": goal.behavior, **({"parameters": dict(goal.parameters)} if goal.parameters else {})}
