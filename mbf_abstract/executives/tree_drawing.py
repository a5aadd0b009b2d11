"""Draws a behaviour tree: as text for a terminal, as dot for Graphviz, as an SVG of our own that needs neither.

In the SVG a tree grows from left to right: one row for each leaf, parents beside the middle of their children. Boxes
with round corners are leaves; a running tree shows each node's status by the colour of its edge.
"""

from __future__ import annotations

from dataclasses import dataclass
from xml.sax.saxutils import escape

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from mbf_abstract.executives.tree_events import in_order

ROW_HEIGHT = 34.0
BOX_HEIGHT = 26.0
CHARACTER_WIDTH = 7.0
COLUMN_GAP = 34.0
MARGIN = 12.0
EDGE_COLOUR = {
    Status.INVALID: "#8a8f98",
    Status.RUNNING: "#1f6feb",
    Status.SUCCESS: "#1a7f37",
    Status.FAILURE: "#cf222e",
}
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
    widest: dict[int, float] = {}  # box of each depth
    for node, depth in in_order(tree):
        widest[depth] = max(widest.get(depth, 0.0), _width(node))
    columns = [widest[depth] for depth in range(len(widest))]
    boxes: list[_Box] = []
    rows = _place(tree, 0, 0.0, columns, boxes)
    width = MARGIN + sum(columns) + COLUMN_GAP * (len(columns) - 1) + MARGIN
    height = 2.0 * MARGIN + rows * ROW_HEIGHT
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:g}" height="{height:g}" '
        f'viewBox="0 0 {width:g} {height:g}" font-family="sans-serif" font-size="12">'
    )
    return "\n".join([head, *(line for box in boxes for line in box.draw()), "</svg>", ""])


@dataclass
class _Box:
    """A placed node: left edge, middle height, width, and where its line to the parent begins."""

    node: Behaviour
    x: float
    y: float
    width: float
    parent: _Box | None = None

    def draw(self) -> list[str]:
        colour = EDGE_COLOUR[self.node.status]
        radius = 2 if self.node.children else 10
        lines = []
        if self.parent is not None:
            start, middle = self.parent.x + self.parent.width, self.x - COLUMN_GAP / 2.0
            lines.append(
                f'<path d="M{start:g} {self.parent.y:g} H{middle:g} V{self.y:g} H{self.x:g}" fill="none" '
                f'stroke="{colour}"/>'
            )
        lines.append(
            f'<rect x="{self.x:g}" y="{self.y - BOX_HEIGHT / 2:g}" width="{self.width:g}" height="{BOX_HEIGHT:g}" '
            f'rx="{radius}" fill="#f6f8fa" stroke="{colour}"/>'
        )
        middle_x = self.x + self.width / 2.0
        text = escape(_label(self.node))
        lines.append(f'<text x="{middle_x:g}" y="{self.y + 4:g}" text-anchor="middle">{text}</text>')
        return lines


def _label(node: Behaviour) -> str:
    return f"{node.name} ({type(node).__name__})"


def _width(node: Behaviour) -> float:
    return CHARACTER_WIDTH * len(_label(node)) + 12.0


def _place(node: Behaviour, depth: int, row: float, columns: list[float], boxes: list[_Box]) -> float:
    """Place a node and all below it from ``row`` on; returns the number of rows they take."""
    x = MARGIN + sum(columns[:depth]) + COLUMN_GAP * depth
    box = _Box(node, x, 0.0, _width(node))
    boxes.append(box)
    rows, children = 0.0, []
    for child in node.children:
        children.append(len(boxes))
        rows += _place(child, depth + 1, row + rows, columns, boxes)
    for index in children:
        boxes[index].parent = box
    rows = max(rows, 1.0)
    box.y = MARGIN + (row + rows / 2.0) * ROW_HEIGHT
    return rows
