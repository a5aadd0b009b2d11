"""Which recovery behaviour of ``move_base`` is due: those of its list in turn, or the escalation of a stuck robot.

The list starts again after progress: a plan, where planning had failed; a stretch driven since the last recovery, where
driving had failed; one more place that plans avoid from now on. When to use: one for each run of ``move_base``. When
not: behaviour trees choose recoveries by their branches and need the ``StuckMonitor`` alone.
"""

from __future__ import annotations

from collections.abc import Sequence

from mbf_abstract.actions.meetings import behavior_for_meetings
from mbf_abstract.actions.move_base_states import Trigger
from mbf_abstract.actions.stuck_monitor import StuckMonitor
from mbf_abstract.drive.robot import RobotStateError
from mbf_abstract.execution.runtime import Runtime
from mbf_abstract.geometry import Pose
from mbf_abstract.plugins import PluginKind
from mbf_abstract.server.plugin_table import PluginTable


class RecoverySequence:
    """The recoveries of one goal, and of those that take over from it."""

    def __init__(self, runtime: Runtime, plugins: PluginTable) -> None:
        self._runtime = runtime
        self._plugins = plugins
        self._monitor = StuckMonitor(runtime, plugins)
        self._next = 0
        self._trigger = Trigger.NONE
        self._recovered_at: Pose | None = None

    def restart(self) -> None:
        """Forget everything, for a new goal."""
        self._start_list_again()
        self._monitor.restart(self._runtime.parameters.escalation_behaviors)

    def finish(self) -> None:
        """The goal is over."""
        self._monitor.finish()

    def note_failure(self, trigger: Trigger, outcome: int) -> None:
        """Remember what failed, and where."""
        self._trigger = trigger
        self._monitor.note_failure(outcome)

    def due_behavior(self, wanted: Sequence[str] | None) -> str:
        """Return the next one of the list; for a robot that is stuck, or after the list, that of the escalation.

        Empty if there is nothing left to try, or recoveries are switched off. ``wanted``: the goal's own list.
        """
        if not self._runtime.parameters.recovery_enabled:
            return ""
        behaviors = self._all_loaded() if wanted is None else list(wanted)
        if self._monitor.escalates or self._next >= len(behaviors):
            return self._monitor.next_behavior()
        self._next += 1
        return behaviors[self._next - 1]

    def note_end(self, behavior: str, outcome: int) -> None:
        """Remember how a behaviour ended, and where the robot is after it."""
        if self._monitor.note_recovery(behavior, outcome):
            self._start_list_again()
        try:
            self._recovered_at = self._runtime.robot.pose()
        except RobotStateError:  # the next plan reports the missing pose with its own text
            self._recovered_at = None

    def note_plan(self) -> None:
        """A plan was found: progress, if there was none before."""
        if self._trigger is Trigger.PLAN:
            self._start_list_again()

    def note_new_path(self, length: float, rest: float) -> str:
        """A path replaces the one that is driven; why that is one setback too many, see the monitor."""
        return self._monitor.note_new_path(length, rest)

    def note_motion(self, pose: Pose) -> None:
        """The robot follows a path: progress, once it is far enough from where it recovered."""
        if self._trigger in (Trigger.CONTROL, Trigger.OSCILLATION) and self._recovered_at is not None:
            if pose.distance_to(self._recovered_at) >= self._runtime.parameters.oscillation_distance:
                self._start_list_again()

    def described(self, failure: str) -> str:
        """Return the text of a failure with what was tried against it."""
        return self._monitor.described(failure)

    def _all_loaded(self) -> list[str]:
        for_meetings = behavior_for_meetings(self._runtime, self._plugins)
        kept_back = {*self._runtime.parameters.escalation_behaviors, for_meetings}
        return [name for name in self._plugins.names(PluginKind.RECOVERY) if name not in kept_back]

    def _start_list_again(self) -> None:
        self._next = 0
        self._trigger = Trigger.NONE
        self._recovered_at = None
