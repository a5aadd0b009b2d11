"""The time of numba's compiler at the first use of a kernel, which no patience and no hang guard counts.

``watch_compiler`` pauses a limit while a kernel is compiled on the thread of a call; ``record_compilations`` reports
every kernel to a user. ``kernel_cache`` connects this module to numba; here nothing is imported that takes time.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from mbf_abstract.time.clock import wall_seconds

Notice = Callable[[], None]


class _Watchers(threading.local):
    """What this thread does while it compiles: on start, on end."""

    def __init__(self) -> None:
        self.pairs: list[tuple[Notice, Notice]] = []


@dataclass
class Compiled:
    """What was compiled in a period of time: the names of the kernels, nested ones too, and how long it took.

    Attributes
    ----------
    kernels : list of str
        Without numba's own functions that they need.
    seconds : float
        Real time [s].
    kept : bool
        Whether the machine code of all of them is on disk now, so that the next process need not compile them.
    """

    kernels: list[str] = field(default_factory=list)
    seconds: float = 0.0
    kept: bool = True

    def __str__(self) -> str:
        count = len(set(self.kernels))  # some are compiled for several types
        where = "once, kept on disk" if self.kept else "and not kept for the next time"
        return f"kernels compiled {where}: {count} ({self.seconds:.1f} s)"


_watchers = _Watchers()
_listeners: list[tuple[Compiled, Callable[[str], None]]] = []


def watch_compiler(on_start: Notice, on_end: Notice) -> None:
    """Call ``on_start`` and ``on_end`` around all that is compiled on this thread, until ``unwatch_compiler``."""
    _watchers.pairs.append((on_start, on_end))


def unwatch_compiler() -> None:
    """End the watch that was begun last on this thread."""
    _watchers.pairs.pop()


@contextmanager
def record_compilations(report: Callable[[str], None]) -> Iterator[Compiled]:
    """Report the name of each kernel that is compiled, on any thread; yields the record of all."""
    listener = (Compiled(), report)
    _listeners.append(listener)
    try:
        yield listener[0]
    finally:
        _listeners.remove(listener)


class CompilerClock:
    """Notifies watchers and records when numba compiles: on one thread at a time, perhaps a kernel within another."""

    def __init__(self) -> None:
        self._depth = 0
        self._began = 0.0

    def start(self, kernel: str, kept: bool) -> None:
        """Note that a kernel is compiled from now on, on this thread, and whether the result is kept on disk."""
        for compiled, report in tuple(_listeners):
            if kernel.startswith("numba."):
                continue
            compiled.kernels.append(kernel)
            compiled.kept &= kept
            report(kernel)
        self._depth += 1
        if self._depth == 1:
            self._began = wall_seconds()
            for on_start, _ in _watchers.pairs:
                on_start()

    def end(self) -> None:
        """Note that it is done, or has failed."""
        self._depth -= 1
        if self._depth == 0:
            for _, on_end in _watchers.pairs:
                on_end()
            for compiled, _ in tuple(_listeners):
                compiled.seconds += wall_seconds() - self._began
