"""The worlds of ``moving.py``: a grid of free cells, and start and goal of each robot, drawn by a seed."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

RESOLUTION = 0.05  # m

Place = tuple[float, float, float]
Case = tuple[NDArray[np.bool_], list[tuple[Place, Place]]]


def floor(width: float, height: float) -> NDArray[np.bool_]:
    """A floor without any free place; row 0 at y = 0."""
    return np.zeros((round(height / RESOLUTION), round(width / RESOLUTION)), dtype=bool)


def cut(free: NDArray[np.bool_], x0: float, x1: float, y0: float, y1: float, is_free: bool = True) -> None:
    """Make a rectangle [m] free, or not."""
    columns, rows = (slice(round(a / RESOLUTION), round(b / RESOLUTION)) for a, b in ((x0, x1), (y0, y1)))
    free[rows, columns] = is_free


def corridor(rng: np.random.Generator, width: float, bay: bool) -> Case:
    """Two rooms joined by a corridor of 10 m; two robots change rooms."""
    free = floor(20.0, 6.0)
    cut(free, 0.5, 5.0, 0.5, 5.5)
    cut(free, 15.0, 19.5, 0.5, 5.5)
    cut(free, 5.0, 15.0, 3.0 - 0.5 * width, 3.0 + 0.5 * width)
    if bay:
        x = float(rng.uniform(6.5, 12.5))
        cut(free, x, x + 1.1, 3.0, 4.7)
    left, right = (2.0 + float(rng.uniform(-1.0, 1.5)), 18.0 - float(rng.uniform(-1.0, 1.5)))
    offsets = rng.uniform(-1.5, 1.5, size=4).tolist()
    west, east = (left, 3.0 + offsets[0], 0.0), (right, 3.0 + offsets[1], float(np.pi))
    return free, [(west, (right, 3.0 + offsets[2], 0.0)), (east, (left, 3.0 + offsets[3], float(np.pi)))]


def dead_end(rng: np.random.Generator) -> Case:
    """A room with a corridor of 0.9 m that ends after 8 m: one robot comes out, the other one goes in."""
    free = floor(14.0, 6.0)
    cut(free, 0.5, 5.0, 0.5, 5.5)
    cut(free, 5.0, 13.0, 2.55, 3.45)
    outside, offsets = 2.0 + float(rng.uniform(-1.0, 1.5)), rng.uniform(-1.5, 1.5, size=2).tolist()
    inside = 12.0 + float(rng.uniform(-1.0, 0.5))
    going_in = ((outside, 3.0 + offsets[0], 0.0), (inside, 3.0, 0.0))
    return free, [going_in, ((inside, 3.0, float(np.pi)), (outside, 3.0 + offsets[1], float(np.pi)))]


def head_on(rng: np.random.Generator) -> Case:
    """Two small rooms joined by a corridor of 5 m and one robot's width, with a bay, without, or closed at one end."""
    free = floor(11.0, 5.0)
    kind = ("bay", "rooms", "closed")[int(rng.integers(3))]
    cut(free, 0.5, 3.0, 0.5, 4.5)
    cut(free, 3.0, 8.0, 2.05, 2.95)
    if kind != "closed":
        cut(free, 8.0, 10.5, 0.5, 4.5)
    if kind == "bay":
        x, y = float(rng.uniform(3.7, 6.2)), float(rng.choice([1.0, 2.5]))
        cut(free, x, x + 1.1, y, y + 1.5)
    left, offsets = 1.5 + float(rng.uniform(-0.5, 1.0)), rng.uniform(-1.2, 1.2, size=4).tolist()
    right, turned = 9.5 - float(rng.uniform(-0.5, 1.0)), float(np.pi)
    if kind == "closed":
        right, offsets[1:3] = 7.2 + float(rng.uniform(0.0, 0.4)), (0.0, 0.0)
    west, east = (left, 2.5 + offsets[0], 0.0), (right, 2.5 + offsets[1], turned)
    return free, [(west, (right, 2.5 + offsets[2], 0.0)), (east, (left, 2.5 + offsets[3], turned))]


def crossing(rng: np.random.Generator) -> Case:
    """Two corridors of 1.4 m that cross; four robots, each goes straight on."""
    free = floor(14.0, 14.0)
    cut(free, 0.5, 13.5, 6.3, 7.7)
    cut(free, 6.3, 7.7, 0.5, 13.5)
    ways = []
    for angle in np.arange(4) * 0.5 * np.pi:
        c, s = float(np.cos(angle)), float(np.sin(angle))
        start, end = 4.5 + float(rng.uniform(0.0, 1.0)), 5.2 + float(rng.uniform(0.0, 0.6))
        side = 0.35  # those that come stand beside those that have arrived
        begin = (7.0 - start * c + side * s, 7.0 - start * s - side * c, float(angle))
        ways.append((begin, (7.0 + end * c + side * s, 7.0 + end * s - side * c, float(angle))))
    return free, ways


def warehouse(rng: np.random.Generator, robots: int) -> Case:
    """Rows of racks with aisles of 1.6 m; starts and goals are drawn, all 1.2 m apart from each other."""
    free = floor(20.0, 14.0)
    cut(free, 0.5, 19.5, 0.5, 13.5)
    for row in range(4):
        for x0, x1 in ((2.5, 8.7), (11.0, 17.3)):
            y = 2.1 + 2.6 * row
            cut(free, x0, x1, y, y + 1.0, is_free=False)
    places: list[Place] = []
    while len(places) < 2 * robots:
        x, y = float(rng.uniform(1.2, 18.8)), float(rng.uniform(1.2, 12.8))
        rows, columns = (slice(round((v - 0.5) / RESOLUTION), round((v + 0.5) / RESOLUTION)) for v in (y, x))
        if free[rows, columns].all() and all(np.hypot(x - a, y - b) > 1.2 for a, b, _ in places):
            places.append((x, y, float(rng.uniform(-np.pi, np.pi))))
    return free, list(zip(places[::2], places[1::2], strict=True))


CASES: dict[str, Callable[[np.random.Generator], Case]] = {
    "head_on": head_on,
    "bay": lambda rng: corridor(rng, 0.9, True),
    "dead_end": dead_end,
    "wide": lambda rng: corridor(rng, 1.8, False),
    "crossing": crossing,
    "warehouse_2": lambda rng: warehouse(rng, 2),
    "warehouse_5": lambda rng: warehouse(rng, 5),
    "warehouse_10": lambda rng: warehouse(rng, 10),
    "warehouse_20": lambda rng: warehouse(rng, 20),
}
