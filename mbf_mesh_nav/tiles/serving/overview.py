"""A tiled map as one picture: for every pixel the highest cost of the vertices in it, on whichever storey."""

from __future__ import annotations

import math

import numpy as np

from mbf_abstract.maps.view import GridView
from mbf_mesh_nav.arrays import Float32Array
from mbf_mesh_nav.tiles.tiled_map import TiledMap, sound_tile

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
        column, line = (
            np.floor((core[:, axis] - low) / side).astype(np.int64) for axis, low in ((0, left), (1, bottom))
        )
        values = np.where(tile.lethal[row], np.float32(np.inf), tile.costs[row])
        np.maximum.at(costs, line * columns + column, values)
    costs[np.isneginf(costs)] = np.nan
    costs.flags.writeable = False
    extent = (left, left + columns * side, bottom, bottom + rows * side)
    return GridView(costs.reshape(rows, columns), extent)
