"""Decks close above what is below them: the foot of a ramp that was scanned from below, a bridge over unseen ground.

Ground and deck are one run of points there, as no robot fits between them. Whether the deck is driven on, or stands on
the ground as a table does, is known by its edge: a deck goes on from the ground beside it, step for step.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry.arithmetic import tan
from mbf_mesh_nav.arrays import BoolArray, FloatArray, IntArray
from mbf_mesh_nav.building.surface_patches import Grid
from mbf_mesh_nav.kernels.building.columns import LOWEST
from mbf_mesh_nav.kernels.building.decks import top_layers
from mbf_mesh_nav.kernels.building.patches import STEP_X, STEP_Y
from mbf_mesh_nav.mesh.topology import group_of_each

STEEPEST, UNEVEN = 25.0, 0.05
"""A deck goes on from what is beside it at most so steeply [deg], or with an edge of so much [m]."""
LEAST_AREA, EVEN, ROUGHEST = 1.0, 0.75, 0.04
"""A deck is at least so large [m^2], and this share of its cells lies so near [m] to the mean of those around; the tips
of grass do not."""
WHOLE, AGREE, AMID = 4, 4, 6
"""So many of the eight neighbours a cell of a deck has on the average; so many as low make a cell ground; and above so
many a cell is amid a deck."""
FOOT = 1.0
"""[m] So far down, where a ramp leaves no gap above the ground any more, its upper side still counts."""
STEPS = list(zip(STEP_X.tolist(), STEP_Y.tolist(), strict=True))
OPPOSITE = [STEPS.index((-dx, -dy)) for dx, dy in STEPS]


def on_decks(
    points: FloatArray,
    grid: Grid,
    patches: tuple[IntArray, NDArray[np.int64], NDArray[np.int64], IntArray],
    band: float,
    thickest: float,
    tallest: float,
) -> tuple[NDArray[np.int64], BoolArray]:
    """First points (P,) of the patches; of the lowest of a column, if it carries a deck, the first one on that.

    And which (P,) patches are left: those amid a deck and below it, of which only the underside was seen, are not.

    Parameters
    ----------
    points : (n, 3) float64
        Those of a patch from the bottom to the top.
    patches : four of (P,)
        Cells, first points, ends and kinds, see ``split_columns``.
    band : float
        The points of a surface are at most so far apart in height, and below a deck is more room [m].
    thickest : float
        What the deck is at most, its underside included [m].
    tallest : float
        What ground and deck are together at most [m].
    """
    cells, firsts, ends, kinds = patches
    lowest = np.flatnonzero(kinds == LOWEST)
    layers = top_layers(points, firsts[lowest], ends[lowest], band, thickest, tallest)
    if not layers.is_deck.any():
        return firsts, np.ones(len(firsts), dtype=np.bool_)
    rows, columns = cells[lowest] // grid.columns + 1, cells[lowest] % grid.columns + 1

    def over_grid(values: FloatArray, mask: BoolArray) -> FloatArray:
        heights = np.full((grid.rows + 2, grid.columns + 2), np.nan)
        heights[rows[mask], columns[mask]] = values[mask]
        return heights

    rises = layers.tops - layers.bottoms
    is_foot = ~layers.is_deck & (rises > band) & (rises <= thickest + band)
    decks, feet = over_grid(layers.tops, layers.is_deck), over_grid(layers.tops, is_foot)
    bottoms = over_grid(layers.bottoms, np.ones(len(lowest), dtype=np.bool_))
    grounds = over_grid(layers.bottoms, ~layers.is_deck & _agreeing(bottoms, rows, columns, grid.cell))
    reached = _grown(np.where(np.isnan(decks), feet, decks), [grounds], grid.cell, math.inf)
    found = _large_and_even(np.where(np.isnan(decks), np.nan, reached), grid.cell)
    found = np.where(
        np.isnan(found), _grown(np.where(np.isnan(reached), np.nan, feet), [found], grid.cell, FOOT), found
    )
    on_deck = ~np.isnan(found[rows, columns])
    result = firsts.copy()
    result[lowest[on_deck]] = layers.firsts[on_deck]
    higher = sum((found[rows + dy, columns + dx] - layers.bottoms > UNEVEN + band).astype(int) for dx, dy in STEPS)
    is_left = np.ones(len(firsts), dtype=np.bool_)
    is_left[lowest] = on_deck | (higher < AMID)
    return result, is_left


def _agreeing(bottoms: FloatArray, rows: IntArray, columns: IntArray, cell: float) -> BoolArray:
    """Mask of the cells that as many around them are as low as: one where no ground was seen below a table is not."""
    here, climb = bottoms[rows, columns], UNEVEN + cell * float(tan(np.radians(STEEPEST)))
    alike = sum((np.abs(bottoms[rows + dy, columns + dx] - here) <= climb).astype(int) for dx, dy in STEPS)
    return np.asarray(alike >= AGREE)


def _grown(candidates: FloatArray, beside: list[FloatArray], cell: float, reach: float) -> FloatArray:
    """Those of the heights [m] of candidates that go on from heights beside them, cell by cell as far as ``reach`` [m].

    All arrays are (rows + 2, columns + 2), NaN where there is nothing.
    """
    steepest = float(tan(np.radians(STEEPEST)))
    climb = np.array([UNEVEN + math.hypot(dx, dy) * cell * steepest for dx, dy in STEPS])
    grown, is_waiting = np.full_like(candidates, np.nan), ~np.isnan(candidates)
    places, far = np.argwhere(is_waiting), 0.0
    while len(places) and far < reach:
        y, x = places.T
        goes_on = np.zeros(len(places), dtype=np.bool_)
        for heights in (*beside, grown):
            near = np.stack([heights[y + dy, x + dx] for dx, dy in STEPS], axis=1)
            goes_on |= (np.abs(near - candidates[y, x][:, None]) <= climb).any(axis=1)
        y, x = y[goes_on], x[goes_on]
        grown[y, x], is_waiting[y, x] = candidates[y, x], False
        around = np.concatenate([np.column_stack([y + dy, x + dx]) for dx, dy in STEPS])
        places, far = np.unique(around[is_waiting[around[:, 0], around[:, 1]]], axis=0), far + cell
    return grown


def _large_and_even(decks: FloatArray, cell: float) -> FloatArray:
    """The heights of decks that are large enough, and whose heights are those of a surface."""
    chosen, places = np.full_like(decks, np.nan), np.argwhere(~np.isnan(decks))
    if not len(places):
        return chosen
    y, x = places.T
    numbers = np.full(decks.shape, -1)
    numbers[y, x] = np.arange(len(places))
    around = np.stack([numbers[y + dy, x + dx] for dx, dy in STEPS], axis=1)
    here, direction = np.nonzero(around >= 0)
    groups = group_of_each(np.stack([here, around[here, direction]], axis=1), len(places))
    beside = np.stack([decks[y + dy, x + dx] for dx, dy in STEPS], axis=1)
    pairs = ~np.isnan(beside) & ~np.isnan(beside[:, OPPOSITE])  # on a slope the mean of two opposite ones is on it
    means = np.where(pairs, beside, 0.0).sum(axis=1) / np.maximum(pairs.sum(axis=1), 1)
    off = np.abs(decks[y, x] - means)
    for group in np.flatnonzero(np.bincount(groups) * cell * cell >= LEAST_AREA):
        of_group = groups == group
        offs = off[of_group & pairs.any(axis=1)]
        is_whole = np.count_nonzero(around[of_group] >= 0) >= WHOLE * np.count_nonzero(of_group)
        if is_whole and len(offs) and np.quantile(offs, EVEN) <= ROUGHEST:
            chosen[y[of_group], x[of_group]] = decks[y[of_group], x[of_group]]
    return chosen
