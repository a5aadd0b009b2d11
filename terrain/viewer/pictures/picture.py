"""What pictures by matplotlib have in common: figures without a window, triangles, lines, marks, a scale bar."""

from __future__ import annotations

import io
import warnings
from collections.abc import Sequence
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import FloatArray, Pose
from terrain.viewer.pictures.colours import DRIVEN, GOAL, PLANNED, START, Colour
from terrain.viewer.pictures.raster import paint_triangles

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LONG_SIDE = 9.0  # inches
DOTS_PER_INCH = 130
FINER = 2  # pixels of painted triangles in one of the picture, along each side
MOST_PIXELS = 4000
COMPRESSION = 4  # as small as level 6, matplotlib's own, in half of the time
PLAN_WIDTH = 3.6  # points
FAINT = 0.35  # opacity of the plans before the last one
HALO = 1.6  # points of white around lines, so that they show on any ground


class ViewerMissing(Exception):
    """A package that draws is not installed; the text names the command that installs it."""


Extent = tuple[float, float, float, float]
"""x_min, x_max, y_min, y_max [m]."""


def new_figure(extent: Extent) -> tuple[Figure, Axes]:
    """Make a figure of the extent's proportions, without a window and without matplotlib's global state."""
    figure, (axes,) = panel_figure(extent, 1)
    return figure, axes


def panel_figure(extent: Extent, count: int) -> tuple[Figure, list[Axes]]:
    """Make a figure of ``count`` panels of the same extent, two in a row; as ``new_figure``."""
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError as error:
        raise ViewerMissing(f"pictures need matplotlib: pip install 'mbf-flex[sim]' ({error})") from error
    x_min, x_max, y_min, y_max = extent
    columns, rows = min(count, 2), -(-count // 2)
    width, height = x_max - x_min, y_max - y_min
    scale = LONG_SIDE / max(columns * width, rows * height)
    size = (max(columns * width * scale, 4.0) + 1.0, max(rows * height * scale, 3.0) + 1.6)
    figure = Figure(figsize=size, dpi=DOTS_PER_INCH, layout="constrained" if count > 1 else None)
    FigureCanvasAgg(figure)
    panels = [figure.add_subplot(rows, columns, number + 1) for number in range(count)]
    for axes in panels:
        axes.set(xlim=(x_min, x_max), ylim=(y_min, y_max), aspect="equal")
        axes.set_facecolor("#e8e8e8")
        axes.label_outer()
    for axes in panels[-columns:]:
        axes.set_xlabel("x [m]")
    for axes in panels[::columns]:
        axes.set_ylabel("y [m]")
    return figure, panels


def png_bytes(figure: Figure) -> bytes:
    """Return the figure as a PNG file, cut to its contents."""
    buffer = io.BytesIO()
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing", UserWarning)  # drawn as a box
        squeezed = {"compress_level": COMPRESSION}
        figure.savefig(buffer, format="png", bbox_inches="tight", facecolor="white", pil_kwargs=squeezed)
    return buffer.getvalue()


def draw_triangles(axes: Axes, corners: FloatArray, colours: FloatArray) -> None:
    """Paint triangles (n, 3, 2) [m] in the given order, one colour (n, 3) each of 0..1, as far as the axes' limits.

    They become one image, because matplotlib takes seconds for as many polygons.
    """
    (x_min, x_max), (y_min, y_max) = axes.get_xlim(), axes.get_ylim()
    pixel = pixel_size(axes)
    width, height = (min(max(round(side / pixel), 1), MOST_PIXELS) for side in (x_max - x_min, y_max - y_min))
    places = np.empty((len(corners), 3, 3))
    places[..., 0] = (corners[..., 0] - x_min) * (FINER * width / (x_max - x_min))
    places[..., 1] = (y_max - corners[..., 1]) * (FINER * height / (y_max - y_min))
    places[..., 2] = np.arange(1.0, len(corners) + 1.0)[:, None]  # later ones are nearer
    size = (FINER * height, FINER * width)
    pixels, depths = np.zeros((*size, 3), np.uint8), np.zeros(size, np.float32)
    paint_triangles(places, np.round(255.0 * colours).astype(np.uint8), pixels, depths)
    axes.imshow(_mean_of_blocks(pixels, depths > 0.0), extent=(x_min, x_max, y_min, y_max), zorder=1)


def pixel_size(axes: Axes) -> float:
    """Length [m] that a pixel of the picture shows, as far as the axes' place is known before they are drawn."""
    (x_min, x_max), (y_min, y_max), box = axes.get_xlim(), axes.get_ylim(), axes.get_window_extent()
    return float(max((x_max - x_min) / box.width, (y_max - y_min) / box.height))


def _mean_of_blocks(pixels: NDArray[np.uint8], painted: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """Red, green, blue and opacity (h, w, 4) of blocks of ``FINER`` by ``FINER`` pixels, black where not painted."""
    height, width = painted.shape[0] // FINER, painted.shape[1] // FINER
    sums, counts = np.zeros((height, width, 3), np.uint16), np.zeros((height, width), np.uint16)
    for row, column in product(range(FINER), repeat=2):
        sums += pixels[row::FINER, column::FINER]
        counts += painted[row::FINER, column::FINER]
    opacity = 255 * counts // FINER**2
    return np.dstack([sums // np.maximum(counts, 1)[..., None], opacity]).astype(np.uint8)


def draw_line(axes: Axes, points: FloatArray, colour: Colour, width: float, **style: Any) -> None:
    """Draw a line through points (n, 2 or 3) with a white border; nan parts it."""
    from matplotlib.patheffects import Normal, Stroke

    effects = [Stroke(linewidth=width + HALO, foreground="white", alpha=0.7), Normal()]
    (line,) = axes.plot(points[:, 0], points[:, 1], color=np.array(colour) / 255.0, linewidth=width, **style)
    line.set_path_effects(effects)


def draw_paths(
    axes: Axes, paths: Sequence[FloatArray], colour: Colour = PLANNED, prefix: str = "", linestyle: Any = "-"
) -> None:
    """Draw the last plan strong and those before it faint; wide, so that it shows beside the track upon it.

    Parameters
    ----------
    paths : sequence of (n, 2 or 3) float64
        In the order they were made [m]; nan parts a line.
    prefix : str
        Of their names in the legend, which are "plan" and, if any before it is to be seen, "earlier plans".
    """
    named = f"{prefix}earlier plans"
    for points in paths[:-1]:
        (line,) = axes.plot(
            points[:, 0], points[:, 1], color=np.array(colour) / 255.0, linewidth=1.0, alpha=FAINT, zorder=4
        )
        if named and np.isfinite(points[:, 0]).any():
            line.set_label(named)
            named = ""
    for points in paths[-1:]:
        draw_line(axes, points, colour, PLAN_WIDTH, zorder=5, label=f"{prefix}plan", linestyle=linestyle)


def draw_track(
    axes: Axes, poses: FloatArray, footprint: FloatArray, colour: Colour = DRIVEN, label: str = "driven track"
) -> None:
    """Draw the track of poses (n, 7), and the footprint (m, 2) [m] at the last one; nothing without poses."""
    if len(poses):
        draw_line(axes, poses[:, :2], colour, 1.5, zorder=6, label=label)
        heading = Pose((0, 0, 0), tuple(poses[-1, 3:].tolist()))
        outline = footprint @ heading.rotation[:2, :2].T + poses[-1, :2]
        axes.fill(*outline.T, facecolor=np.array(colour) / 255.0, edgecolor="white", linewidth=0.8, zorder=8)


def draw_marks(axes: Axes, start: Pose | None, goals: tuple[Pose, ...]) -> None:
    """Mark the start, if it is to be seen, by a disc and the goals by stars."""
    mark: dict[str, Any] = {"linestyle": "none", "markeredgecolor": "white", "markeredgewidth": 1.2, "zorder": 9}
    if start is not None:
        axes.plot(start.x, start.y, marker="o", markersize=10, color=np.array(START) / 255.0, label="start", **mark)
    for index, goal in enumerate(goals):
        label = "goal" if index == 0 else None
        axes.plot(goal.x, goal.y, marker="*", markersize=18, color=np.array(GOAL) / 255.0, label=label, **mark)


def draw_scale_bar(axes: Axes) -> None:
    """Draw a bar of a round length, about a sixth of the axes, into the lower left corner."""
    (x_min, x_max), (y_min, y_max) = axes.get_xlim(), axes.get_ylim()
    length = round_length((x_max - x_min) / 6.0)
    x, y = x_min + 0.03 * (x_max - x_min), y_min + 0.03 * (y_max - y_min)
    back = {"facecolor": "white", "alpha": 0.75, "edgecolor": "none", "pad": 2.0}
    axes.plot([x, x + length], [y, y], color="white", linewidth=6.0, solid_capstyle="projecting", zorder=10)
    axes.plot([x, x + length], [y, y], color="#222222", linewidth=3.0, solid_capstyle="butt", zorder=11)
    axes.annotate(
        f"{length:g} m", (x + 0.5 * length, y), (0, 5), textcoords="offset points", ha="center", va="bottom",
        fontsize=8, color="#222222", bbox=back, zorder=11,
    )  # fmt: skip


def round_length(length: float) -> float:
    """Return the largest of 1, 2 and 5 times a power of ten that is not above a positive length."""
    power = 10.0 ** np.floor(np.log10(length))
    return float(power * max(factor for factor in (1.0, 2.0, 5.0) if factor * power <= length * (1.0 + 1e-9)))
