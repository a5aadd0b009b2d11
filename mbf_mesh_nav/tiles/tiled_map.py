"""A map of tiles, opened: which tile is where, what is loaded, and what changes.

    tiled = TiledMap(Path("island"), memory=1e9)
    plan = plan_on_tiles(tiled, start, goal)

Opening reads the index and the portals of all tiles, some hundred bytes for each portal; tiles are read when they are
needed. Both keep to ``memory``. Beside it stay the tiles with costs that sensors have raised, see ``lay_over``.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.arrays import FloatArray, IntArray
from mbf_mesh_nav.map.layer import CostArray, LethalArray
from mbf_mesh_nav.mesh.mesh_report import MeshError
from mbf_mesh_nav.tiles.index import Box, read_index
from mbf_mesh_nav.tiles.places import TilePlace, find_place
from mbf_mesh_nav.tiles.pool import TilePool
from mbf_mesh_nav.tiles.portals import PortalGraph, TilePortals, estimated_costs
from mbf_mesh_nav.tiles.sensed import NOTHING_SENSED, SensedCosts
from mbf_mesh_nav.tiles.stored_tiles import sound_tile
from mbf_mesh_nav.tiles.tile import Tile, TileKey, read_tile_arrays, tile_file, write_tile
from mbf_mesh_nav.tiles.tile_graph import TileGraph, costs_between_portals, tile_graph

KEPT_TILES = 4
"""Tiles of starts and goals that stay loaded besides those of the pool."""
DEFAULT_MEMORY = 1.5e9
"""Bytes."""
PAIR_BYTES = 2 * (4 + 8)
"""Of a pair of portals of one tile, as bound and as estimate: its cost, and an edge of the graph of portals."""


class TiledMap:
    """A tiled map under one cost profile.

    Parameters
    ----------
    profile : str
        Name of a cost profile; empty = the map's first.
    memory : float
        Bytes that loaded tiles, searches, kept fields and the tables of portals may take.

    Attributes
    ----------
    index : TileIndex
    portals, estimates : PortalGraph
        With the least costs between any vertices of two portals, and with about what it costs between their middles.
    pool : TilePool
    table_bytes : int
        What the tables of portals take of the memory.
    changes : int
        How many times ``change_layer`` has changed a tile.

    Raises
    ------
    MeshError
        The map is not complete or damaged, or ``memory`` does not hold two tiles; the text names file and key.
    KeyError
        There is no such profile.
    """

    def __init__(self, folder: Path, profile: str = "", memory: float = DEFAULT_MEMORY) -> None:
        self.folder = folder
        self.index = read_index(folder)
        self._profile_row, self.profile = self.index.profile(profile)
        self._layer = self.index.layer_of(self.profile)
        bounds = {key: self._read_portals(key) for key in self.index.entries}
        self.portals = PortalGraph(bounds)
        self.estimates = PortalGraph({key: self._estimated(one) for key, one in bounds.items()})
        self.table_bytes = PAIR_BYTES * sum(one.costs.size for one in bounds.values())
        self._memory, self._fields = memory, 0
        self.pool = self._empty_pool(self._fields)
        self._kept: OrderedDict[TileKey, tuple[Tile, TileGraph]] = OrderedDict()
        self.changes = 0
        self._sensed = NOTHING_SENSED
        self._raised: dict[TileKey, tuple[Tile, TileGraph]] = {}  # tiles with sensed costs, and weights with them

    @property
    def sensed(self) -> SensedCosts:
        """The sensed costs that plans are made with, see ``lay_over``."""
        return self._sensed

    @property
    def profile_layer(self) -> str:
        """Name of the layer that the profile looks at."""
        return self.index.layers[self._layer]

    def tile(self, key: TileKey) -> tuple[Tile, TileGraph]:
        """A tile and its weights, from memory if it was asked for lately."""
        if key in self._raised:
            return self._raised[key]
        if key not in self._kept:
            self._kept[key] = self._read(key)
            if len(self._kept) > KEPT_TILES:
                self._kept.popitem(last=False)
        self._kept.move_to_end(key)
        return self._kept[key]

    def make_room_for_field(self) -> None:
        """Have the memory hold one field of a planner over all slots, too: there are fewer slots, and all are empty.

        Raises
        ------
        MeshError
            ``memory`` does not hold two tiles with it; nothing has changed then.
        """
        self.pool = self._empty_pool(self._fields + 1)
        self._fields += 1

    def hold(self, keys: list[TileKey]) -> None:
        """Load tiles into the pool."""
        self.pool.hold(keys, lambda key: self._raised.get(key) or self._kept.get(key) or self._read(key))

    def lay_over(self, sensed: SensedCosts) -> None:
        """Plan from now on with the worse of the stored and the sensed costs; in memory only, in place of earlier ones.

        Raises
        ------
        MeshError
            A tile is damaged; the earlier ones stay.
        """
        if sensed is self._sensed:
            return
        near = self.index.tiles_in(sensed.box) if len(sensed.numbers) else []
        raised = {key: found for key in near if (found := self._with_sensed(self.tile(key)[0], sensed)) is not None}
        freed = {key: self._as_stored(tile) for key, (tile, _) in self._raised.items() if key not in raised}
        # From here on nothing is read and nothing raises.
        self._sensed, self._raised = sensed, raised
        for key, weighed in (*freed.items(), *raised.items()):
            if self.pool.holds(key):
                self.pool.reweigh(key, *weighed)

    def vertices_in_pool(
        self, numbers: NDArray[np.int64], keys: Iterable[TileKey], boxes: Iterable[Box]
    ) -> IntArray | None:
        """Places in the pool of vertices with numbers (n,) in the map, ascending, which lie in the boxes.

        Looked for on some loaded tiles; None if one of them is on none of those.
        """
        if not len(numbers):
            return np.zeros(0, dtype=np.int32)
        near = {key for box in boxes for key in self.index.tiles_in(box)}.intersection(keys)
        places, is_found = [], np.zeros(len(numbers), dtype=np.bool_)
        for key in sorted(near):
            own = self.tile(key)[0]
            number = own.numbers[: own.core_vertices]
            place = np.minimum(np.searchsorted(numbers, number), len(numbers) - 1)
            here = np.flatnonzero(numbers[place] == number)
            is_found[place[here]] = True
            places.append(here + self.pool.first_vertex(key))
        return np.concatenate(places).astype(np.int32) if is_found.all() else None

    def find_place(self, position: FloatArray, reach: float) -> TilePlace | None:
        """The place on the surface nearest to a position (3,) [m], as ``borders.on_surface``; None off the surface.

        Also None for a position that is not finite.
        """
        if not np.isfinite(position).all():
            return None
        (x, y, z) = position.tolist()
        box = (x - reach, y - reach, z - reach, x + reach, y + reach, z + reach)
        found = (find_place(key, *self.tile(key), position, reach) for key in self.index.tiles_in(box))
        return min((place for place in found if place is not None), key=lambda place: place.distance, default=None)

    def change_layer(self, key: TileKey, layer: str, costs: CostArray, lethal: LethalArray) -> None:
        """Put new values (c,) of a layer on a tile's core, on disk and in memory, and what follows for its portals.

        A map that a server has opened changes by ``TiledNavigationMap.change_layer`` instead.

        Vertices that the tile shares with others keep the costs that those have for them until they change, too. The
        next build in the folder gives the tile the values of the source again.

        Raises
        ------
        MeshError
            There is no such tile or layer, its file is not sound, or it cannot be written; the old one stays.
        ValueError
            The values are not those of the core's vertices, or costs are negative or not a number.
        """
        if key not in self.index.entries or layer not in self.index.layers:
            raise MeshError(str(self.folder), [f"has no tile {key} with a layer '{layer}'"])
        tile = sound_tile(self.folder, self.index, key)
        if costs.shape != (tile.core_vertices,) or lethal.shape != (tile.core_vertices,):
            expected = (tile.core_vertices,)
            raise ValueError(f"tile {key} takes values of shape {expected}, got {costs.shape} and {lethal.shape}")
        if not (costs >= 0.0).all():
            raise ValueError(f"tile {key} takes costs of at least 0, got some that are negative or not a number")
        row = self.index.layers.index(layer)
        tile.costs[row], tile.lethal[row] = costs, lethal
        passing = tile.portal_costs.copy()
        for place, profile in enumerate(self.index.profiles.values()):
            if (seen := self.index.layer_of(profile)) == row:
                passing[place] = costs_between_portals(tile, tile.costs[seen], tile.lethal[seen], profile)
        tile = replace(tile, portal_costs=passing)
        self.changes += 1
        write_tile(tile_file(self.folder, key), tile)
        changed = TilePortals(tile.portals, passing[self._profile_row])
        self.portals.change(key, changed)
        self.estimates.change(key, self._estimated(changed))
        self._kept.pop(key, None)
        if self._raised.pop(key, None) is not None and (raised := self._with_sensed(tile, self._sensed)) is not None:
            self._raised[key] = raised
        self.pool.drop(key)

    def _empty_pool(self, fields: int) -> TilePool:
        """A pool of what the memory leaves beside the tables, the kept tiles and some fields of planners."""
        entries = self.index.entries.values()
        kept = self.table_bytes + KEPT_TILES * TilePool(entries, 0.0).slot_bytes
        pool = TilePool(entries, self._memory - kept, fields)
        if pool.slots < min(2, len(self.index.tiles)):
            least = (kept + 2 * pool.slot_bytes) / 1e6
            text = f"its tiles need {least:.3g} MB of memory, allowed are {self._memory / 1e6:.3g} MB"
            raise MeshError(str(self.folder), [text])
        return pool

    def _with_sensed(self, tile: Tile, sensed: SensedCosts) -> tuple[Tile, TileGraph] | None:
        """A tile and its weights with sensed costs; None if none of them is on it."""
        stored = tile.costs[self._layer], tile.lethal[self._layer]
        values = sensed.laid_over(tile.numbers[: tile.core_vertices], *stored)
        return None if values is None else (tile, tile_graph(tile, *values, self.profile))

    def _estimated(self, bounds: TilePortals) -> TilePortals:
        length = self.index.portal_length
        costs = estimated_costs(bounds.costs, bounds.portals, length, self.index.tile_size / length)
        return TilePortals(bounds.portals, costs)

    def _read(self, key: TileKey) -> tuple[Tile, TileGraph]:
        return self._as_stored(sound_tile(self.folder, self.index, key))

    def _as_stored(self, tile: Tile) -> tuple[Tile, TileGraph]:
        return tile, tile_graph(tile, tile.costs[self._layer], tile.lethal[self._layer], self.profile)

    def _read_portals(self, key: TileKey) -> TilePortals:
        path = tile_file(self.folder, key)
        arrays = read_tile_arrays(path, ("portals", "portal_costs"))
        portals, costs = arrays["portals"], arrays["portal_costs"]
        expected = (len(self.index.profiles), len(portals), len(portals))
        if costs.shape != expected:
            raise MeshError(str(path), [f"'portal_costs' has the shape {costs.shape}, expected {expected}"])
        return TilePortals(portals, costs[self._profile_row])
