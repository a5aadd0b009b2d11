"""Storeys of a world: level floors that lie one above the other.

Hills have none, however high they are: a storey needs a second level floor above or below it. The views show one
storey at a time, so that a roof does not hide the robot under it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import FloatArray
from terrain.viewer.pictures.shading import face_normals
from terrain.worlds.surface import Surface

LEVEL = np.cos(np.radians(5.0))  # faces steeper than 5 degrees are ramps
CELL = 1.0  # m; of the grid in which floors are looked for above each other
HEADROOM = 1.8  # m; floors nearer than this are one storey
LEAST_OVERLAP = 0.05  # of the level cells; less is a step or a bench, no storey
LEAST_FLOOR = 0.04  # of the area of all level faces
BIN = 0.1  # m of height


def storeys(ground: Surface | None) -> list[float]:
    """Heights [m] of the floors of a world, lowest first; none for a world of one level."""
    if ground is None or not len(ground.faces):
        return []
    corners = ground.vertices[ground.faces]
    level = face_normals(ground)[:, 2] > LEVEL
    middles, areas = corners[level].mean(axis=1), _plan_areas(corners[level])
    if not len(middles) or _share_of_overlap(middles) < LEAST_OVERLAP:
        return []
    floors: list[float] = []
    for floor in _floors(middles[:, 2], areas):
        if not floors or floor - floors[-1] >= HEADROOM:
            floors.append(floor)
    return floors if len(floors) > 1 else []


def storey_of(floors: list[float], heights: FloatArray) -> NDArray[np.intp]:
    """Index (n,) of the storey that each height (n,) [m] belongs to: the middle between two floors parts them."""
    middles = 0.5 * (np.array(floors[:-1]) + np.array(floors[1:]))
    return np.searchsorted(middles, heights)


def _plan_areas(corners: FloatArray) -> FloatArray:
    """Areas (n,) [m^2] of triangles (n, 3, 3) seen from above."""
    a, b = corners[:, 1, :2] - corners[:, 0, :2], corners[:, 2, :2] - corners[:, 0, :2]
    return np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / 2.0


def _share_of_overlap(middles: FloatArray) -> float:
    """Share of the cells with level faces that have some at least ``HEADROOM`` above others."""
    x, y = np.floor((middles[:, :2] - middles[:, :2].min(axis=0)) / CELL).astype(np.int64).T
    _, cell = np.unique(x * (y.max() + 1) + y, return_inverse=True)
    lowest, highest = np.full(cell.max() + 1, np.inf), np.full(cell.max() + 1, -np.inf)
    np.minimum.at(lowest, cell, middles[:, 2])
    np.maximum.at(highest, cell, middles[:, 2])
    return float(np.mean(highest - lowest >= HEADROOM))


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
