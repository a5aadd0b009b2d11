"""Stops the robots of this process when it ends: by the end of the program, an exception, SIGTERM or SIGHUP.

The two signals would end Python at once, and the robot would keep its last command. While a gate is watched they
stop the robot first and then raise ``SystemExit(128 + signal)`` in the main thread, so that ``with`` blocks and
``finally`` run as after Ctrl-C. A handler that the program has set itself is left alone, and so is a signal it ignores.

Nothing here can see SIGKILL, or a crash of the interpreter: against those the robot's driver needs a timeout of its
own.
"""

from __future__ import annotations

import atexit
import os
import signal
import threading
import weakref
from types import FrameType

from mbf_abstract.drive.velocity_gate import VelocityGate
from mbf_abstract.time.clock import Priority, WallClock

SIGNALS = tuple(signal.Signals[name] for name in ("SIGTERM", "SIGHUP") if name in signal.Signals.__members__)

_watches: set[ProcessEndWatch] = set()


class ProcessEndWatch:
    """Closes a gate when this process ends, without keeping it alive until then.

    Signals are caught by watches that are made on the main thread only: Python lets no other one set a handler.
    """

    def __init__(self, gate: VelocityGate) -> None:
        self._gate = weakref.ref(gate)
        self._process = os.getpid()
        atexit.register(self.stop_robot)
        _watches.add(self)
        _exchange_handlers(signal.SIG_DFL, _on_signal)

    @property
    def is_of_this_process(self) -> bool:
        """Whether the robot is this process's, not the one's from which it was forked."""
        return os.getpid() == self._process

    def stop_robot(self, reason: str = "the process ends") -> None:
        """Close the gate; a forked child must not touch its parent's robot."""
        gate = self._gate()
        if gate is not None and self.is_of_this_process:
            gate.close(reason)

    def end(self) -> None:
        """End the watch: the gate is closed. The last watch restores the signal handlers."""
        atexit.unregister(self.stop_robot)
        _watches.discard(self)
        if not _watches:
            _exchange_handlers(_on_signal, signal.SIG_DFL)


def _exchange_handlers(old: object, new: object) -> None:
    """Set ``new`` where ``old`` is the handler of a signal; only the main thread may."""
    if threading.current_thread() is threading.main_thread():
        for number in SIGNALS:
            if signal.getsignal(number) == old:
                signal.signal(number, new)  # type: ignore[arg-type]


def _on_signal(number: int, frame: FrameType | None) -> None:
    watches = [watch for watch in tuple(_watches) if watch.is_of_this_process]
    if not watches:  # a forked child: it ends as without this watch
        signal.signal(number, signal.SIG_DFL)
        os.kill(os.getpid(), number)
        return

    def stop_robots() -> None:
        for watch in watches:
            watch.stop_robot(f"the process got {signal.Signals(number).name}")

    # On a thread of its own: this one may hold the very lock that closing needs, and gives it back as it unwinds.
    WallClock().spawn(stop_robots, "stop at a signal", Priority.WATCHDOG)
    raise SystemExit(128 + number)
