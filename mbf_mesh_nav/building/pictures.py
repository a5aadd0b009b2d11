"""Plan views of the steps of building a map, as PNG files: one pixel for a cell, or for a block of cells."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.arrays import BoolArray, FloatArray
from mbf_mesh_nav.building.surface import BuiltSurface
from mbf_mesh_nav.building.surface_patches import Grid

Pixels = NDArray[np.uint8]

MOST_PIXELS = 900
LEAST_PIXELS = 400
EMPTY, GREY = (255, 255, 255), (205, 208, 212)
RED, ORANGE, BLUE, DARK = (200, 40, 40), (235, 150, 40), (60, 120, 220), (20, 20, 20)
LOW, MIDDLE, HIGH = (52, 94, 141), (245, 240, 220), (166, 70, 46)
"""Ends and middle of the scale of colours."""


class PlanView:
    """A picture of a grid from above, north at the top."""

    def __init__(self, grid: Grid) -> None:
        self._grid = grid
        self._block = max(1, -(-max(grid.columns, grid.rows) // MOST_PIXELS))
        height, width = (-(-count // self._block) for count in (grid.rows, grid.columns))
        self.pixels: Pixels = np.full((height, width, 3), EMPTY, dtype=np.uint8)

    def fill(self, cells: NDArray[np.integer], colours: Any) -> None:
        """Colour cells (n,) by one colour or by colours (n, 3); later ones cover earlier ones."""
        row, column = (cells // self._grid.columns) // self._block, (cells % self._grid.columns) // self._block
        self.pixels[row, column] = colours

    def line(self, points: FloatArray, colour: tuple[int, int, int]) -> None:
        """Draw a line through points (n, 2 or 3) [m]."""
        step = 0.5 * self._block * self._grid.cell
        for start, end in zip(points[:-1, :2], points[1:, :2], strict=True):
            count = int(np.abs(end - start).max() / step) + 2
            along = start + np.linspace(0.0, 1.0, count)[:, None] * (end - start)
            place = np.floor((along - self._grid.corner) / (self._block * self._grid.cell)).astype(np.int64)
            inside = ((place >= 0) & (place < self.pixels.shape[1::-1])).all(axis=1)
            column, row = place[inside].T
            self.pixels[row, column] = colour

    def png(self) -> bytes:
        """Return the picture as a PNG file, small ones enlarged."""
        from PIL import Image

        factor = max(1, LEAST_PIXELS // max(self.pixels.shape[:2]))
        upright = self.pixels[::-1].repeat(factor, axis=0).repeat(factor, axis=1)
        file = io.BytesIO()
        Image.fromarray(np.ascontiguousarray(upright)).save(file, "PNG", optimize=True)
        return file.getvalue()


def scaled_colours(values: FloatArray, low: float, high: float) -> Pixels:
    """Colours (n, 3) of values (n,) from blue at ``low`` over pale to red at ``high``."""
    share = np.clip((values - low) / max(high - low, 1e-9), 0.0, 1.0)[:, None]
    lower, upper = np.minimum(2.0 * share, 1.0), np.maximum(2.0 * share - 1.0, 0.0)
    colours = np.array(LOW) + lower * np.subtract(MIDDLE, LOW) + upper * np.subtract(HIGH, MIDDLE)
    return np.asarray(colours, dtype=np.uint8)


def density_picture(surface: BuiltSurface) -> tuple[bytes, str]:
    """Picture of the points of each cell, all surfaces together, and its caption."""
    patches, grid = surface.patches, surface.patches.grid
    is_twin = np.append(
        False, patches.firsts[1:] == patches.firsts[:-1]
    )  # the upper end of a thick run from the ground
    counts = np.where(is_twin, 0, patches.ends - patches.firsts)
    totals = np.bincount(patches.cells, weights=counts)
    cells = np.flatnonzero(totals)
    density = totals[cells] / (grid.cell * grid.cell)
    high = float(np.percentile(density, 95.0))
    view = PlanView(grid)
    view.fill(cells, scaled_colours(density, 0.0, high))
    return view.png(), f"Points of a square metre, all levels together: blue 0, red {high:.0f} and more, white none."


def height_picture(surface: BuiltSurface, path: FloatArray | None) -> tuple[bytes, str]:
    """Picture of the heights of the highest surface, with a path (n, 3) [m], and its caption."""
    patches, used = surface.patches, surface.is_used
    heights = patches.heights[used]
    low, high = float(heights.min()), float(heights.max())
    view = PlanView(patches.grid)
    view.fill(patches.cells[used], scaled_colours(heights, low, high))
    if path is not None:
        view.line(path, DARK)
    return view.png(), f"Height of the highest surface: blue {low:.1f} m, red {high:.1f} m. Black: the test plan."


def level_picture(surface: BuiltSurface) -> tuple[bytes, str]:
    """Picture of the number of surfaces above each other, and its caption."""
    cells, counts = np.unique(surface.patches.cells[surface.is_used], return_counts=True)
    view = PlanView(surface.patches.grid)
    view.fill(cells, GREY)
    view.fill(cells[counts > 1], scaled_colours(counts[counts > 1].astype(np.float64), 1.0, float(counts.max())))
    return view.png(), f"Surfaces above each other: grey one, red {int(counts.max())}."


def change_picture(surface: BuiltSurface) -> tuple[bytes, str]:
    """Picture of what was filled and left out, and its caption."""
    patches = surface.patches
    view = PlanView(patches.grid)
    kinds: tuple[tuple[BoolArray, tuple[int, int, int]], ...] = (
        (surface.is_used, GREY),
        (surface.is_small, ORANGE),
        (patches.is_filled & surface.is_used, BLUE),
        (surface.is_obstacle, RED),
    )
    for mask, colour in kinds:
        view.fill(patches.cells[mask], colour)
    return view.png(), "Grey: surface. Blue: filled holes. Red: obstacles. Orange: small surfaces and crowns, left out."


def error_picture(surface: BuiltSurface) -> tuple[bytes, str]:
    """Picture of the mean distance of the points from the surface, and its caption."""
    patches = surface.patches
    owner = np.repeat(np.arange(len(patches.cells)), np.where(surface.is_used, patches.ends - patches.firsts, 0))
    starts = np.repeat(patches.firsts, np.where(surface.is_used, patches.ends - patches.firsts, 0))
    place = np.arange(len(owner)) - np.searchsorted(owner, owner) + starts
    distances = surface.distances[place].astype(np.float64)
    known = np.isfinite(distances)
    cells, count = patches.cells[owner[known]], patches.grid.columns * patches.grid.rows
    totals = np.bincount(cells, weights=distances[known], minlength=count)
    counts = np.bincount(cells, minlength=count)
    seen = np.flatnonzero(counts)
    means = totals[seen] / counts[seen]
    span = max(float(np.percentile(np.abs(means), 95.0)), 0.001) if len(means) else 0.001
    view = PlanView(patches.grid)
    view.fill(seen, scaled_colours(means, -span, span))
    return (view.png(), f"Mean distance of the points: blue {span:.3f} m below, red as much above, pale none.")
