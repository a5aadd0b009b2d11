"""A plugin instance of a server: exclusive use, cancel from another thread, quarantine.

The same instance never runs twice at once: a second goal waits for it, as long as its own patience lasts.
Calls of its main methods go through ``plugin_run``.
"""

from __future__ import annotations

import traceback
from collections.abc import Callable
from pathlib import PurePath
from typing import TYPE_CHECKING, Generic, TypeVar

from mbf_abstract.event_values import error_text
from mbf_abstract.events import EventKind
from mbf_abstract.plugins import Plugin
from mbf_abstract.time.clock import Priority, ThreadDetached

if TYPE_CHECKING:
    from mbf_abstract.config.configuration import PluginSpec
    from mbf_abstract.execution.runtime import Runtime

P = TypeVar("P", bound=Plugin)


class PluginGone(LookupError):
    """A plugin was unloaded between the acceptance of a goal and its use."""


class LoadedPlugin(Generic[P]):
    """One named plugin instance of a server.

    Attributes
    ----------
    title : str
        Kind and name, for messages.
    quarantined : str
        Why the instance is not available; empty if it is.
    """

    def __init__(self, spec: PluginSpec, instance: P, runtime: Runtime) -> None:
        self.name = spec.name
        self.title = f"{spec.kind.name.lower()} {spec.name!r}"
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
    def user(self) -> str:
        """Who is using the instance, for messages."""
        return str(self._user)

    @property
    def in_use(self) -> bool:
        """Whether somebody is using the instance."""
        return self._user is not None

    def acquire(self, user: object, give_up: Callable[[], bool]) -> bool:
        """Wait for exclusive use; False once ``give_up()``, asked 20 times a second, is true.

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
        """End the use by ``user``, no other, and lift a quarantine: the late call has come back."""
        with self._condition:
            if self._user is not user:
                return
            self._user = None
            if self.quarantined:
                self.quarantined = ""
                self._runtime.events.emit(EventKind.QUARANTINE, self.name, reason="ended: the late call returned")
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
                self.report("cancel", error, goal_id=goal_id)

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

    def report(self, method: str, error: BaseException, **of_goal: int) -> None:
        """Record that the plugin raised, and where in its code; ``of_goal`` is ``goal_id`` where there is one."""
        frames = traceback.extract_tb(error.__traceback__)[-8:]
        self._runtime.events.emit(
            EventKind.FAULT,
            self.name,
            **of_goal,
            where=method,
            type=type(error).__name__,
            message=error_text(error),
            traceback=[f"{PurePath(frame.filename).name}:{frame.lineno} in {frame.name}" for frame in frames],
        )
