"""How much of the real clock a thread took by itself, which is what the hang guard of a simulated run counts.

A thread takes time while it runs and while it waits by its own choice. It takes none while it is ready to run and other
programs have the processor, nor while its whole process stands: stopped by a signal, or on a computer that sleeps. So
whether a call counts as hung does not depend on what else the machine has to do.

The waiting for a processor is known on Linux only. Elsewhere it counts as time that the thread took.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path


def seconds_without_processor(native_id: int) -> float:
    """How long [s] a thread of this process has waited for a processor in all; 0 where the system does not say.

    It is the second number of ``schedstat``, see sched-stats.rst of the Linux kernel.
    """
    try:
        return int(Path(f"/proc/self/task/{native_id}/schedstat").read_text(encoding="ascii").split()[1]) / 1e9
    except (OSError, IndexError, ValueError):
        return 0.0


class OwnTime:
    """Adds up, look by look, the time that one thread took for one piece of work.

    Parameters
    ----------
    now : callable
        Reads a clock that is never set back [s].
    without_processor : callable
        ``seconds_without_processor``, or another answer to the same question.
    """

    def __init__(
        self,
        now: Callable[[], float] = time.monotonic,
        without_processor: Callable[[int], float] = seconds_without_processor,
    ) -> None:
        self._now = now
        self._without_processor = without_processor
        self._work: tuple[int, int] | None = None
        self._looked_at = self._unserved = self._taken = 0.0

    def look(self, native_id: int, work: int, longest: float) -> float:
        """Count what has passed since the last look; the time [s] that the thread took since the first look.

        Parameters
        ----------
        native_id : int
            The system's number of the thread.
        work : int
            Number of the piece of its work; with another one, or another thread, the count begins anew.
        longest : float
            As much [s] counts at most for one look: if more has passed, nobody could look, for the process stood.
        """
        now, unserved = self._now(), self._without_processor(native_id)
        if self._work == (native_id, work):
            self._taken += min(now - self._looked_at, longest) - (unserved - self._unserved)
            self._taken = max(self._taken, 0.0)
        else:
            self._work, self._taken = (native_id, work), 0.0
        self._looked_at, self._unserved = now, unserved
        return self._taken
