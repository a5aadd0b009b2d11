"""Time that numba's compiler takes at the first use of a kernel is nobody's: no patience and no hang guard counts it.

Who watches a call of foreign code says with ``watch_compiler`` what is to be done while a kernel is compiled on the
thread of that call. Who talks to a user hears of every kernel with ``told_of_kernels``. ``kernel_cache`` connects this
to numba; here nothing is imported that takes time.
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
    """What was compiled in a stretch of time: the names of the kernels, one within the other too, and how long it took.

    Attributes
    ----------
    kernels : list of str
        Without what numba compiles of its own for them.
    seconds : float
        Real time [s].
    kept : bool
        Whether the machine code of all of them is on disk now, so that the next process need not compile them.
    """

    kernels: list[str] = field(default_factory=list)
    seconds: float = 0.0
    kept: bool = True


_watchers = _Watchers()
_listeners: list[tuple[Compiled, Callable[[str], None]]] = []


def watch_compiler(on_start: Notice, on_end: Notice) -> None:
    """Call ``on_start`` and ``on_end`` around all that is compiled on this thread, until ``unwatch_compiler``."""
    _watchers.pairs.append((on_start, on_end))


def unwatch_compiler() -> None:
    """End the watch that was begun last on this thread."""
    _watchers.pairs.pop()


@contextmanager
def told_of_kernels(tell: Callable[[str], None]) -> Iterator[Compiled]:
    """Tell the name of each kernel that is compiled, on whatever thread; yields the sum of it."""
    listener = (Compiled(), tell)
    _listeners.append(listener)
    try:
        yield listener[0]
    finally:
        _listeners.remove(listener)


class CompilerClock:
    """Passes on when numba compiles; it does so on one thread at a time, perhaps a kernel within another one."""

    def __init__(self) -> None:
        self._depth = 0
        self._began = 0.0

    def start(self, kernel: str, kept: bool) -> None:
        """Say that a kernel is compiled from now on, on this thread, and whether the result is kept on disk."""
        for compiled, tell in tuple(_listeners):
            if kernel.startswith("numba."):
                continue
            compiled.kernels.append(kernel)
            compiled.kept &= kept
            tell(kernel)
        self._depth += 1
        if self._depth == 1:
            self._began = wall_seconds()
            for on_start, _ in _watchers.pairs:
                on_start()

    def end(self) -> None:
        """Say that it is done, or has failed."""
        self._depth -= 1
        if self._depth == 0:
            for _, on_end in _watchers.pairs:
                on_end()
            for compiled, _ in tuple(_listeners):
                compiled.seconds += wall_seconds() - self._began
