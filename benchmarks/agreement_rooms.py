"""Random rooms of ``agreement_worlds.py``: boxes, and walls with gaps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

SIDE = 6.0
"""Of a room [m], without its scale."""


@dataclass(frozen=True)
class Box:
    """A part of the floor where nothing may stand [m]."""

    x0: float
    x1: float
    y0: float
    y1: float

    def holds(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Which points lie in it."""
        return (x >= self.x0) & (x < self.x1) & (y >= self.y0) & (y < self.y1)

    def scaled(self, scale: float) -> Box:
        """The same in a room that is so many times as large."""
        return Box(scale * self.x0, scale * self.x1, scale * self.y0, scale * self.y1)


def walls(side: float) -> list[Box]:
    """Around a room of ``side`` [m]."""
    return [
        Box(0, side, 0, 0.05),
        Box(0, side, side - 0.05, side),
        Box(0, 0.05, 0, side),
        Box(side - 0.05, side, 0, side),
    ]


WALLS = walls(SIDE)


def random_boxes(rng: np.random.Generator, is_open: bool = False, side: float = SIDE) -> list[Box]:
    """Walls around unless it is open, four to eleven boxes, and up to two walls with a gap of 0.7 to 1.5 m."""
    boxes = [] if is_open else walls(side)
    for _ in range(rng.integers(4, 12)):
        (x, y), (w, h) = rng.uniform(0.0, side, 2), rng.uniform(0.1, 1.0, 2)
        boxes.append(Box(x, x + w, y, y + h))
    for _ in range(rng.integers(0, 3)):
        at, gap = rng.uniform(0.2 * side, 0.8 * side), rng.uniform(0.7, 1.5)
        begin = rng.uniform(0.0, side - gap)
        parts = [Box(at, at + 0.1, 0, begin), Box(at, at + 0.1, begin + gap, side)]
        boxes += parts if rng.random() < 0.5 else [Box(p.y0, p.y1, p.x0, p.x1) for p in parts]
    return boxes
