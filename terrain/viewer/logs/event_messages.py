"""Messages of a run before they are made; those of its events.

Events are lines of the log, as they are in events.jsonl, and change the state of an action.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from foxglove_schemas_protobuf.Log_pb2 import Log

from mbf_abstract.events import Event, EventKind
from mbf_abstract.outcomes import is_success, outcome_name
from terrain.viewer.logs import foxglove_messages as message
from terrain.viewer.reports.event_lines import NOTABLE, event_text
from terrain.viewer.reports.timeline import ACTIONS


@dataclass(frozen=True, eq=False)
class Stamped:
    """A message that has not been made yet: much of a live run is looked at by nobody.

    Attributes
    ----------
    time : float
        [s] of the run.
    make : callable
        Returns the protobuf message or the ``JsonMessage``.
    part : str, optional
        Which part of the present state it shows, so that one who comes later needs the newest message of each part;
        None of messages that only matter at their time.
    """

    time: float
    topic: str
    make: Callable[[], Any]
    part: str | None = None


ERRORS = {EventKind.FAULT, EventKind.QUARANTINE, EventKind.SINK_FAILED}
DETAILS = {EventKind.STATE_CHANGED, EventKind.PLUGIN_CALL_STARTED, EventKind.PLUGIN_CALL_ENDED}


@dataclass(frozen=True)
class JsonMessage:
    """A message of a schema of our own: ``values`` are written as JSON."""

    schema: str
    values: Mapping[str, Any]


class ActionStates:
    """What every action does: idle, active, or the outcome of its last goal.

    Attributes
    ----------
    states : dict of str to str
        By action; another one after each change.
    """

    def __init__(self) -> None:
        self.states: dict[str, str] = dict.fromkeys(ACTIONS, "idle")
        self._newest: dict[str, Any] = {}

    def take(self, event: Event) -> bool:
        """Take the next event; returns whether it has changed a state."""
        action, goal = event.source, event.data.get("goal_id")
        if action not in self.states:
            return False
        if event.kind is EventKind.GOAL_ACCEPTED:
            state, self._newest[action] = "active", goal
        elif event.kind is EventKind.GOAL_FINISHED and goal == self._newest.get(action):
            code = event.data.get("outcome")
            state = outcome_name(code) if isinstance(code, int) else "finished"
        else:
            return False
        self.states = self.states | {action: state}
        return True


def log_message(event: Event) -> Log:
    """Return an event as a line of the log."""
    text = f"{event.kind.value}: {event_text(event)}"
    return Log(timestamp=message.timestamp(event.time), level=_level(event), message=text, name=event.source)


def _level(event: Event) -> Log.Level.ValueType:
    if event.kind in ERRORS:
        return Log.ERROR
    code = event.data.get("outcome")
    failed = event.kind is EventKind.GOAL_FINISHED and isinstance(code, int) and not is_success(code)
    if event.kind in NOTABLE or failed:
        return Log.WARNING
    return Log.DEBUG if event.kind in DETAILS else Log.INFO


def event_message(event: Event) -> JsonMessage:
    """Return an event as it is written to events.jsonl."""
    return JsonMessage("mbf.Event", json.loads(event.to_json()))
