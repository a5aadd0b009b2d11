"""Events as text: which of them a report shows, and one line for each, with a colour for good and bad."""

from __future__ import annotations

from dataclasses import dataclass

from mbf_abstract.events import Event, EventKind
from mbf_abstract.outcomes import is_success, outcome_name
from terrain.viewer.pictures.colours import BAD, GOOD, NEITHER

NOTABLE = {
    EventKind.GOAL_REJECTED,
    EventKind.GOAL_CANCEL,
    EventKind.RECOVERY,
    EventKind.STUCK,
    EventKind.ROBOT_STOPPED,
    EventKind.COMMAND_DROPPED,
    EventKind.GATE_CLOSED,
    EventKind.FAULT,
    EventKind.QUARANTINE,
    EventKind.SINK_FAILED,
}
LEFT_OUT = ("traceback", "goal_id")
SHOWN = NOTABLE | {EventKind.GOAL_FINISHED, EventKind.GOAL_PAUSED, EventKind.GOAL_RESUMED, EventKind.CUSTOM}
REPLACED = "preempted by a new plan"  # message of exe_path's goal when the robot continues on a newer path


def event_text(event: Event) -> str:
    """Return the data of an event as ``key: value`` pairs."""
    return ", ".join(f"{key}: {value}" for key, value in event.data.items() if key not in LEFT_OUT)


@dataclass(frozen=True)
class Line:
    """One event: time [s], source, text, and whether it is good (None = neither)."""

    time: float
    source: str
    text: str
    good: bool | None = None

    @property
    def colour(self) -> str:
        """Green, red or grey, for CSS."""
        return NEITHER if self.good is None else (GOOD if self.good else BAD)


def is_shown(event: Event) -> bool:
    """Whether a page lists the event; replacements of a path by a newer one are left out."""
    return event.kind in SHOWN and event.data.get("message") != REPLACED


def line_of(event: Event) -> Line:
    """Return the line of an event."""
    if event.kind is EventKind.GOAL_FINISHED:
        outcome = event.data.get("outcome")
        code = outcome if isinstance(outcome, int) else 0
        name = outcome_name(code)
        good = None if name == "CANCELED" else is_success(code)
        return Line(event.time, event.source, f"{name}: {event.data.get('message', '')}", good)
    what = "" if event.kind is EventKind.CUSTOM else event.kind.value.replace("_", " ")
    text = " ".join(part for part in (what, event_text(event)) if part)
    return Line(event.time, event.source, text, False if event.kind is EventKind.FAULT else None)
