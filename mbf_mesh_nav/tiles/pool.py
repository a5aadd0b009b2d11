"""The loaded tiles in one set of flat arrays: a search runs over all of them without stitching anything.

Every tile takes a slot, a range of the vertices and one of the edges, of the size that the largest tile of the map
needs. A vertex that several tiles share exists once in each. It has one edge more there, its *link*: the links of the
same vertex in the tiles of a corridor lead round in a circle and cost nothing; others are impassable. So a corridor
is chosen by writing links.

If no slot is free, the tile that was used least recently goes.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Iterable

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.arrays import BoolArray, Float32Array, FloatArray, IntArray
from mbf_mesh_nav.kernels.search.dijkstra import SearchGraph, frontier
from mbf_mesh_nav.tiles.index import TileEntry
from mbf_mesh_nav.tiles.tile import Tile, TileKey
from mbf_mesh_nav.tiles.tile_graph import TileGraph, frozen_graph

VERTEX_BYTES = 24 + 12 + 4 + 1 + 21
"""Of a vertex: position, normal, offset, blocked, and the lists of a search."""
EDGE_BYTES = 8
"""Of an edge in one direction: neighbour and weight."""
FIELD_BYTES = 4 + 4
"""Of a vertex in a field that a planner keeps beside its search: distance and next vertex."""
MOST_PLACES = 2**31 - 1
"""Vertices and edges of all slots: what int32 can number."""


class TilePool:
    """Slots for tiles.

    Parameters
    ----------
    entries : iterable of TileEntry
        All tiles of the map.
    memory : float
        Bytes that the slots may take, those of a search and of the fields included.
    fields : int
        How many fields of distances over all slots planners keep.

    Attributes
    ----------
    slots : int
        Number of tiles that fit; their vertices and edges are numbered by int32, however much memory there is.
    """

    def __init__(self, entries: Iterable[TileEntry], memory: float, fields: int = 0) -> None:
        # One vertex more ends the last row of a tile.
        sizes = [(one.core_vertices + 1, one.neighbours + one.shared) for one in entries]
        self._vertices_of_slot, self._edges_of_slot = (max(column) for column in zip(*sizes, strict=True))
        vertex_bytes = VERTEX_BYTES + fields * FIELD_BYTES
        self.slot_bytes = vertex_bytes * self._vertices_of_slot + EDGE_BYTES * self._edges_of_slot
        most = MOST_PLACES // max(self._vertices_of_slot, self._edges_of_slot)
        self.slots = max(0, min(int(memory // self.slot_bytes), len(sizes), most))
        vertices, edges = self.slots * self._vertices_of_slot, self.slots * self._edges_of_slot
        # Memory that is not written yet is not taken either.
        self.vertices: FloatArray = np.empty((vertices, 3))
        self.normals = np.empty((vertices, 3), dtype=np.float32)
        self._offsets = np.empty(vertices + 1, dtype=np.int32)
        self._neighbours = np.empty(edges, dtype=np.int32)
        self._weights = np.empty(edges, dtype=np.float32)
        self._blocked = np.empty(vertices, dtype=np.bool_)
        self._distances = np.empty(vertices, dtype=np.float32)
        self._predecessors = np.empty(vertices, dtype=np.int32)
        self._slot_of: OrderedDict[TileKey, int] = OrderedDict()  # least recently used first
        self._links: dict[TileKey, NDArray[np.int64]] = {}
        self._used = 0

    @property
    def loaded(self) -> list[TileKey]:
        """Tiles with a slot, the least recently used first."""
        return list(self._slot_of)

    def first_vertex(self, key: TileKey) -> int:
        """Number in the pool of the first vertex of a loaded tile."""
        return int(self._slot_of[key] * self._vertices_of_slot)

    def search_arrays(self, keys: Iterable[TileKey]) -> tuple[Float32Array, IntArray]:
        """Distances and predecessors of the pool's vertices for a search over loaded tiles, valid until the next call.

        Distances of these tiles are inf. All else is what searches have left; seeds are for the caller to set.
        """
        for key in keys:
            first = self.first_vertex(key)
            self._distances[first : first + self._vertices_of_slot] = np.inf
        vertices = self._used * self._vertices_of_slot
        return self._distances[:vertices], self._predecessors[:vertices]

    def frontier(self, graph: SearchGraph, keys: Iterable[TileKey]) -> IntArray:
        """Vertices (n,) of tiles that the last search has reached, from which it goes on in another corridor."""
        firsts = [self.first_vertex(key) for key in keys]
        found = [frontier(graph, self._distances, first, first + self._vertices_of_slot) for first in firsts]
        return np.concatenate(found)

    def holds(self, key: TileKey) -> bool:
        """Whether a tile is loaded and has not changed since."""
        return key in self._links

    def reweigh(self, key: TileKey, tile: Tile, seen: TileGraph) -> None:
        """Take over other weights of a tile that it holds; its links are closed until the next corridor."""
        slot = self._slot_of[key]
        first, first_edge = slot * self._vertices_of_slot, slot * self._edges_of_slot
        weights = _with_links(tile, seen)
        self._weights[first_edge : first_edge + len(weights)] = weights
        self._blocked[first : first + tile.core_vertices] = seen.graph.blocked

    def drop(self, key: TileKey) -> None:
        """Load a tile anew when it is needed next, because it changed."""
        if key in self._slot_of:
            self._slot_of.move_to_end(key, last=False)
            self._links.pop(key, None)

    def hold(self, keys: Iterable[TileKey], read: Callable[[TileKey], tuple[Tile, TileGraph]]) -> None:
        """Load those of at most ``slots`` tiles that have no slot; ``read`` gives a tile with its weights."""
        wanted = list(keys)
        for key in wanted:
            if key in self._slot_of:
                self._slot_of.move_to_end(key)
        for key in wanted:
            if key not in self._links:
                self._load(key, *read(key))

    def _load(self, key: TileKey, tile: Tile, seen: TileGraph) -> None:
        slot = self._slot_of.pop(key, -1)
        if slot < 0 and self._used < self.slots:
            slot, self._used = self._used, self._used + 1
        elif slot < 0:
            gone, slot = self._slot_of.popitem(last=False)
            self._links.pop(gone, None)
        first, first_edge, count = slot * self._vertices_of_slot, slot * self._edges_of_slot, tile.core_vertices
        # 1. One more edge at the end of the row of every shared vertex.
        ends = tile.offsets[tile.shared + 1]
        neighbours = np.insert(tile.neighbours, ends, tile.shared)
        weights = _with_links(tile, seen)
        extra = np.zeros(count + 1, dtype=np.int32)
        extra[tile.shared + 1] = 1
        offsets = tile.offsets + np.cumsum(extra, dtype=np.int32)
        # 2. Everything into the slot; vertices beyond the tile's have no edges, but for the last, which is never met.
        own = slice(first, first + count)
        self.vertices[own], self.normals[own] = tile.vertices[:count], tile.normals
        self._blocked[own], self._blocked[first + count : first + self._vertices_of_slot] = seen.graph.blocked, True
        edges = slice(first_edge, first_edge + len(neighbours))
        self._neighbours[edges], self._weights[edges] = neighbours + first, weights
        self._offsets[first : first + count + 1] = offsets + first_edge
        self._offsets[first + count + 1 : first + self._vertices_of_slot] = first_edge + len(neighbours)
        self._offsets[first + self._vertices_of_slot] = first_edge + self._edges_of_slot
        # 3. Number, place in the pool, and link of every shared vertex.
        links = first_edge + offsets[tile.shared + 1] - 1
        columns = tile.numbers[tile.shared], first + tile.shared, links, tile.portal_of
        self._links[key] = np.array(columns, dtype=np.int64)
        self._slot_of[key] = slot

    def shared(self, keys: Iterable[TileKey]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Numbers in the map and places in the pool (n,) of the shared vertices of loaded tiles, one for each tile."""
        number, vertex, _, _ = np.concatenate([self._links[key] for key in keys], axis=1)
        return number, vertex

    def corridor(self, tiles: dict[TileKey, BoolArray]) -> SearchGraph:
        """The graph of loaded tiles, joined at some portals of each.

        Parameters
        ----------
        tiles : dict
            Tile -> which of its portals (p,) are open.

        Returns
        -------
        SearchGraph
            Vertices of the pool up to the last slot that was ever used; valid until the next call.
        """
        chosen: list[NDArray[np.int64]] = [np.zeros((4, 0), dtype=np.int64)]
        for key, is_open in tiles.items():
            links = self._links[key]
            self._weights[links[2]] = np.inf
            chosen.append(links[:, is_open[links[3]]])
        number, vertex, link, _ = np.concatenate(chosen, axis=1)
        order = np.lexsort((vertex, number))
        number, vertex, link = number[order], vertex[order], link[order]
        begins = np.flatnonzero(np.diff(number, prepend=-1))
        group_sizes = np.diff(begins, append=len(number))
        following = np.arange(1, len(number) + 1)
        following[begins + group_sizes - 1] = begins  # from the last of a circle to its first
        self._neighbours[link] = vertex[following]
        self._weights[link[np.repeat(group_sizes > 1, group_sizes)]] = 0.0
        vertices, edges = self._used * self._vertices_of_slot, self._used * self._edges_of_slot
        rows = self._offsets[: vertices + 1], self._neighbours[:edges], self._weights[:edges]
        return frozen_graph(*rows, self._blocked[:vertices])


def _with_links(tile: Tile, seen: TileGraph) -> Float32Array:
    """Weights of a tile's edges, with that of the impassable link at the end of the row of every shared vertex."""
    return np.insert(seen.graph.weights, tile.offsets[tile.shared + 1], np.float32(np.inf))
