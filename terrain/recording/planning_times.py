"""How long planners took. Wall time differs from run to run, so it is in timing.json and in no digest."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mbf_abstract.events import Event, EventKind, EventSink
from mbf_abstract.time.clock import wall_seconds


class PlanningTimes(EventSink):
    """A sink of a run's events that takes the time of every call of a planner that ends.

    In simulated time nothing else runs during a call; in real time the calls share the CPU with the rest.

    Parameters
    ----------
    time_of : callable, optional
        Time [s] of an event; the wall time at which it comes if not given.

    Attributes
    ----------
    seconds : list of float
        How long the calls took, in the order of their ends.
    """

    def __init__(self, time_of: Callable[[Event], float] = lambda event: wall_seconds()) -> None:
        self.seconds: list[float] = []
        self._time_of = time_of
        self._began: dict[tuple[str, object], float] = {}

    def write(self, event: Event) -> None:
        """Note when a call begins, and how long it took when it ends."""
        if event.data.get("method") != "make_plan":
            return
        call = (event.source, event.data.get("goal_id"))
        if event.kind is EventKind.PLUGIN_CALL_STARTED:
            self._began[call] = self._time_of(event)
        elif event.kind is EventKind.PLUGIN_CALL_ENDED and call in self._began:
            self.seconds.append(self._time_of(event) - self._began.pop(call))

    def to_json(self) -> dict[str, float | None]:
        """Median, 95th percentile and maximum [ms], as timing.json names them; None where nothing was planned."""
        names = ("planning_wall_median_ms", "planning_wall_p95_ms", "planning_wall_max_ms")
        if not self.seconds:
            return dict.fromkeys(names)
        values = 1000.0 * np.percentile(self.seconds, [50.0, 95.0, 100.0])
        return {name: round(value, 3) for name, value in zip(names, values.tolist(), strict=True)}
