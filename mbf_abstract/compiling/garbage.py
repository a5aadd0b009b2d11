"""Python's garbage collector while numba compiles: it looks at new objects less often, and then as before.

A compilation makes some ten thousand objects per kernel and keeps most of them, so that of a cold start a sixth of the
CPU time was the collector's with Python's own threshold (decision 0086). It is never turned off: what is garbage in the
meantime is found, and memory does not grow.
"""

from __future__ import annotations

import gc

NEW_OBJECTS = 50_000
"""New objects between two collections while a kernel is compiled; Python's own number is 700."""


class PatientCollector:
    """The collector's threshold, higher from ``begin`` to ``end``; one that was higher still stays."""

    def __init__(self) -> None:
        self._usual: tuple[int, int, int] | None = None

    def begin(self) -> None:
        """Let more objects come together."""
        usual = gc.get_threshold()
        if 0 < usual[0] < NEW_OBJECTS:  # 0: it never collects
            self._usual = usual
            gc.set_threshold(NEW_OBJECTS, *usual[1:])

    def end(self) -> None:
        """Collect as before; a threshold that somebody has set in the meantime stays."""
        if self._usual is not None and gc.get_threshold()[0] == NEW_OBJECTS:
            gc.set_threshold(*self._usual)
        self._usual = None
