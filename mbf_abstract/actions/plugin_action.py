"""What the four actions share that serve a goal with one plugin: its supervised run, and the end of one that hangs."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from typing import ClassVar, Generic

from mbf_abstract.actions.action import Action, F, G, GoalJob, R
from mbf_abstract.execution.loaded_plugin import LoadedPlugin
from mbf_abstract.execution.plugin_run import P, PluginRun
from mbf_abstract.execution.runtime import Runtime
from mbf_abstract.plugins import PluginKind
from mbf_abstract.server.plugin_table import PluginTable


def no_motion(reason: str) -> None:
    """Stop the robot for an action that does not move it."""


class PluginAction(Action[G, R, F], Generic[G, R, F, P]):
    """An action whose goals are each served by one plugin.

    Attributes
    ----------
    patience_outcome : int
        Of a goal whose plugin, driver or map did not come back within patience and grace.
    """

    kind: ClassVar[PluginKind]
    patience_outcome: ClassVar[int]

    def __init__(self, runtime: Runtime, plugins: PluginTable) -> None:
        super().__init__(runtime)
        self._plugins = plugins

    @property
    @abstractmethod
    def patience(self) -> float:
        """Present patience [s]; 0 = no limit."""

    @abstractmethod
    def _plugin_name(self, goal: G) -> str:
        """Name of the plugin that the goal asks for; empty = the first one loaded."""

    def _problem(self, goal: G) -> tuple[int, str] | None:
        """Reason to reject a goal whose plugin is there: (outcome, message), or None to accept it."""
        return None

    def _check(self, goal: G) -> tuple[int, str] | None:
        """1. Accept only a plugin that is loaded and available, and what the action can work with."""
        problem = self._plugins.problem(self.kind, self._plugin_name(goal))
        return (self.invalid_plugin_outcome, problem) if problem else self._problem(goal)

    def _plugin(self, job: GoalJob[G, R, F]) -> LoadedPlugin[P]:
        """The plugin of an accepted goal; raises PluginGone if it was unloaded since."""
        plugin: LoadedPlugin[P] = self._plugins.get(self.kind, self._plugin_name(job.handle.goal))
        return plugin

    def _supervise(
        self,
        job: GoalJob[G, R, F],
        plugin: LoadedPlugin[P],
        stop_robot: Callable[[str], None] = no_motion,
        patience: Callable[[], float] | None = None,
    ) -> PluginRun[P]:
        """Supervise the plugin for a goal; ``stop_robot`` is called with the reason before a goal ends that hangs.

        ``patience`` answers that of this run [s], if it is not the action's.
        """

        def end(run: PluginRun[P]) -> None:
            stop_robot(f"{run.suspect} hangs")
            job.end_take_over()
            if job.handle.cancel_requested:
                text = f"{job.handle.cancel_reason}; {run.suspect} has not ended yet"
                job.abandon(self.canceled_outcome, text)
            else:
                text = f"{run.suspect} {run.why_given_up}"
                job.abandon(self.patience_outcome, text)

        return PluginRun(self.runtime, plugin, job.handle, patience or (lambda: self.patience), end)
