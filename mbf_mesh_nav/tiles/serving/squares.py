"""Surroundings of any place on a tiled map, kept while they are asked for.

They are squares of a grid with a margin as wide as the question needs, so questions about places near each other share
them. They are cut out of tiles of their own, so no question waits for a search.
"""

from __future__ import annotations

import math

from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.tiles.sensed import NOTHING_SENSED, SensedCosts
from mbf_mesh_nav.tiles.serving.recently_used import RecentlyUsed
from mbf_mesh_nav.tiles.serving.surroundings import Surroundings, mesh_within
from mbf_mesh_nav.tiles.stored_tiles import sound_tile
from mbf_mesh_nav.tiles.tile import Tile, TileKey
from mbf_mesh_nav.tiles.tiled_map import TiledMap

CELL = 32.0
"""Side of a square of the grid, in distances between vertices."""
LEAST_MARGIN, MOST_MARGIN = 8.0, 512.0
"""Of surroundings around their square, in distances between vertices; the least one doubled as often as needed."""
BEYOND = 2.0
"""How much wider than the question's radius a margin is, in distances between vertices."""
KEPT_VERTICES = 400_000
"""Of surroundings that are kept; one vertex takes some 370 bytes."""
OF_A_SQUARE = 1000
"""Vertices that surroundings count for besides their own, so that there are not too many small or empty ones."""
KEPT_TILES = 4
"""Tiles that surroundings were cut out of and that stay loaded."""


class Squares:
    """The surroundings of one map; for any number of threads.

    Parameters
    ----------
    tiled : TiledMap
        Its index and profile count; what it has loaded is not touched.
    """

    def __init__(self, tiled: TiledMap) -> None:
        self._tiled = tiled
        self._tiles: RecentlyUsed[TileKey, Tile] = RecentlyUsed(self._read, KEPT_TILES)
        self._squares = RecentlyUsed(self._cut_out, KEPT_VERTICES, _size)

    @property
    def reach(self) -> float:
        """How far [m] around a place a question can look."""
        return (MOST_MARGIN - BEYOND) * self._tiled.index.spacing

    @property
    def kept_size(self) -> float:
        """Vertices of what is kept, and ``OF_A_SQUARE`` for each of the surroundings."""
        return self._squares.kept_size

    def clear(self) -> None:
        """Forget all, because the tiles have changed."""
        # Tiles first: what is cut out in between has the new values.
        self._tiles.clear()
        self._squares.clear()

    def around(self, x: float, y: float, radius: float, sensed: SensedCosts = NOTHING_SENSED) -> MeshMap | None:
        """The map as far as ``radius`` [m] around a place, and farther; None where there is no surface.

        Raises
        ------
        MeshError
            A tile is damaged.
        """
        spacing, margin = self._tiled.index.spacing, LEAST_MARGIN
        while (margin - BEYOND) * spacing < radius:
            margin *= 2.0
        found = self._squares.get((math.floor(x / (CELL * spacing)), math.floor(y / (CELL * spacing)), margin))
        return None if found is None else found.with_sensed(sensed)

    def within(self, low: tuple[float, float], high: tuple[float, float]) -> Surroundings | None:
        """What lies in a rectangle between two corners (x, y) [m], cut out anew; see ``mesh_within``."""
        return mesh_within(self._tiled, low, high, self._tiles.get)

    def tile(self, key: TileKey) -> Tile:
        """A tile, from memory if surroundings were cut out of it lately."""
        return self._tiles.get(key)

    def _read(self, key: TileKey) -> Tile:
        return sound_tile(self._tiled.folder, self._tiled.index, key)

    def _cut_out(self, square: tuple[int, int, float]) -> Surroundings | None:
        """Surroundings of a square of the grid: column, row, and margin in distances between vertices."""
        column, row, margin = square
        spacing = self._tiled.index.spacing
        low = (column * CELL - margin) * spacing, (row * CELL - margin) * spacing
        high = ((column + 1) * CELL + margin) * spacing, ((row + 1) * CELL + margin) * spacing
        return self.within(low, high)


def _size(surroundings: Surroundings | None) -> float:
    return OF_A_SQUARE + (0 if surroundings is None else len(surroundings.map.vertices))
