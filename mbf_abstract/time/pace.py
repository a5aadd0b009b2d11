"""Lets simulated time pass no faster than real time, or another speed, for runs that somebody watches or drives."""

from __future__ import annotations

from mbf_abstract.time.clock import Clock

MAX_LAG = 0.5  # s behind the wall clock that are caught up at most


class Pace:
    """Waits on a wall clock, with the whole simulation waiting too, until simulated time may go on.

    Parameters
    ----------
    wall : Clock
        Real time; a simulated clock in tests.
    """

    def __init__(self, wall: Clock) -> None:
        self._wall = wall
        self._stamp = 0.0  # wall time [s] of the last step
        self._time = 0.0  # simulated time [s] of that step

    def wait(self, time: float, speed: float) -> None:
        """Wait until simulated time ``time`` [s] is due at ``speed`` simulated seconds per second; 0 = no wait."""
        due = self._stamp + (time - self._time) / speed if speed > 0.0 else self._wall.now()
        self._wall.sleep_until(due)
        self._stamp, self._time = max(due, self._wall.now() - MAX_LAG), time
