"""A tiled map as one picture: for every pixel the highest cost of the vertices in it, on whichever storey."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.maps.view import GridView
from mbf_mesh_nav.arrays import Float32Array, FloatArray
from mbf_mesh_nav.tiles.sensed import SensedCosts
from mbf_mesh_nav.tiles.stored_tiles import sound_tile
from mbf_mesh_nav.tiles.tiled_map import TiledMap

MOST_PIXELS = 1000
"""Along the longer side."""
LEAST_SPACINGS = 2.0
"""Side of a pixel, in distances between vertices; narrower ones would have gaps between them."""


def overview(tiled: TiledMap, row: int) -> GridView:
    """The costs of a layer, by its row in the index; nan where there is no surface.

    Reads the tiles one by one.

    Raises
    ------
    MeshError
        A tile is damaged or of another map.
    """
    left, bottom, _, right, top, _ = tiled.index.box
    side = max(LEAST_SPACINGS * tiled.index.spacing, max(right - left, top - bottom) / MOST_PIXELS)
    columns, rows = (math.floor(length / side) + 1 for length in (right - left, top - bottom))
    costs: Float32Array = np.full(columns * rows, -np.inf, dtype=np.float32)
    for key in tiled.index.entries:
        tile = sound_tile(tiled.folder, tiled.index, key)
        core = tile.vertices[: tile.core_vertices]
        values = np.where(tile.lethal[row], np.float32(np.inf), tile.costs[row])
        np.maximum.at(costs, _pixels(core, left, bottom, side, columns), values)
    costs[np.isneginf(costs)] = np.nan
    costs.flags.writeable = False
    extent = (left, left + columns * side, bottom, bottom + rows * side)
    return GridView(costs.reshape(rows, columns), extent)


def with_sensed(view: GridView, sensed: SensedCosts) -> GridView:
    """A picture of the stored costs with those laid over it that sensors have raised."""
    if not len(sensed.numbers):
        return view
    left, right, bottom, _ = view.extent
    columns = view.costs.shape[1]
    costs = view.costs.ravel().copy()
    values = np.where(sensed.lethal, np.float32(np.inf), sensed.costs)
    np.fmax.at(costs, _pixels(sensed.places, left, bottom, (right - left) / columns, columns), values)
    costs.flags.writeable = False
    return GridView(costs.reshape(view.costs.shape), view.extent)


def _pixels(places: FloatArray, left: float, bottom: float, side: float, columns: int) -> NDArray[np.int64]:
    """Numbers (n,), row by row, of the pixels of this side [m] that places (n, 3) [m] lie in."""
    column, line = (np.floor((places[:, axis] - low) / side).astype(np.int64) for axis, low in ((0, left), (1, bottom)))
    return np.asarray(line * columns + column)
