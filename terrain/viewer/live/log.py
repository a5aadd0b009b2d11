"""Text for the page: goals that have ended, notable events, and the running tree.

An event sink: it keeps little, so that it costs an unwatched run almost nothing.
"""

from __future__ import annotations

import threading
from collections import deque
from dataclasses import dataclass, field

from mbf_abstract.events import Event, EventKind
from mbf_abstract.executives.tree_events import NodeState, TreeState
from terrain.viewer.reports.event_lines import Line, is_shown, line_of

MAX_LINES = 60


@dataclass(frozen=True)
class Snapshot:
    """The log at one time: newest line first, the last end of each action by its name, the nodes of the tree."""

    lines: tuple[Line, ...] = ()
    ends: dict[str, Line] = field(default_factory=dict)
    nodes: tuple[NodeState, ...] = ()


class LiveLog:
    """Sink that keeps what the page shows; read it with ``snapshot`` from any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._lines: deque[Line] = deque(maxlen=MAX_LINES)
        self._ends: dict[str, Line] = {}
        self._tree = TreeState()

    def write(self, event: Event) -> None:
        """Take one event."""
        shown = is_shown(event)
        if not (shown or event.kind is EventKind.TREE):
            return
        with self._lock:
            if shown:
                line = line_of(event)
                self._lines.appendleft(line)
                if event.kind is EventKind.GOAL_FINISHED:
                    self._ends[event.source] = line
            else:
                self._tree.take(event)

    def close(self) -> None:
        """Do nothing."""

    def snapshot(self) -> Snapshot:
        """Return what is known now."""
        with self._lock:
            nodes = tuple(NodeState(**vars(node)) for node in self._tree.nodes)
            return Snapshot(tuple(self._lines), dict(self._ends), nodes)
