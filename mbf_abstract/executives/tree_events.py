"""A running behaviour tree in the event log: ``TreeReporter`` writes it, ``TreeState`` reads it again.

One event holds the whole tree when a run begins; after that an event comes only with a tick that has changed the
status of a node. A reader needs neither the tree nor ``py_trees``, so the live view and a replay show the same thing.

Example
-------
>>> state = TreeState()
>>> for event in read_events("runs/1/events.jsonl"):
...     state.take(event)
>>> print(state.as_text())
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from mbf_abstract.event_bus import EventBus
from mbf_abstract.events import Event, EventKind

if TYPE_CHECKING:
    from py_trees.behaviour import Behaviour

IDLE = "INVALID"
SYMBOLS = {IDLE: "·", "RUNNING": "▶", "SUCCESS": "✓", "FAILURE": "✗"}
"""What stands before a node in a text, by the name of its status."""


class TreeReporter:
    """Emits the state of one tree as events of kind ``TREE``; use it on the thread that ticks the tree."""

    def __init__(self, tree: Behaviour, events: EventBus) -> None:
        self._tree = tree
        self._events = events
        self._nodes: list[Behaviour] = []
        self._reported: list[str] = []

    def begin(self) -> None:
        """Report the nodes of the tree; all of them are idle."""
        placed = list(in_order(self._tree))
        self._nodes = [node for node, _ in placed]
        self._reported = [IDLE] * len(placed)
        nodes = [{"name": node.name, "type": type(node).__name__, "depth": depth} for node, depth in placed]
        self._events.emit(EventKind.TREE, "tree", tree=self._tree.name, nodes=nodes)

    def report(self, tick: int) -> None:
        """Report the nodes that have changed since the last call, with their messages."""
        now = [node.status.value for node in self._nodes]
        if now == self._reported:
            return
        changes = [
            [index, status, self._nodes[index].feedback_message]
            for index, (status, reported) in enumerate(zip(now, self._reported, strict=True))
            if status != reported
        ]
        self._reported = now
        self._events.emit(EventKind.TREE, "tree", tree=self._tree.name, tick=tick, changes=changes)


def in_order(node: Behaviour, depth: int = 0) -> Iterator[tuple[Behaviour, int]]:
    """Yield a node and all below it with their depths, parents first."""
    yield node, depth
    for child in node.children:
        yield from in_order(child, depth + 1)


@dataclass
class NodeState:
    """One node: its name, class and depth (0 = root), the name of its status and its last message."""

    name: str
    type: str
    depth: int
    status: str = IDLE
    message: str = ""


class TreeState:
    """A tree as its events describe it.

    Attributes
    ----------
    name : str
        Of the tree; empty until one has begun.
    tick : int
        Number of the last tick that changed something.
    nodes : list of NodeState
        Parents first.
    """

    def __init__(self) -> None:
        self.name = ""
        self.tick = 0
        self.nodes: list[NodeState] = []

    def take(self, event: Event) -> bool:
        """Follow one event; returns whether it was one of a tree. Changes of a tree that never began are ignored."""
        if event.kind is not EventKind.TREE:
            return False
        data: dict[str, Any] = dict(event.data)
        if "nodes" in data:
            self.name, self.tick = data["tree"], 0
            self.nodes = [NodeState(node["name"], node["type"], node["depth"]) for node in data["nodes"]]
        elif data["tree"] == self.name:
            self.tick = data["tick"]
            for index, status, message in data["changes"]:
                self.nodes[index].status, self.nodes[index].message = status, message
        return True

    def as_text(self) -> str:
        """One line for each node, indented, its status as a symbol before it."""
        return "\n".join(
            f"{'    ' * node.depth}{SYMBOLS[node.status]} {node.name}{f'  ({node.message})' if node.message else ''}"
            for node in self.nodes
        )
