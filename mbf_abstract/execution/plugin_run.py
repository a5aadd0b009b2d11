"""One goal's use of one plugin: exclusive instance, patience, cancel with grace, and abandonment.

Patience runs from the start of the run (planner, recovery, refiner) or is restarted by progress (controller). When it
is exceeded, or the client cancels, the plugin's token is set and its ``cancel`` called. A plugin that is still inside
its call after ``cancel_grace`` more seconds is *abandoned*: the goal ends at once, the thread drains, and the
instance stays quarantined until the call returns. While the goal is paused, or numba compiles a kernel at its first
use, patience stands still. The same holds for calls of the robot's driver and of the map that are made beside the
plugin.

A call of the plugin passes one wrapper, ``PluginRun.call``: it is guarded against hanging, takes its modelled compute
time, and what it raises becomes a ``PluginFault``. ``ask`` also checks the answer.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Generic, TypeVar

from mbf_abstract.compiling.compilation import unwatch_compiler, watch_compiler
from mbf_abstract.event_values import error_text
from mbf_abstract.events import EventKind
from mbf_abstract.execution.loaded_plugin import LoadedPlugin
from mbf_abstract.execution.plugin_answer import A, PluginFault, PluginNonFinite, checked_answer, checked_flag
from mbf_abstract.execution.runtime import Runtime
from mbf_abstract.geometry import NonFiniteError
from mbf_abstract.goals.handle import AnyGoalHandle
from mbf_abstract.plugins import Plugin
from mbf_abstract.time.clock import TIME_RESOLUTION, Stopwatch, ThreadDetached

P = TypeVar("P", bound=Plugin)
T = TypeVar("T")

IDLE_CHECK = 1.0  # s; how often a run without a patience limit is looked at
SHORTEST_CHECK = 0.05  # s; how often one is whose patience is over, but that is not inside a call


class Abandoned(Exception):
    """The goal ended while this thread was inside a plugin call; the thread must unwind and end."""


class PluginRun(Generic[P]):
    """Supervises the calls that one goal makes into one plugin, and into driver and map beside it; a context manager.

    Parameters
    ----------
    patience : callable
        Answers the present limit [s]; 0 = none.
    on_abandon : callable
        Ends the goal of the run, its argument, when a call hangs; called once, on the supervisor's thread or on the
        one that comes back late.

    Attributes
    ----------
    suspect : str
        Who is being called, or was called last: the plugin, or a part of the driver or the map. For messages.
    waited : str
        How long this run waited for the plugin in vain, and who had it; empty if it got it.
    """

    def __init__(
        self,
        runtime: Runtime,
        plugin: LoadedPlugin[P],
        handle: AnyGoalHandle,
        patience: Callable[[], float],
        on_abandon: Callable[[PluginRun[P]], None],
    ) -> None:
        self.runtime = runtime
        self.plugin = plugin
        self.handle = handle
        self.patience_watch = Stopwatch(runtime.clock)
        self.patience_exceeded = False
        self.abandoned = False
        self.suspect = plugin.title
        self.waited = ""
        self._patience = patience
        self._on_abandon = on_abandon
        self._condition = runtime.clock.condition()
        self._over = False
        self._call_began: float | None = None
        self._stop_asked: float | None = None
        self._hung = False
        self._compiling = False

    def __enter__(self) -> PluginRun[P]:
        self._watch = self.runtime.supervisor.watch(self._check, self._patience() or IDLE_CHECK)
        self.adopt(self.handle)
        return self

    def __exit__(self, *exc: object) -> None:
        with self._condition:
            self._over = True  # from now on this run cannot be abandoned
        self.runtime.supervisor.stop(self._watch)
        self.plugin.release(self)
        self.runtime.hanging.discard(self)

    def __str__(self) -> str:
        return f"{self.handle.action} goal {self.handle.id}"

    def adopt(self, handle: AnyGoalHandle) -> None:
        """Serve ``handle`` from now on (plan update): its cancel is the one that counts."""
        with self._condition:
            self.handle = handle
            self._stop_asked = None  # a cancel of the goal before is none of this one
        handle.on_wake(lambda: self.runtime.supervisor.poke(self._watch))
        if handle.cancel_requested or handle.paused:  # before it could wake anybody
            self.runtime.supervisor.poke(self._watch)

    @property
    def why_given_up(self) -> str:
        """Text on a call that was abandoned without a cancel, without its subject."""
        if self._hung:
            limit = self.runtime.parameters.hang_guard
            return f"took more than {limit:g} s of real time while simulated time stood still (hang_guard)"
        return f"gave no answer within {self.patience:g} s and its grace"

    @property
    def canceled(self) -> bool:
        """Whether the client wants the goal to end."""
        return self.handle.cancel_requested

    @property
    def patience(self) -> float:
        """Present patience limit [s]; 0 = none."""
        return self._patience()

    def report_state(self, execution: str, old: str, new: str) -> None:
        """Record that an execution of this run has changed its state."""
        self.runtime.events.emit(EventKind.STATE_CHANGED, execution, goal_id=self.handle.id, old=old, new=new)

    def acquire_plugin(self) -> bool:
        """Get the instance for this run; False if canceled or out of patience before it was free."""
        if self.plugin.acquire(self, lambda: self.canceled or self.is_patience_over()):
            return True
        self.waited = f"waited {self.patience:g} s for {self.plugin.title}, which {self.plugin.user} uses"
        return False

    # --------------------------------------------------------------------------------------- the guarded call
    def call(self, method: str, function: Callable[[], T]) -> T:
        """Call into the plugin; raises PluginFault if it raises, Abandoned if the goal ended meanwhile."""
        plugin, clock = self.plugin, self.runtime.clock
        began = self._begin_call(plugin.title)
        watch_compiler(self._compiler_starts, self._compiler_ends)
        try:
            with clock.guarded(f"{plugin.name}.{method}", self._declare_hung):
                answer = function()
                if plugin.instance.modelled_compute_time > 0.0:
                    clock.sleep_until(began + plugin.instance.modelled_compute_time)
                return answer
        except ThreadDetached:
            raise
        except BaseException as error:  # sys.exit() in a plugin must end its goal, not the thread of its slot
            plugin.report(method, error, goal_id=self.handle.id)
            fault = PluginNonFinite if isinstance(error, NonFiniteError) else PluginFault
            text = f"plugin {plugin.name!r} raised {type(error).__name__} in {method}: {error_text(error)}"
            raise fault(text) from error
        finally:
            unwatch_compiler()
            self._end_call()

    def ask(self, method: str, function: Callable[[], object], expected: type[A]) -> A:
        """Call a main method and check its answer; raises as ``call``, also where the answer is no result."""
        return checked_answer(self.call(method, function), expected, self.plugin.name, method)

    def ask_whether(self, method: str, function: Callable[[], object]) -> bool:
        """Call a method that answers yes or no; raises as ``call``, also where the answer is neither."""
        return checked_flag(self.call(method, function), self.plugin.name, method)

    def ask_reported(self, method: str, function: Callable[[], object], expected: type[A]) -> A:
        """Do the same between two events, for methods that are not called many times a second."""
        emit = self.runtime.events.emit
        data: dict[str, object] = {"goal_id": self.handle.id, "method": method}
        emit(EventKind.PLUGIN_CALL_STARTED, self.plugin.name, **data)
        try:
            answer = self.ask(method, function, expected)
            data.update(outcome=int(answer.outcome), message=answer.message)
            return answer
        finally:
            emit(EventKind.PLUGIN_CALL_ENDED, self.plugin.name, **data)

    def call_beside(self, who: str, function: Callable[[], T]) -> T:
        """Call what is no plugin but may hang like one, the driver or the map; raises Abandoned as ``call`` does."""
        self._begin_call(who)
        try:
            with self.runtime.clock.guarded(who, self._declare_hung):
                return function()
        finally:
            self._end_call()

    @contextmanager
    def map_in_use(self) -> Iterator[None]:
        """Have the map kept alive for a plugin of this kind."""
        who, kept, hooks = "the map's using_map()", ExitStack(), self.runtime.map_hooks
        try:
            self.call_beside(who, lambda: kept.enter_context(hooks.using_map(self.plugin.spec.kind)))
        except Abandoned:  # it did come back, but late
            kept.close()
            raise
        try:
            yield
        finally:
            self.call_beside(who, kept.close)

    def _begin_call(self, who: str) -> float:
        self.suspect = who
        self._call_began = began = self.runtime.clock.now()
        return began

    def _end_call(self) -> None:
        """Note that a call has come back; raises Abandoned if that was too late."""
        if self._hung:
            self._abandon()  # the clock has given up on this thread, and the supervisor may not have seen it yet
        with self._condition:
            self._call_began = None
            abandoned = self.abandoned
        if abandoned:
            raise Abandoned(self.suspect)

    def is_patience_over(self) -> bool:
        """Whether the patience has run out, now or earlier."""
        limit = self._patience()
        if limit > 0.0 and self.patience_watch.elapsed > limit:
            self.patience_exceeded = True
        return self.patience_exceeded

    def _compiler_starts(self) -> None:
        self._compiling = True
        self.patience_watch.pause()

    def _compiler_ends(self) -> None:
        self._compiling = False
        self.runtime.supervisor.poke(self._watch)

    def _declare_hung(self) -> None:
        """Give up at once: the thread of the present call was detached from its clock."""
        self._hung = True
        self.runtime.supervisor.poke(self._watch)

    def _check(self) -> float | None:
        """Supervisor: stop the plugin when due, and give up on it after the grace."""
        if self._hung:
            return self._abandon()
        if self.handle.paused or self._compiling:
            self.patience_watch.pause()
        else:
            self.patience_watch.resume()
        began, handle, asked, is_first = self._consider_stop()
        if asked is None:
            return self._next_check()
        if is_first:
            self._ask_to_stop(handle)
        if began is None:
            return IDLE_CHECK
        grace_left = self.runtime.parameters.cancel_grace + max(began, asked) - self.runtime.clock.now()
        if grace_left > TIME_RESOLUTION:
            return grace_left
        return self._abandon(began)

    def _consider_stop(self) -> tuple[float | None, AnyGoalHandle, float | None, bool]:
        """Start of the present call, whose goal it is, when it was asked to stop, and whether that is to be done now.

        All of one moment: a plan update may exchange the goal at any time, and the new one must not pay for the old.
        """
        with self._condition:
            began, is_first = self._call_began, False
            if self._stop_asked is None and (self.canceled or (began is not None and self.is_patience_over())):
                self._stop_asked, is_first = self.runtime.clock.now(), True
            return began, self.handle, self._stop_asked, is_first

    def _next_check(self) -> float:
        """Seconds until the patience of the present call, or of one that begins soon, may be over."""
        limit = self._patience()
        if limit <= 0.0 or self.handle.paused or self._compiling:
            return IDLE_CHECK
        remaining = limit - self.patience_watch.elapsed
        if self._call_began is not None:
            return max(remaining, 0.0) + 1e-6
        return max(min(remaining, limit / 2.0), SHORTEST_CHECK)

    def _ask_to_stop(self, handle: AnyGoalHandle) -> None:
        handle.cancel_token.cancel("canceled" if handle.cancel_requested else "patience exceeded")
        overridden = type(self.plugin.instance).cancel is not Plugin.cancel
        if self._call_began is not None and overridden:
            self.plugin.ask_to_cancel(self, handle.id)

    def _abandon(self, began: float | None = None) -> float | None:
        """End the goal without its thread, unless the call has just come back; the answer to the supervisor.

        An instance that the thread is not inside of is free at once.

        Parameters
        ----------
        began : float, optional
            Start [s] of the call that is to be given up; one that began since then is spared.
        """
        with self._condition:
            if self.abandoned or self._over:
                return None
            if self._call_began is None or (began is not None and began != self._call_began):
                return SHORTEST_CHECK
            self.abandoned = True
            self.runtime.hanging.add(self)
        self.patience_exceeded = self.patience_exceeded or not self.canceled
        if self.suspect == self.plugin.title:
            self.plugin.quarantine(self, self._quarantine_reason())
        else:
            self.plugin.release(self)
        self._on_abandon(self)
        return None

    def _quarantine_reason(self) -> str:
        if self._hung:
            return f"it {self.why_given_up}"
        return "patience exceeded" if self.patience_exceeded else "did not end after a cancel"
