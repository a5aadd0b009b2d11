"""The picture of ``mbf plan --png``: a map with its costs, start, goal and the path, if there is one."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mbf_abstract.geometry import Path as PlannedPath
from mbf_abstract.geometry import Pose
from mbf_abstract.maps.view import GridView, MapView, MeshView
from mbf_abstract.whole_files import write_whole
from terrain.viewer.pictures.colours import FLOOR, WALL
from terrain.viewer.pictures.picture import draw_marks, draw_paths, draw_triangles, new_figure, png_bytes
from terrain.viewer.pictures.shading import shaded_triangles
from terrain.worlds.surface import Surface

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST_PIXELS = 2000
"""Rows and columns of a map that a picture shows; more would cost memory and not be seen."""
COSTLY = (224, 120, 60)
UNKNOWN = (170, 176, 186)


def write_plan_picture(
    file: str | Path, view: MapView | None, start: Pose, goal: Pose, path: PlannedPath | None, title: str
) -> None:
    """Draw a plan into a PNG file; raises ViewerMissing without matplotlib."""
    figure, axes = new_figure(map_extent(view, start, goal))
    if view is not None:
        draw_map(axes, view)
    if path is not None:
        draw_paths(axes, [path.positions])
    draw_marks(axes, start, (goal,))
    length = "no path" if path is None else f"{path.length:.2f} m, {len(path)} poses"
    axes.set_title(f"{title} · {length}", loc="left", fontsize=11, fontweight="bold", parse_math=False)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.08), ncols=3, frameon=False, fontsize=9)
    write_whole(file, png_bytes(figure))


def draw_map(axes: Axes, view: MapView) -> None:
    """Draw the costs of a grid, or of a mesh in the light."""
    if isinstance(view, MeshView):
        colours = cost_colours(view.costs).astype(np.uint8)
        draw_triangles(axes, *shaded_triangles(Surface(view.vertices, view.faces), colours))
        return
    small = shrunk(view, MOST_PIXELS)
    pixels = cost_colours(small.costs).astype(np.uint8)
    axes.imshow(pixels, origin="lower", extent=small.extent, interpolation="nearest", zorder=1)


def cost_colours(costs: np.typing.NDArray[np.float32]) -> np.typing.NDArray[np.float64]:
    """Colours (..., 3) 0..255 of costs: floor to orange for 0 to 1, wall from 1 on and for inf, blue-grey for nan."""
    levels = np.clip(np.nan_to_num(costs, nan=0.0, posinf=1.0), 0.0, 1.0)[..., None]
    colours = np.array(FLOOR) * (1.0 - levels) + np.array(COSTLY) * levels
    colours[np.isnan(costs)] = UNKNOWN
    colours[costs >= 1.0] = WALL
    return np.asarray(colours)


def shrunk(view: GridView, most: int) -> GridView:
    """A view of at most ``most`` rows and columns, of blocks that each have the highest cost in them.

    A wall of one cell stays a wall; a block is unknown (nan) only as a whole. The last blocks may stand out of the map.
    """
    height, width = view.costs.shape
    side = max(1, -(-max(height, width) // most))
    if side == 1:
        return view
    columns = np.arange(0, width, side)
    rows = [np.fmax.reduceat(np.fmax.reduce(view.costs[y : y + side]), columns) for y in range(0, height, side)]
    x_min, x_max, y_min, y_max = view.extent
    x_max = x_min + (x_max - x_min) * side * len(columns) / width
    y_max = y_min + (y_max - y_min) * side * len(rows) / height
    return GridView(np.array(rows, dtype=np.float32), (x_min, x_max, y_min, y_max))


def map_extent(view: MapView | None, start: Pose, goal: Pose) -> tuple[float, float, float, float]:
    """What a picture shows [m]: x_min, x_max, y_min, y_max of the grid; of mesh, start and goal with a margin."""
    if isinstance(view, GridView):
        return view.extent
    ends = np.array([start.position, goal.position])
    points = ends if view is None else np.concatenate([ends, view.vertices])
    (x_min, y_min), (x_max, y_max) = points[:, :2].min(axis=0) - 0.5, points[:, :2].max(axis=0) + 0.5
    return float(x_min), float(x_max), float(y_min), float(y_max)
