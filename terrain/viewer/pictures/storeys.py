"""Storeys of a world: level floors that lie one above the other, and the panel of a picture that shows each.

Hills have none, however high they are: a storey needs a second level floor above or below it. The views show one
storey at a time, so that a roof does not hide the robot under it.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import FloatArray
from terrain.viewer.pictures.raster import paint_triangles
from terrain.viewer.pictures.shading import face_normals
from terrain.worlds.surface import Surface

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LEVEL = np.cos(np.radians(5.0))  # faces steeper than 5 degrees are ramps
POINTS = 256  # along the longer side of the grid of points at which floors are looked for above each other
HEADROOM = 1.8  # m; floors nearer than this are one storey
LEAST_OVERLAP = 0.04  # of the points with level faces; less is a step or a bench, no storey
LEAST_FLOOR = 0.04  # of the area of all level faces
BIN = 0.1  # m of height
CUT_SHARE = 0.7  # of a storey's height; what is higher above its floor is not in its panel


def storeys(ground: Surface | None) -> list[float]:
    """Heights [m] of the floors of a world, lowest first; none for a world of one level."""
    if ground is None or not len(ground.faces):
        return []
    corners = ground.vertices[ground.faces]
    corners = corners[face_normals(ground)[:, 2] > LEVEL]
    if not len(corners) or _share_of_overlap(corners) < LEAST_OVERLAP:
        return []
    floors: list[float] = []
    for floor in _floors(corners[:, :, 2].mean(axis=1), _plan_areas(corners)):
        if not floors or floor - floors[-1] >= HEADROOM:
            floors.append(floor)
    return floors if len(floors) > 1 else []


def _plan_areas(corners: FloatArray) -> FloatArray:
    """Areas (n,) [m^2] of triangles (n, 3, 3) seen from above."""
    a, b = corners[:, 1, :2] - corners[:, 0, :2], corners[:, 2, :2] - corners[:, 0, :2]
    return np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / 2.0


def _share_of_overlap(corners: FloatArray) -> float:
    """Share of the points on level faces (n, 3, 3) that have some at least ``HEADROOM`` above others.

    The faces are seen straight from above and from below. However large or small they are, they cover all points of
    their area.
    """
    lower, upper = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    scale = POINTS / max(float((upper - lower)[:2].max()), 1e-9)
    above = _nearest(scale * (corners[:, :, :2] - lower[:2]), corners[:, :, 2] - lower[2])
    below = _nearest(scale * (corners[:, :, :2] - lower[:2]), upper[2] - corners[:, :, 2])
    gaps = (above + below - (upper[2] - lower[2]))[above > -0.5]
    return float(np.mean(gaps >= HEADROOM)) if len(gaps) else 0.0


def _nearest(places: FloatArray, heights: FloatArray) -> FloatArray:
    """Largest of the heights (n, 3) [m] of triangles (n, 3, 2) at each point of the grid; -1 where there is none."""
    columns, rows = np.ceil(places.max(axis=(0, 1))).astype(np.int64)
    found = np.zeros((rows, columns), np.float32)
    colours, pixels = np.zeros((len(places), 3), np.uint8), np.zeros((rows, columns, 3), np.uint8)
    paint_triangles(np.dstack([places, 1.0 + heights]), colours, pixels, found)
    return found.astype(np.float64) - 1.0


def _floors(heights: FloatArray, areas: FloatArray) -> list[float]:
    """Mean heights [m] of the runs of neighbouring bins that have area, of runs that are large enough."""
    bins = np.floor((heights - heights.min()) / BIN).astype(np.int64)
    area = np.bincount(bins, areas)
    moment = np.bincount(bins, areas * heights)
    filled = area > LEAST_FLOOR / 10.0 * area.sum()
    run = np.cumsum(np.diff(filled, prepend=False) & filled) * filled
    sums, moments = np.bincount(run, area)[1:], np.bincount(run, moment)[1:]
    large = sums >= LEAST_FLOOR * area.sum()
    return [float(height) for height in moments[large] / sums[large]]


class Panel(NamedTuple):
    """Axes that show one storey: what is between two heights, and no ground or wall above ``cut`` [m]."""

    axes: Axes
    low: float
    high: float
    floor: float
    cut: float

    def shows(self, heights: FloatArray) -> NDArray[np.bool_]:
        """Which of the heights (n,) [m] belong to this storey."""
        return (heights >= self.low) & (heights < self.high)

    def part(self, points: FloatArray) -> FloatArray:
        """Points (n, 3) with nan where they are on another storey, so that lines end there."""
        return np.where(self.shows(points[:, 2])[:, None], points, np.nan)


def panels_of(axes: list[Axes], floors: list[float]) -> Iterator[Panel]:
    """A panel for each floor; the middle between two floors parts them."""
    if not floors:
        yield Panel(axes[0], -np.inf, np.inf, -np.inf, np.inf)
    middles = [-np.inf, *(0.5 * (a + b) for a, b in pairwise(floors)), np.inf]
    for number, floor in enumerate(floors):
        above = floors[number + 1] if number + 1 < len(floors) else np.inf
        yield Panel(axes[number], middles[number], middles[number + 1], floor, floor + CUT_SHARE * (above - floor))
