"""Draws a behaviour tree: as text for a terminal, as dot for Graphviz, as an SVG of our own that needs neither.

In the SVG a tree grows from left to right: one row for each leaf, parents beside the middle of their children. Boxes
with round corners are leaves; a running tree shows each node's status by the colour of its edge, and fills what runs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING
from xml.sax.saxutils import escape

from mbf_abstract.executives.tree_events import IDLE, NodeState, in_order

if TYPE_CHECKING:
    from py_trees.behaviour import Behaviour

ROW_HEIGHT = 34.0
BOX_HEIGHT = 26.0
CHARACTER_WIDTH = 7.0
COLUMN_GAP = 34.0
MARGIN = 12.0
RUNNING = "RUNNING"
STATUS_COLOURS = {IDLE: "#8a8f98", RUNNING: "#1f6feb", "SUCCESS": "#1a7f37", "FAILURE": "#cf222e"}
FORMATS = ("text", "dot", "svg")


def draw_tree(tree: Behaviour, form: str = "text") -> str:
    """Draw as ``text``, ``dot`` or ``svg``; raises ValueError for any other form."""
    if form not in FORMATS:
        raise ValueError(f"expected one of {', '.join(FORMATS)}, got {form!r}")
    return {"text": as_text, "dot": as_dot, "svg": as_svg}[form](tree)


def as_text(tree: Behaviour) -> str:
    """One line for each node, children indented."""
    from py_trees.display import unicode_tree

    return str(unicode_tree(tree))


def as_dot(tree: Behaviour) -> str:
    """Return the tree in the language of Graphviz."""
    lines = ["digraph tree {", "  rankdir=LR; node [shape=box, fontname=sans];"]
    nodes = [node for node, _ in in_order(tree)]
    numbers = {id(node): number for number, node in enumerate(nodes)}
    for node in nodes:
        shape = "" if node.children else ", style=rounded"
        label = _label(node).replace("\\", "\\\\").replace('"', '\\"')
        lines.append(f'  n{numbers[id(node)]} [label="{label}"{shape}];')
        lines += [f"  n{numbers[id(node)]} -> n{numbers[id(child)]};" for child in node.children]
    return "\n".join([*lines, "}", ""])


def as_svg(tree: Behaviour) -> str:
    """Return the tree as one SVG document."""
    nodes = [NodeState(_label(node), type(node).__name__, depth, node.status.value) for node, depth in in_order(tree)]
    return svg_of(nodes)


def svg_of(nodes: Sequence[NodeState]) -> str:
    """Draw nodes, parents first, as one SVG document; their messages are tooltips, and running ones are filled."""
    widest: dict[int, float] = {}  # box of each depth
    for node in nodes:
        widest[node.depth] = max(widest.get(node.depth, 0.0), _width(node))
    columns = [widest.get(depth, 0.0) for depth in range(max(widest, default=-1) + 1)]
    boxes: list[_Box] = []
    rows = 0.0
    while len(boxes) < len(nodes):
        rows += _place(nodes, rows, columns, boxes)
    width = MARGIN + sum(columns) + COLUMN_GAP * max(len(columns) - 1, 0) + MARGIN
    height = 2.0 * MARGIN + rows * ROW_HEIGHT
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:g}" height="{height:g}" '
        f'viewBox="0 0 {width:g} {height:g}" font-family="sans-serif" font-size="12">'
    )
    return "\n".join([head, *(line for box in boxes for line in box.draw()), "</svg>", ""])


@dataclass
class _Box:
    """A placed node: left edge, middle height, whether it is a leaf, and where its line to the parent begins."""

    node: NodeState
    x: float
    y: float
    is_leaf: bool = True
    parent: _Box | None = None

    def draw(self) -> list[str]:
        colour, width = STATUS_COLOURS[self.node.status], _width(self.node)
        lines = []
        if self.parent is not None:
            start, middle = self.parent.x + _width(self.parent.node), self.x - COLUMN_GAP / 2.0
            lines.append(
                f'<path d="M{start:g} {self.parent.y:g} H{middle:g} V{self.y:g} H{self.x:g}" fill="none" '
                f'stroke="{colour}"/>'
            )
        fill, text = (colour, "#fff") if self.node.status == RUNNING else ("#f6f8fa", "#000")
        lines.append(
            f'<rect x="{self.x:g}" y="{self.y - BOX_HEIGHT / 2:g}" width="{width:g}" height="{BOX_HEIGHT:g}" '
            f'rx="{10 if self.is_leaf else 2}" fill="{fill}" stroke="{colour}">'
            f"<title>{escape(f'{self.node.type}: {self.node.message}')}</title></rect>"
        )
        lines.append(
            f'<text x="{self.x + width / 2.0:g}" y="{self.y + 4:g}" text-anchor="middle" fill="{text}" '
            f'pointer-events="none">{escape(self.node.name)}</text>'
        )
        return lines


def _label(node: Behaviour) -> str:
    return f"{node.name} ({type(node).__name__})"


def _width(node: NodeState) -> float:
    return CHARACTER_WIDTH * len(node.name) + 12.0


def _place(nodes: Sequence[NodeState], row: float, columns: Sequence[float], boxes: list[_Box]) -> float:
    """Place the next node and all below it from ``row`` on; returns the number of rows they take."""
    node = nodes[len(boxes)]
    box = _Box(node, MARGIN + sum(columns[: node.depth]) + COLUMN_GAP * node.depth, 0.0)
    boxes.append(box)
    rows = 0.0
    while len(boxes) < len(nodes) and nodes[len(boxes)].depth > node.depth:
        child = len(boxes)
        rows += _place(nodes, row + rows, columns, boxes)
        boxes[child].parent, box.is_leaf = box, False
    rows = max(rows, 1.0)
    box.y = MARGIN + (row + rows / 2.0) * ROW_HEIGHT
    return rows
