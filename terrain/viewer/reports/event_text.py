"""Events as text: which of them a report must show, and one line for each."""

from __future__ import annotations

from mbf_abstract.events import Event, EventKind

NOTABLE = {
    EventKind.GOAL_REJECTED,
    EventKind.GOAL_CANCEL,
    EventKind.RECOVERY,
    EventKind.ROBOT_STOPPED,
    EventKind.COMMAND_DROPPED,
    EventKind.GATE_CLOSED,
    EventKind.FAULT,
    EventKind.QUARANTINE,
    EventKind.SINK_FAILED,
}
LEFT_OUT = ("traceback", "goal_id")


def event_text(event: Event) -> str:
    """Return the data of an event as ``key: value`` pairs."""
    return ", ".join(f"{key}: {value}" for key, value in event.data.items() if key not in LEFT_OUT)
