"""Events: the typed record of what the framework did, one per step of a goal.

Every event carries the time of the injected clock, never the wall clock, and plain JSON values only: two runs of the
same seed write the same bytes.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Protocol

from mbf_abstract.event_values import JsonValue


class EventKind(str, Enum):
    """What happened. Beside each kind: the fields of its ``data``; a kind may carry more."""

    GOAL_ACCEPTED = "goal_accepted"  # goal_id, slot, action-specific summary of the goal
    GOAL_REJECTED = "goal_rejected"  # goal_id, message
    GOAL_STARTED = "goal_started"  # goal_id, slot, plugin
    GOAL_CANCEL = "goal_cancel"  # goal_id, reason
    GOAL_PAUSED = "goal_paused"  # goal_id
    GOAL_RESUMED = "goal_resumed"  # goal_id
    GOAL_FINISHED = "goal_finished"  # goal_id, status, outcome, message
    STATE_CHANGED = "state_changed"  # goal_id, old, new
    PLUGIN_CALL_STARTED = "plugin_call_started"  # goal_id, plugin, method
    PLUGIN_CALL_ENDED = "plugin_call_ended"  # goal_id, plugin, method, outcome, message
    CONTROL_LOOP = "control_loop"  # goal_id, began, cycles, failed; source: plugin; a loop has ended
    PLAN = "plan"  # goal_id, plugin, cost, length, poses (count)
    RECOVERY = "recovery"  # goal_id, plugin, reason
    COMMAND_CLAMPED = "command_clamped"  # requested, sent
    COMMAND_DROPPED = "command_dropped"  # command, reason
    GATE_CLOSED = "gate_closed"  # reason
    ROBOT_STOPPED = "robot_stopped"  # reason; sent by the gate, not by a plugin
    LEASE_GRANTED = "lease_granted"  # holder
    LEASE_REVOKED = "lease_revoked"  # holder, reason
    FAULT = "fault"  # where, type, message, traceback
    QUARANTINE = "quarantine"  # plugin, slot, reason
    STUCK = (
        "stuck"  # place, outcome, failures (count), tried: names, message; the same failure again and again at a place
    )
    TREE = "tree"  # tree, then nodes where a run of it begins, or tick and changes: [index, status, message] of each
    MAP = "map"  # message: what a map server did or found, such as a defect of the mesh it has loaded
    INCIDENT = "incident"  # what, x, y, z, robot_speed; moved, other, other_speed and gap where something was met
    OBJECT = "object"  # number, motion, position, velocity, radius; source: map; a tracked object moves, stops, is gone
    PARAMETER_CHANGED = "parameter_changed"  # name, old, new
    SINK_FAILED = "sink_failed"  # sink, message
    CUSTOM = "custom"  # anything a user or a plugin wants to see in the log


@dataclass(frozen=True)
class Event:
    """One thing that happened.

    Attributes
    ----------
    time : float
        Time [s] of the injected clock, rounded to a nanosecond.
    source : str
        Who reports it, e.g. ``"get_path"``, ``"velocity_gate"`` or a plugin's name.
    data : mapping of str to JSON value
        The fields listed at the kind.
    """

    time: float
    kind: EventKind
    source: str
    data: Mapping[str, JsonValue] = field(default_factory=dict)

    def to_json(self) -> str:
        """One line of JSON with sorted keys: equal events give equal text."""
        record = {"time": self.time, "kind": self.kind.value, "source": self.source, "data": self.data}
        return json.dumps(record, sort_keys=True, separators=(",", ":"), allow_nan=False)

    @classmethod
    def from_json(cls, line: str) -> Event:
        """Read a line written by ``to_json``; raises ValueError or KeyError on any other text."""
        record = json.loads(line)
        return cls(record["time"], EventKind(record["kind"]), record["source"], record["data"])


class EventSink(Protocol):
    """Where events go. Both methods are called under the bus's lock, one event at a time; they must not block."""

    def write(self, event: Event) -> None:
        """Take one event; raising takes the sink out of the bus."""

    def close(self) -> None:
        """Finish; idempotent. Nothing to do for a sink that holds nothing open."""
        return None
