"""What the page tells in words: goals that have ended, what else is worth knowing, and the running tree.

An event sink: it keeps little, so that it costs a run that nobody watches next to nothing.
"""

from __future__ import annotations

import threading
from collections import deque
from dataclasses import dataclass, field

from mbf_abstract.events import Event, EventKind
from mbf_abstract.executives.tree_events import NodeState, TreeState
from mbf_abstract.outcomes import is_success, outcome_name
from terrain.viewer.event_text import NOTABLE, words

MAX_LINES = 60
TOLD = NOTABLE | {EventKind.GOAL_FINISHED, EventKind.GOAL_PAUSED, EventKind.GOAL_RESUMED, EventKind.CUSTOM}


@dataclass(frozen=True)
class Line:
    """One thing that happened: time [s], who tells it, what, and whether that is good (None = neither)."""

    time: float
    source: str
    text: str
    good: bool | None = None


@dataclass(frozen=True)
class Snapshot:
    """The log at one time: newest line first, the last end of each action by its name, the nodes of the tree."""

    lines: tuple[Line, ...] = ()
    ends: dict[str, Line] = field(default_factory=dict)
    tree: str = ""
    nodes: tuple[NodeState, ...] = ()


class LiveLog:
    """Sink that keeps what the page shows; read it with ``snapshot`` from any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._lines: deque[Line] = deque(maxlen=MAX_LINES)
        self._ends: dict[str, Line] = {}
        self._tree = TreeState()
        self.version = 0
        """Grows whenever a snapshot would look different."""

    def write(self, event: Event) -> None:
        """Take one event."""
        is_told = event.kind in TOLD
        if not (is_told or event.kind is EventKind.TREE):
            return
        with self._lock:
            self.version += 1
            if is_told:
                line = line_of(event)
                self._lines.appendleft(line)
                if event.kind is EventKind.GOAL_FINISHED:
                    self._ends[event.source] = line
            else:
                self._tree.take(event)

    def close(self) -> None:
        """Keep what is there."""

    def snapshot(self) -> Snapshot:
        """Return what is known now."""
        with self._lock:
            nodes = tuple(NodeState(**vars(node)) for node in self._tree.nodes)
            return Snapshot(tuple(self._lines), dict(self._ends), self._tree.name, nodes)


def line_of(event: Event) -> Line:
    """Put an event into words."""
    if event.kind is EventKind.GOAL_FINISHED:
        outcome = event.data.get("outcome")
        code = outcome if isinstance(outcome, int) else 0
        name = outcome_name(code)
        good = None if name == "CANCELED" else is_success(code)
        return Line(event.time, event.source, f"{name}: {event.data.get('message', '')}", good)
    what = "" if event.kind is EventKind.CUSTOM else event.kind.value.replace("_", " ")
    text = " ".join(part for part in (what, words(event)) if part)
    return Line(event.time, event.source, text, False if event.kind is EventKind.FAULT else None)
