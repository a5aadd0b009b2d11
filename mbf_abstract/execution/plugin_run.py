"""One goal's use of one plugin: exclusive instance, patience, cancel with grace, and abandonment.

Patience runs from the start of the run (planner, recovery, refiner) or is restarted by progress (controller). When it
is exceeded, or the client cancels, the plugin's token is set and its ``cancel`` called. A plugin that is still inside
its call after ``cancel_grace`` more seconds is *abandoned*: the goal ends at once, the thread drains, and the
instance stays quarantined until the call returns. While the goal is paused its patience stands still.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import count
from typing import Generic, TypeVar

from mbf_abstract.actions.handle import AnyGoalHandle
from mbf_abstract.clock import Priority, Stopwatch, ThreadDetached
from mbf_abstract.execution.loaded_plugin import LoadedPlugin
from mbf_abstract.execution.runtime import Runtime
from mbf_abstract.plugins import Plugin

P = TypeVar("P", bound=Plugin)
T = TypeVar("T")

IDLE_CHECK = 1.0  # s; how often a run without a patience limit is looked at
SHORTEST_CHECK = 0.05  # s; how often one is whose patience is over, but that is not inside a call
_call_numbers = count(1)  # unique in the process: servers on one clock hear of each other's hung calls


class Abandoned(Exception):
    """The goal ended while this thread was inside a plugin call; the thread must unwind and end."""


class PluginRun(Generic[P]):
    """Supervises the calls that one goal makes into one plugin; used as a context manager.

    Parameters
    ----------
    patience : callable
        Answers the present limit [s]; 0 = none.
    on_abandon : callable
        Ends the goal when the plugin hangs; called on the supervisor's thread.
    """

    def __init__(
        self,
        runtime: Runtime,
        plugin: LoadedPlugin[P],
        handle: AnyGoalHandle,
        patience: Callable[[], float],
        on_abandon: Callable[[], None],
    ) -> None:
        self.runtime = runtime
        self.plugin = plugin
        self.handle = handle
        self.patience_watch = Stopwatch(runtime.clock)
        self.patience_exceeded = False
        self.abandoned = False
        self._patience = patience
        self._on_abandon = on_abandon
        self._call_began: float | None = None
        self._call_label = ""
        self._stop_asked: float | None = None
        self._hung = False

    def __enter__(self) -> PluginRun[P]:
        self._watch = self.runtime.supervisor.watch(self._check, self._patience() or IDLE_CHECK)
        self.runtime.runs.add(self)
        self.adopt(self.handle)
        return self

    def __exit__(self, *exc: object) -> None:
        self.runtime.runs.discard(self)
        self.runtime.supervisor.stop(self._watch)
        self.plugin.release(self)
        if self.abandoned:
            self.runtime.quarantined -= 1

    def adopt(self, handle: AnyGoalHandle) -> None:
        """Serve ``handle`` from now on (plan update): its cancel is the one that counts."""
        self.handle = handle
        self._stop_asked = None  # a cancel of the goal before is none of this one
        handle.on_wake(lambda: self.runtime.supervisor.poke(self._watch))
        self.runtime.supervisor.poke(self._watch)

    @property
    def canceled(self) -> bool:
        """Whether the client wants the goal to end."""
        return self.handle.cancel_requested

    @property
    def patience(self) -> float:
        """Present patience limit [s]; 0 = none."""
        return self._patience()

    def acquire_plugin(self) -> bool:
        """Get the instance for this run; False if canceled or out of patience before it was free."""
        return self.plugin.acquire(self, lambda: self.canceled or self.is_patience_over())

    def call(self, method: str, function: Callable[[], T]) -> T:
        """Call into the plugin; raises PluginFault if it raises, Abandoned if the goal ended meanwhile."""
        self._call_label = label = f"call {next(_call_numbers)}: {self.plugin.name}.{method}"
        self._call_began = self.runtime.clock.now()
        try:
            return self.plugin.call(self.handle.id, method, function, label)
        finally:
            self._call_began = None
            if self.abandoned and not self._hung:
                raise Abandoned(self.plugin.name)

    def is_patience_over(self) -> bool:
        """Whether the patience has run out, now or earlier."""
        limit = self._patience()
        if limit > 0.0 and self.patience_watch.elapsed > limit:
            self.patience_exceeded = True
        return self.patience_exceeded

    def declare_hung(self, label: str) -> None:
        """Give up at once if the hung section is this run's call: its thread was detached from the clock."""
        if self._call_began is not None and label == self._call_label:
            self._hung = True
            self.runtime.supervisor.poke(self._watch)

    def _check(self) -> float | None:
        """Supervisor: stop the plugin when due, and give up on it after the grace."""
        if self._hung:
            self.patience_exceeded = not self.canceled
            self._abandon()
            return None
        if self.handle.paused:
            self.patience_watch.pause()
        else:
            self.patience_watch.resume()
        began = self._call_began
        if self._stop_asked is None:
            if not (self.canceled or (began is not None and self.is_patience_over())):
                return self._next_check()
            self._stop_asked = self.runtime.clock.now()
            self._ask_to_stop("canceled" if self.canceled else "patience exceeded")
        if began is None:
            return IDLE_CHECK
        grace_left = self.runtime.parameters.cancel_grace + max(began, self._stop_asked) - self.runtime.clock.now()
        if grace_left > 1e-9:
            return grace_left
        self._abandon()
        return None

    def _next_check(self) -> float:
        """Seconds until the patience of the present call, or of one that begins soon, may be over."""
        limit = self._patience()
        if limit <= 0.0 or self.handle.paused:
            return IDLE_CHECK
        remaining = limit - self.patience_watch.elapsed
        if self._call_began is not None:
            return max(remaining, 0.0) + 1e-6
        return max(min(remaining, limit / 2.0), SHORTEST_CHECK)

    def _ask_to_stop(self, reason: str) -> None:
        self.handle.cancel_token.cancel(reason)
        overridden = type(self.plugin.instance).cancel is not Plugin.cancel
        if self._call_began is not None and overridden:  # it may hang or raise: not on this thread
            self.runtime.clock.spawn(self._cancel_plugin, f"cancel {self.plugin.name}", Priority.WATCHDOG)

    def _cancel_plugin(self) -> None:
        try:
            with self.runtime.clock.guarded(f"{self.plugin.name}.cancel"):
                self.plugin.instance.cancel()
        except ThreadDetached:
            raise
        except BaseException as error:
            self.plugin.report(self.handle.id, "cancel", error)

    def _abandon(self) -> None:
        if self.abandoned:
            return
        self.abandoned = True
        self.runtime.quarantined += 1
        self.runtime.runs.discard(self)
        self.plugin.quarantine("patience exceeded" if self.patience_exceeded else "did not end after a cancel")
        self._on_abandon()
