"""A plugin instance as the executions hold it: exclusive use, guarded calls, quarantine.

The same instance never runs twice at once: a second goal waits for it, as long as its own patience lasts.
"""

from __future__ import annotations

import numbers
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import PurePath
from typing import TYPE_CHECKING, Generic, Protocol, TypeVar

from mbf_abstract.event_values import error_text
from mbf_abstract.events import EventKind
from mbf_abstract.geometry import NonFiniteError
from mbf_abstract.plugins import Plugin
from mbf_abstract.time.clock import Priority, ThreadDetached

if TYPE_CHECKING:
    from mbf_abstract.config.configuration import PluginSpec
    from mbf_abstract.execution.runtime import Runtime


class Answer(Protocol):
    """What the results of all plugins have."""

    @property
    def outcome(self) -> int:
        """Outcome code."""

    @property
    def message(self) -> str:
        """Text, may be empty."""


P = TypeVar("P", bound=Plugin)
T = TypeVar("T")
A = TypeVar("A", bound=Answer)

MAX_OUTCOME = 2**32 - 1  # outcomes are unsigned integers of 32 bits in ``mbf_msgs``


class PluginFault(Exception):
    """A plugin raised, or returned something that is no result; the text names plugin, type and message."""


class PluginNonFinite(PluginFault):
    """A plugin made a pose, path or command that is not finite."""


class PluginGone(LookupError):
    """A plugin was unloaded between the acceptance of a goal and its use."""


class LoadedPlugin(Generic[P]):
    """One named plugin instance of a server."""

    def __init__(self, spec: PluginSpec, instance: P, runtime: Runtime) -> None:
        self.name = spec.name
        self.spec = spec
        self.instance = instance
        self.quarantined = ""
        self._runtime = runtime
        self._condition = runtime.clock.condition()
        self._user: object | None = None
        self._retired = False
        self._canceling = False
        self._cancel_for: tuple[object, int] | None = None

    @property
    def title(self) -> str:
        """Kind and name, for messages."""
        return f"{self.spec.kind.name.lower()} {self.name!r}"

    @property
    def user(self) -> str:
        """Who is using the instance, for messages."""
        return str(self._user)

    @property
    def in_use(self) -> bool:
        """Whether a goal is using the instance."""
        return self._user is not None

    def acquire(self, user: object, give_up: Callable[[], bool]) -> bool:
        """Wait for exclusive use; False once ``give_up()``, asked 20 times a second, says so.

        ``str(user)`` appears in the messages of those who wait meanwhile.

        Raises
        ------
        PluginGone
            The plugin was unloaded meanwhile.
        """
        with self._condition:
            while self._user is not None:
                if give_up():
                    return False
                self._condition.wait(0.05)
            if self._retired:
                raise PluginGone(f"plugin {self.name!r} was unloaded")
            self._user = user
            return True

    def release(self, user: object) -> None:
        """End the use by ``user`` (nobody else's) and lift a quarantine: the late call has come back."""
        with self._condition:
            if self._user is not user:
                return
            self._user = None
            if self.quarantined:
                self.quarantined = ""
                self._runtime.events.emit(EventKind.QUARANTINE, self.name, reason="ended: the late call came back")
            self._condition.notify_all()

    def quarantine(self, user: object, reason: str) -> None:
        """Mark the instance unavailable until the hung call by ``user`` returns; nothing if it just has."""
        with self._condition:
            if self._user is user:
                self.quarantined = reason
                self._runtime.events.emit(EventKind.QUARANTINE, self.name, reason=reason)

    def ask_to_cancel(self, user: object, goal_id: int) -> None:
        """Call the plugin's ``cancel`` for its present user on a thread of its own, since it may hang.

        While an earlier call has not come back no other is made beside it; it is made up for then, if still wanted.
        """
        with self._condition:
            if self._user is not user:
                return
            self._cancel_for = (user, goal_id)
            if self._canceling:
                return
            self._canceling = True
        self._runtime.clock.spawn(self._cancel, f"cancel {self.name}", Priority.WATCHDOG)

    def _cancel(self) -> None:
        while (goal_id := self._take_cancel()) is not None:
            try:
                with self._runtime.clock.guarded(f"{self.name}.cancel"):
                    self.instance.cancel()
            except ThreadDetached:
                continue  # it hung and came back late: what was asked for meanwhile is still to be done
            except BaseException as error:
                self.report(goal_id, "cancel", error)

    def _take_cancel(self) -> int | None:
        """Id of the goal whose cancel is to be passed on now; None = there is nothing left to do."""
        with self._condition:
            wanted, self._cancel_for = self._cancel_for, None
            if wanted is None or wanted[0] is not self._user:
                self._canceling = False
                return None
            return wanted[1]

    def retire(self) -> bool:
        """Forbid further use, for unloading; False while in use."""
        with self._condition:
            if self._user is not None:
                return False
            self._retired = True
            return True

    def call(self, goal_id: int, method: str, function: Callable[[], T], on_hang: Callable[[], None]) -> T:
        """Call into the plugin, guarded; exceptions become ``PluginFault`` and an event with the traceback."""
        clock = self._runtime.clock
        started = clock.now()
        try:
            with clock.guarded(f"{self.name}.{method}", on_hang):
                result = function()
                self._take_modelled_time(started)
                return result
        except ThreadDetached:
            raise
        except BaseException as error:  # sys.exit() in a plugin must end its goal, not the thread of its slot
            self.report(goal_id, method, error)
            fault = PluginNonFinite if isinstance(error, NonFiniteError) else PluginFault
            raise fault(
                f"plugin {self.name!r} raised {type(error).__name__} in {method}: {error_text(error)}"
            ) from error

    def _take_modelled_time(self, started: float) -> None:
        modelled = self.instance.modelled_compute_time
        if modelled > 0.0:
            self._runtime.clock.sleep_until(started + modelled)

    def report(self, goal_id: int, method: str, error: BaseException) -> None:
        """Record that the plugin raised, with where in its code it did."""
        frames = traceback.extract_tb(error.__traceback__)[-8:]
        self._runtime.events.emit(
            EventKind.FAULT,
            self.name,
            goal_id=goal_id,
            where=method,
            type=type(error).__name__,
            message=error_text(error),
            traceback=[f"{PurePath(frame.filename).name}:{frame.lineno} in {frame.name}" for frame in frames],
        )


def checked_answer(answer: object, expected: type[A], plugin: str, method: str) -> A:
    """Return a plugin's answer if it is a result that can be passed on; raises PluginFault if it is not."""
    if not isinstance(answer, expected):
        raise PluginFault(f"plugin {plugin!r} returned {type(answer).__name__} from {method}, not {expected.__name__}")
    outcome: object = answer.outcome
    message: object = answer.message
    problem = ""
    if isinstance(outcome, bool) or not isinstance(outcome, numbers.Integral):
        problem = f"an outcome of type {type(outcome).__name__}, not an integer"
    elif not 0 <= int(outcome) <= MAX_OUTCOME:
        problem = f"an outcome that is not within 0 and {MAX_OUTCOME}"  # may have too many digits to be printed
    elif not isinstance(message, str):
        problem = f"a message of type {type(message).__name__}, not str"
    if problem:
        raise PluginFault(f"plugin {plugin!r} returned {problem}, from {method}")
    return answer


@contextmanager
def plugin_events(runtime: Runtime, goal_id: int, plugin: str, method: str) -> Iterator[dict[str, object]]:
    """Emit start and end of one plugin call; fill the yielded dict with outcome and message."""
    outcome: dict[str, object] = {}
    runtime.events.emit(EventKind.PLUGIN_CALL_STARTED, plugin, goal_id=goal_id, method=method)
    try:
        yield outcome
    finally:
        runtime.events.emit(EventKind.PLUGIN_CALL_ENDED, plugin, goal_id=goal_id, method=method, **outcome)
