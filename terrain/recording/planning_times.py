"""How long planners took, in wall time: it differs from run to run, so it is in timing.json and in no digest."""

from __future__ import annotations

import numpy as np

from mbf_abstract.events import Event, EventKind, EventSink
from mbf_abstract.time.clock import wall_seconds


class PlanningTimes(EventSink):
    """A sink of a run's events that takes the wall time of every call of a planner.

    In simulated time nothing else runs during a call; in real time the calls share the CPU with the rest.
    """

    def __init__(self) -> None:
        self._began: dict[tuple[str, object], float] = {}
        self._seconds: list[float] = []

    def write(self, event: Event) -> None:
        """Note when a call begins, and how long it took when it ends."""
        if event.data.get("method") != "make_plan":
            return
        call = (event.source, event.data.get("goal_id"))
        if event.kind is EventKind.PLUGIN_CALL_STARTED:
            self._began[call] = wall_seconds()
        elif event.kind is EventKind.PLUGIN_CALL_ENDED and call in self._began:
            self._seconds.append(wall_seconds() - self._began.pop(call))

    def to_json(self) -> dict[str, float | None]:
        """Median, 95th percentile and maximum [ms] for timing.json; None where nothing was planned."""
        names = ("planning_wall_median_ms", "planning_wall_p95_ms", "planning_wall_max_ms")
        if not self._seconds:
            return dict.fromkeys(names)
        values = 1000.0 * np.percentile(self._seconds, [50.0, 95.0, 100.0])
        return {name: round(value, 3) for name, value in zip(names, values.tolist(), strict=True)}
