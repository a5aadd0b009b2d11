"""Computes the numbers of the table from the event log of a run; nothing is counted anywhere else.

Planner calls and recoveries come from the framework's events around every plugin call, hand-overs and control cycles
from ``CountedController``, motion and contacts from the environment. Each moment of a leg counts as the first of four
activities that applies: *recovering* (a behaviour runs), *driving* (the robot moves), *planning* (the main planner
works while the robot stands), *waiting* (the rest).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field

from mbf_abstract.events import Event, EventKind
from mbf_abstract.outcomes import is_success

MAIN, SECOND = "main", "second"
USELESS_WITHIN = 5.0  # s; a recovery followed by the failure it was called for in this time was useless
ACTIVITIES = ("planning", "driving", "recovering", "waiting")


@dataclass
class Leg:
    """One leg: its end (``reached``, ``aborted``, ``timed_out``), time [s], distance [m] and its split of time [s]."""

    end: str = ""
    time: float = 0.0
    distance: float = 0.0
    split: dict[str, float] = field(default_factory=lambda: dict.fromkeys(ACTIVITIES, 0.0))
    message: str = ""


@dataclass
class Tally:
    """What happened in a run.

    Attributes
    ----------
    planner_calls : dict
        ``main_ok``, ``main_failed``, ``second_ok``, ``second_failed``.
    controller_calls : int
        Plans handed over to the controller.
    recoveries : dict of str to int
        Calls of each behaviour.
    useless : int
        Recoveries after which the same failure came back within 5 s.
    contacts : dict of str to int
        ``rack/we``, ``robot/we``, ``robot/they``: what was touched and who moved.
    """

    planner_calls: dict[str, int] = field(default_factory=dict)
    controller_calls: int = 0
    control_cycles: int = 0
    recoveries: dict[str, int] = field(default_factory=dict)
    useless: int = 0
    contacts: dict[str, int] = field(default_factory=dict)
    legs: list[Leg] = field(default_factory=list)

    @property
    def all_planner_calls(self) -> int:
        """Calls of both planners."""
        return sum(self.planner_calls.values())

    @property
    def all_recoveries(self) -> int:
        """Calls of all behaviours."""
        return sum(self.recoveries.values())

    @property
    def time(self) -> float:
        """Sum over the legs [s]."""
        return sum(leg.time for leg in self.legs)

    @property
    def legs_lost(self) -> int:
        """Legs that were aborted or ran out of time."""
        return sum(leg.end != "reached" for leg in self.legs)

    @property
    def all_contacts(self) -> int:
        """All contacts."""
        return sum(self.contacts.values())


def count(events: Iterable[Event]) -> Tally:
    """Read a log from its first to its last event."""
    counter = _Counter()
    for event in events:
        counter.read(event)
    return counter.tally


class _Counter:
    """Reads events in their order."""

    def __init__(self) -> None:
        self.tally = Tally()
        self._leg: Leg | None = None
        self._leg_start = self._last = 0.0
        self._moves = False
        self._running: Counter[str] = Counter()  # calls under way: recoveries, and the main planner's
        self._failure = ""  # the last failure of planning or driving
        self._recovered: tuple[str, float] | None = None  # what the last recovery was called for, and its end

    def read(self, event: Event) -> None:
        """Take in one event."""
        self._pass_time(event.time)
        data = event.data
        if event.kind is EventKind.PLUGIN_CALL_STARTED:
            self._running[_activity(event)] += 1
        elif event.kind is EventKind.PLUGIN_CALL_ENDED:
            self._running[_activity(event)] -= 1
            self._call_ended(event)
        elif event.kind is EventKind.GOAL_FINISHED and event.source == "exe_path":
            self._note_outcome("driving", int(str(data["outcome"])), event.time)
        elif event.kind is EventKind.CUSTOM and event.source == "table1":
            self._read_own(event)

    def _read_own(self, event: Event) -> None:
        data, what = event.data, event.data["what"]
        if what == "set_plan":
            self.tally.controller_calls += 1
        elif what == "cycle":
            self.tally.control_cycles += 1
        elif what == "motion":
            self._moves = bool(data["moves"])
        elif what == "contact":
            key = f"{data['touched']}/{data['moved']}"
            self.tally.contacts[key] = self.tally.contacts.get(key, 0) + 1
        elif what == "leg_started":
            self._leg, self._leg_start, self._failure, self._recovered = Leg(), event.time, "", None
        elif what == "leg_ended" and self._leg is not None:
            leg, self._leg = self._leg, None
            leg.end, leg.time = str(data["end"]), event.time - self._leg_start
            leg.distance, leg.message = float(str(data["distance"])), str(data["message"])
            self.tally.legs.append(leg)

    def _call_ended(self, event: Event) -> None:
        method, plugin = event.data["method"], event.source
        if method == "make_plan":
            outcome = int(str(event.data.get("outcome", -1)))
            key = f"{SECOND if plugin == SECOND else MAIN}_{'ok' if is_success(outcome) else 'failed'}"
            self.tally.planner_calls[key] = self.tally.planner_calls.get(key, 0) + 1
            if plugin != SECOND:
                self._note_outcome("planning", outcome, event.time)
        elif method == "run_behavior":
            self.tally.recoveries[plugin] = self.tally.recoveries.get(plugin, 0) + 1
            self._recovered = (self._failure, event.time)

    def _note_outcome(self, of: str, outcome: int, now: float) -> None:
        """Remember a failure; the first one after a recovery shows whether that was useless."""
        if is_success(outcome):
            return
        self._failure = f"{of} {outcome}"
        if self._recovered is not None:
            failure, ended = self._recovered
            if failure == self._failure and now - ended <= USELESS_WITHIN:
                self.tally.useless += 1
            self._recovered = None

    def _pass_time(self, now: float) -> None:
        """Give the time since the last event to what the robot did in it."""
        passed, self._last = now - self._last, now
        if self._leg is None or passed <= 0.0:
            return
        if self._running["recovering"] > 0:
            activity = "recovering"
        elif self._moves:
            activity = "driving"
        elif self._running["planning"] > 0:
            activity = "planning"
        else:
            activity = "waiting"
        self._leg.split[activity] += passed


def _activity(event: Event) -> str:
    """What a plugin call counts as while it runs; empty for what does not matter."""
    if event.data["method"] == "run_behavior":
        return "recovering"
    return "planning" if event.data["method"] == "make_plan" and event.source != SECOND else ""
