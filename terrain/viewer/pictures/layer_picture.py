"""The costs of a mesh map, layer by layer, side by side from above, with the plan that they led to.

Each panel has a scale of its own, because layers have units of their own. Of several storeys, the highest is seen.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import FloatArray
from terrain.recording.recording import Recording
from terrain.viewer.pictures.colours import PLANNED, cost_colours_up_to
from terrain.viewer.pictures.layer_scale import end_of_scale, range_text, shown_layers
from terrain.viewer.pictures.picture import DOTS_PER_INCH, Extent, ViewerMissing, draw_line, draw_marks, png_bytes
from terrain.viewer.pictures.raster import paint_triangles

NOWHERE = (232, 232, 232)
PIXELS = 640  # along the longer side of a panel
PANEL = 3.6  # inches
TITLE = 0.35  # inches above a panel
MOST_COLUMNS = 4
PLAN_WIDTH = 1.6


def has_layers(recording: Recording) -> bool:
    """Whether a recording has costs of layers, and the surface they are on."""
    return bool(recording.meshes and recording.layers)


def layer_picture_png(recording: Recording, names: Sequence[str] = ()) -> bytes:
    """Draw layers as the bytes of a PNG file.

    Parameters
    ----------
    names : sequence of str
        Of the layers to draw, in this order; without any all whose costs differ.

    Raises
    ------
    ViewerMissing
        matplotlib is not installed.
    """
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError as error:
        raise ViewerMissing(f"pictures need matplotlib: pip install 'mbf-flex[sim]' ({error})") from error
    shown = shown_layers(recording.layers, names)
    rows = -(-len(shown) // MOST_COLUMNS) or 1
    columns = -(-len(shown) // rows) or 1
    surface = recording.meshes[0]
    (x_min, y_min), (x_max, y_max) = surface.vertices[:, :2].min(axis=0), surface.vertices[:, :2].max(axis=0)
    extent: Extent = (float(x_min), float(x_max), float(y_min), float(y_max))
    height = PANEL * (extent[3] - extent[2]) / (extent[1] - extent[0])
    figure = Figure((PANEL * columns, (height + TITLE) * rows), dpi=DOTS_PER_INCH, layout="constrained")
    FigureCanvasAgg(figure)
    for number, layer in enumerate(shown):
        axes = figure.add_subplot(rows, columns, number + 1)
        top = end_of_scale(layer)
        pixels = painted(surface.vertices, surface.faces, layer.costs.astype(np.float64), top, extent)
        axes.imshow(pixels, extent=extent, interpolation="nearest", zorder=1)
        for _, points in recording.paths[-1:]:
            draw_line(axes, points, PLANNED, PLAN_WIDTH, zorder=5)
        draw_marks(axes, None, recording.goals)
        axes.set(xlim=extent[:2], ylim=extent[2:], xticks=[], yticks=[])
        axes.set_title(f"{layer.name}, {range_text(layer)}", loc="left", fontsize=9, parse_math=False)
    return png_bytes(figure)


def painted(
    vertices: FloatArray, faces: NDArray[np.int32], costs: FloatArray, top: float, extent: Extent
) -> NDArray[np.uint8]:
    """Paint faces from above, each by the mean cost of its corners; forbidden where one of them is.

    Parameters
    ----------
    costs : (V,) float64
        inf is forbidden.
    top : float
        The cost at which the scale of colours ends.

    Returns
    -------
    pixels : (height, width, 3) uint8
        North at the top.
    """
    x_min, x_max, y_min, y_max = extent
    scale = PIXELS / max(x_max - x_min, y_max - y_min)
    width, height = (max(1, round(scale * side)) for side in (x_max - x_min, y_max - y_min))
    pixels = np.full((height, width, 3), NOWHERE, dtype=np.uint8)
    nearness = 1.0 + vertices[:, 2] - vertices[:, 2].min(initial=0.0)
    places = np.column_stack([scale * (vertices[:, 0] - x_min), scale * (y_max - vertices[:, 1]), nearness])
    colours = cost_colours_up_to(top, costs[faces].mean(axis=1))
    paint_triangles(places[faces], colours, pixels, np.zeros((height, width), dtype=np.float32))
    return pixels
