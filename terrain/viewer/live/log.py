"""What the page shows of the log: goals that have ended, notable events, the timeline, and the running tree.

An event sink: it keeps little, so that it costs an unwatched run almost nothing.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

from mbf_abstract.events import Event, EventKind, EventSink
from mbf_abstract.executives.tree_events import NodeState, TreeState
from terrain.viewer.reports.event_lines import NOTABLE, Line, is_shown, line_of

MAX_LINES = 60
SPAN = 120.0  # s of the timeline
MAX_TIMELINE = 2000  # events; more than that in two minutes, and the oldest go
ON_TIMELINE = {EventKind.GOAL_ACCEPTED, EventKind.GOAL_FINISHED, *NOTABLE}


@dataclass(frozen=True)
class Snapshot:
    """The log at one time: newest line first, the last end of each action by its name, the nodes of the tree.

    ``timeline`` has the goals and notable events of the last ``SPAN`` s, and goals from before that still run.
    """

    lines: tuple[Line, ...] = ()
    ends: dict[str, Line] = field(default_factory=dict)
    nodes: tuple[NodeState, ...] = ()
    timeline: tuple[Event, ...] = ()


class LiveLog(EventSink):
    """Sink that keeps what the page shows; read it with ``snapshot`` from any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._lines: deque[Line] = deque(maxlen=MAX_LINES)
        self._ends: dict[str, Line] = {}
        self._tree = TreeState()
        self._timeline: list[Event] = []

    def write(self, event: Event) -> None:
        """Take one event."""
        shown = is_shown(event)
        on_timeline = event.kind in ON_TIMELINE
        if not (shown or on_timeline or event.kind is EventKind.TREE):
            return
        with self._lock:
            if on_timeline:
                self._timeline.append(event)
                if len(self._timeline) > MAX_TIMELINE:
                    self._timeline = recent(self._timeline, event.time - SPAN)[-MAX_TIMELINE // 2 :]
            if shown:
                line = line_of(event)
                self._lines.appendleft(line)
                if event.kind is EventKind.GOAL_FINISHED:
                    self._ends[event.source] = line
            elif event.kind is EventKind.TREE:
                self._tree.take(event)

    def snapshot(self) -> Snapshot:
        """Return what is known now."""
        with self._lock:
            nodes = tuple(NodeState(**vars(node)) for node in self._tree.nodes)
            return Snapshot(tuple(self._lines), dict(self._ends), nodes, tuple(self._timeline))


def recent(events: Sequence[Event], since: float) -> list[Event]:
    """Keep the events that are not older than ``since`` [s], and acceptances of goals that had not ended by then."""
    ended = {
        event.data.get("goal_id") for event in events if event.kind is EventKind.GOAL_FINISHED and event.time < since
    }
    return [
        event
        for event in events
        if event.time >= since or (event.kind is EventKind.GOAL_ACCEPTED and event.data.get("goal_id") not in ended)
    ]
