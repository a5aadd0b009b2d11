"""A behaviour tree as HTML: one line for each node, indented, coloured by its status; for the live view and replays.

Idle nodes are shown only below a running node; ``mbf tree show`` prints the whole tree.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from html import escape

from mbf_abstract.executives.tree_drawing import RUNNING, STATUS_COLOURS
from mbf_abstract.executives.tree_events import IDLE, SYMBOLS, NodeState

INDENT = 12  # pixels


def tree_html(nodes: Iterable[NodeState]) -> str:
    """Return the lines; a node's message is its tooltip, and is shown beside it where it has failed."""
    return "".join(_line(node) for node in worth_showing(nodes))


def worth_showing(nodes: Iterable[NodeState]) -> Iterator[NodeState]:
    """Leave out nodes that are idle, as those above them are or have become."""
    branch: list[str] = []  # statuses from the root down to the node
    for node in nodes:
        branch[node.depth :] = [node.status]
        if node.status != IDLE or node.depth == 0 or branch[node.depth - 1] == RUNNING:
            yield node


def _line(node: NodeState) -> str:
    at_work = "font-weight:600;" if node.status == RUNNING else ""
    message = f' <span style="opacity:0.75">{escape(node.message)}</span>' if node.status == "FAILURE" else ""
    tip = escape(f"{node.type}: {node.message}", quote=True)
    style = f"padding-left:{INDENT * node.depth}px;color:{STATUS_COLOURS[node.status]};{at_work}"
    return f'<div title="{tip}" style="{style}">{SYMBOLS[node.status]} {escape(node.name)}{message}</div>'
