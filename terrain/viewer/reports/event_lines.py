"""Events as text: which of them a report shows, and one line for each, with a colour for good and bad."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from mbf_abstract.events import Event, EventKind
from mbf_abstract.outcomes import is_success, outcome_name, outcome_text
from terrain.viewer.pictures.colours import BAD, GOOD, NEITHER, WARNING

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
    EventKind.INCIDENT,
}
FAULTS = {EventKind.FAULT, EventKind.QUARANTINE, EventKind.SINK_FAILED}
LEFT_OUT = ("traceback", "goal_id")
SENTENCES = ("message", "reason")
WHOLE = {EventKind.STUCK: "message", EventKind.RECOVERY: "plugin"}
"""Events of which one value says it all."""
SHOWN = NOTABLE | {EventKind.GOAL_FINISHED, EventKind.GOAL_PAUSED, EventKind.GOAL_RESUMED, EventKind.CUSTOM}
UNNAMED = {EventKind.CUSTOM, EventKind.INCIDENT, EventKind.STUCK}
"""Events whose text says what they are."""
REPLACED = "preempted by a new plan"  # message of exe_path's goal when the robot continues on a newer path


def event_text(event: Event) -> str:
    """Return what an event says: its sentence where it has one, and the rest of its data as ``key: value`` pairs.

    The pairs are sorted, for a recording that was saved and read again has the fields of its events sorted.
    """
    if event.kind is EventKind.INCIDENT:
        return _incident_text(event.data)
    data = {key: value for key, value in event.data.items() if key not in LEFT_OUT}
    if event.kind in WHOLE:
        return str(data.get(WHOLE[event.kind], ""))
    sentence = next((str(data.pop(key)) for key in SENTENCES if data.get(key)), "")
    pairs = ", ".join(f"{key}: {value}" for key, value in sorted(data.items()) if value != "")
    return f"{sentence} ({pairs})" if sentence and pairs else sentence or pairs


def _incident_text(data: Mapping[str, Any]) -> str:
    """What happened where, who moved and how fast."""
    what = str(data["what"]).replace("_", " ")
    text = f"{what} at ({data['x']:.1f}, {data['y']:.1f}), robot {data['robot_speed']:.2f} m/s"
    if "other" in data:
        text += f", {data['other']} {data['other_speed']:.2f} m/s, gap {data['gap']:.2f} m"
    return text + (f", moved: {data['moved']}" if "moved" in data else "")


@dataclass(frozen=True)
class Line:
    """One event: time [s], source, text, and its colour, for CSS."""

    time: float
    source: str
    text: str
    colour: str = NEITHER


def is_shown(event: Event) -> bool:
    """Whether a page lists the event; replacements of a path by a newer one are left out."""
    return event.kind in SHOWN and event.data.get("message") != REPLACED


def line_of(event: Event) -> Line:
    """Return the line of an event."""
    if event.kind is EventKind.GOAL_FINISHED:
        outcome = event.data.get("outcome")
        code = outcome if isinstance(outcome, int) else 0
        colour = NEITHER if outcome_name(code) == "CANCELED" else GOOD if is_success(code) else BAD
        return Line(event.time, event.source, outcome_text(code, str(event.data.get("message", ""))), colour)
    what = "" if event.kind in UNNAMED else event.kind.value.replace("_", " ")
    text = ": ".join(part for part in (what, event_text(event)) if part)
    return Line(event.time, event.source, text, colour_of(event))


def colour_of(event: Event) -> str:
    """Return red for a fault and for what fails a run, amber for other incidents, else grey."""
    if event.kind is EventKind.INCIDENT:
        contact = str(event.data["what"]).startswith("collision") and event.data["moved"] in ("robot", "both")
        return BAD if contact or event.data["what"] == "tipped_over" else WARNING
    return BAD if event.kind in FAULTS else NEITHER
