"""A map with its costs: ``mbf plan --png`` with start, goal and the path, if there is one; a drive at one of its times.

The latter shows the robot, its track, what its sensors hit, and the plan.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mbf_abstract.drive_log import DriveLog
from mbf_abstract.geometry import Path as PlannedPath
from mbf_abstract.geometry import Pose
from mbf_abstract.maps.view import GridView, MapView, MeshView
from mbf_abstract.whole_files import write_whole
from terrain.viewer.pictures.colours import FLOOR, SCAN, WALL
from terrain.viewer.pictures.picture import draw_marks, draw_paths, draw_track, draw_triangles, new_figure, png_bytes
from terrain.viewer.pictures.shading import shaded_triangles
from terrain.worlds.surface import Surface

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST_PIXELS = 2000
"""Rows and columns of a map that a picture shows; more would cost memory and not be seen."""
SCAN_AGE = 0.5  # s; older scans of a drive are not drawn
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
    write_whole(file, _titled_png(figure, axes, f"{title} · {length}", columns=3))


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


def map_png(log: DriveLog, time: float, view: MapView) -> bytes:
    """Draw the map of a log at ``time`` [s] as a PNG file; raises ViewerMissing without matplotlib."""
    figure, axes = new_figure(map_extent(view, log.start, log.goals[-1] if log.goals else log.start))
    draw_map(axes, view)
    recent = [scan.points for scan in log.scans if time - SCAN_AGE <= scan.time <= time]
    if recent:
        points = np.concatenate(recent)
        axes.plot(points[:, 0], points[:, 1], ".", color=np.array(SCAN) / 255.0, markersize=2, label="scan", zorder=3)
    draw_paths(axes, [points for when, points in log.paths if when <= time])
    draw_track(axes, log.poses[log.times <= time], log.outline)
    if len(log.times):
        draw_marks(axes, log.start, log.goals)
    return _titled_png(figure, axes, f"{log.name} · {log.backend} · {time:.1f} s", columns=5)


def _titled_png(figure: Figure, axes: Axes, title: str, columns: int) -> bytes:
    axes.set_title(title, loc="left", fontsize=11, fontweight="bold", parse_math=False)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.08), ncols=columns, frameon=False, fontsize=9)
    return png_bytes(figure)
