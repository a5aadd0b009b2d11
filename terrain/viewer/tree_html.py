"""A behaviour tree as HTML: one line for each node, indented, coloured by its status; for the live view and replays."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape

from mbf_abstract.executives.tree_events import IDLE, SYMBOLS, NodeState

COLOURS = {IDLE: "#8a8f98", "RUNNING": "#1f6feb", "SUCCESS": "#1a7f37", "FAILURE": "#cf222e"}
INDENT = 12  # pixels


def tree_html(nodes: Iterable[NodeState]) -> str:
    """Return the lines; what a node said stands as a tooltip on it, and beside it where it has failed."""
    return "".join(_line(node) for node in nodes)


def _line(node: NodeState) -> str:
    at_work = "font-weight:600;" if node.status == "RUNNING" else ""
    said = f' <span style="opacity:0.75">{escape(node.message)}</span>' if node.status == "FAILURE" else ""
    tip = escape(f"{node.type}: {node.message}", quote=True)
    style = f"padding-left:{INDENT * node.depth}px;color:{COLOURS[node.status]};{at_work}"
    return f'<div title="{tip}" style="{style}">{SYMBOLS[node.status]} {escape(node.name)}{said}</div>'
