"""Portals between tiles, what it costs at least to pass between them, and the graph they form.

Shared vertices that lie in one cube are one portal: on a grid of cubes that all tiles know, so tiles that share
vertices agree on portals without knowing each other. Storeys that are less apart than the side of a cube may have a
portal in common. Between two portals of a tile counts the least cost over its core, from any vertex of the one to any
of the other; within a portal nothing costs, not even from one storey to another, so bounds are lower there, and paths
do not change storeys.

Every path is a sequence of stretches within one core each, between shared vertices. So no path costs less than the
sequence of its portals in this graph: its shortest paths are lower bounds of the exact ones. They are close where
portals are hardly longer than edges; where they are longer, steps between portals that lie side by side make them far
too low. Estimates (``estimated_costs``) make up for that, and bound nothing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import networkx
import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.arrays import Float32Array, IntArray
from mbf_mesh_nav.kernels.search.dijkstra import SearchGraph, propagate_distances
from mbf_mesh_nav.tiles.tile import TileKey

NO_TARGETS = np.zeros(0, dtype=np.int32)
NO_OFFSETS = np.zeros(0, dtype=np.float32)
NOT_CANCELLED = np.zeros(1, dtype=np.uint8)

Portal = tuple[int, int, int]
"""A portal: its cube."""


def group_shared(positions: NDArray[np.float64], length: float) -> tuple[NDArray[np.int64], IntArray]:
    """Portals (p, 3) of shared vertices at positions (s, 3) [m], and which of them each belongs to (s,).

    Cubes have edges of ``length`` [m]; a multiple of it lies in the middle of a cube, as a border between tiles does.
    """
    cubes = np.floor(positions / length + 0.5).astype(np.int64)
    portals, portal_of = np.unique(cubes, axis=0, return_inverse=True)
    return portals.reshape(-1, 3), portal_of.reshape(-1).astype(np.int32)


def costs_to_portals(
    graph: SearchGraph,
    shared: IntArray,
    portal_of: IntArray,
    count: int,
    seeds: IntArray,
    seed_costs: Float32Array,
    threshold_step: float,
) -> Float32Array:
    """Least cost (count,) [m] over a tile's core from seeds (k,), which begin with their costs (k,), to its portals."""
    distances = np.full(len(graph.blocked), np.inf, dtype=np.float32)
    distances[seeds] = seed_costs
    predecessors = np.full(len(distances), -1, dtype=np.int32)
    propagate_distances(graph, distances, predecessors, seeds, threshold_step, NO_TARGETS, NO_OFFSETS, NOT_CANCELLED)
    least = np.full(count, np.inf, dtype=np.float32)
    np.minimum.at(least, portal_of, distances[shared])
    return least


def portal_costs(
    graph: SearchGraph, shared: IntArray, portal_of: IntArray, count: int, threshold_step: float
) -> Float32Array:
    """Least cost (count, count) [m] over a tile's core between its portals; symmetric, 0 on the diagonal."""
    costs = np.full((count, count), np.inf, dtype=np.float32)
    for portal in range(count):
        members = shared[portal_of == portal]
        free = members[~graph.blocked[members]]
        nothing = np.zeros(len(free), dtype=np.float32)
        costs[portal] = costs_to_portals(graph, shared, portal_of, count, free, nothing, threshold_step)
    # One stretch driven in both directions is summed up in two orders.
    return np.minimum(costs, costs.T)


def estimated_costs(bounds: Float32Array, portals: NDArray[np.int64], length: float, cubes: float) -> Float32Array:
    """What it costs about (p, p) [m] from the middle of one portal of a tile to that of another; inf as the bounds.

    A bound holds for the nearest vertices of two portals. Added is what the middles are farther apart than these, at
    the usual cost of a metre in the tile.

    Parameters
    ----------
    bounds : (p, p) float32
        Least costs between any vertices [m].
    portals : (p, 3) int64
    length : float
        Side of a cube [m].
    cubes : float
        Cubes along the side of a tile; where that is a whole number, portals along a border have no width across it.
    """
    half = np.full(portals.shape, 0.5)
    half[:, :2] = np.where(portals[:, :2] % cubes == 0.0, 0.0, 0.5)
    half[(half[:, :2] == 0.0).all(axis=1), :2] = 0.5  # at a corner of tiles borders cross
    apart = np.abs(portals[:, None] - portals[None]).astype(np.float64)
    gaps = np.maximum(apart - half[:, None] - half[None], 0.0)
    middles, nearest = (length * np.sqrt((parts * parts).sum(axis=2)) for parts in (apart, gaps))
    is_far = np.isfinite(bounds) & (nearest >= length)
    rate = float(np.median(bounds[is_far] / nearest[is_far])) if is_far.any() else 1.0
    estimates: Float32Array = (bounds + max(rate, 1.0) * (middles - nearest)).astype(np.float32)
    return estimates


@dataclass(frozen=True, eq=False)
class TilePortals:
    """Portals (p, 3) of one tile and the costs (p, p) [m] between them."""

    portals: NDArray[np.int64]
    costs: Float32Array


class PortalGraph:
    """The portals of all tiles.

    Attributes
    ----------
    portals : list of (int, int, int)
        The cube of each, ascending.
    """

    def __init__(self, tiles: Mapping[TileKey, TilePortals]) -> None:
        self._tiles = dict(tiles)
        self.portals: list[Portal] = sorted({portal for one in tiles.values() for portal in _names(one)})
        number = {portal: place for place, portal in enumerate(self.portals)}
        self._numbers = {
            key: np.array([number[portal] for portal in _names(one)], dtype=np.int32) for key, one in tiles.items()
        }
        self._graph: SearchGraph | None = None
        self._step = 1.0  # m, of the work lists of its searches

    def portals_of(self, key: TileKey) -> IntArray:
        """Numbers (p,) of a tile's portals, in the order of the tile's file."""
        return self._numbers[key]

    def change(self, key: TileKey, portals: TilePortals) -> None:
        """Take over new costs between the portals of a tile."""
        self._tiles[key] = portals
        self._graph = None

    def least_costs(self, ends: Sequence[tuple[TileKey, Float32Array]]) -> Float32Array:
        """Least sums of costs [m] from a place to every portal (P,).

        Parameters
        ----------
        ends : sequence of (tile, (p,) float32)
            Tiles that hold the place, and the costs from it to their portals.
        """
        graph = self._search_graph()
        distances = np.full(len(self.portals), np.inf, dtype=np.float32)
        for key, costs in ends:
            np.minimum.at(distances, self._numbers[key], costs)
        seeds = np.flatnonzero(np.isfinite(distances)).astype(np.int32)
        predecessors = np.full(len(distances), -1, dtype=np.int32)
        propagate_distances(graph, distances, predecessors, seeds, self._step, NO_TARGETS, NO_OFFSETS, NOT_CANCELLED)
        return distances

    def as_networkx(self) -> networkx.MultiGraph[int]:
        """The same graph for algorithms of your own: nodes have their ``cube``, edges ``tile`` and ``weight`` [m]."""
        graph: networkx.MultiGraph[int] = networkx.MultiGraph()
        graph.add_nodes_from((place, {"cube": portal}) for place, portal in enumerate(self.portals))
        for key, one in self._tiles.items():
            numbers = self._numbers[key].tolist()
            rows, columns = np.nonzero(np.triu(np.isfinite(one.costs), 1))
            graph.add_edges_from(
                (numbers[row], numbers[column], {"tile": key, "weight": weight})
                for row, column, weight in zip(
                    rows.tolist(), columns.tolist(), one.costs[rows, columns].tolist(), strict=True
                )
            )
        return graph

    def _search_graph(self) -> SearchGraph:
        """All costs between portals as one vertex graph for the kernels; kept until a tile changes."""
        if self._graph is None:
            starts, ends, weights = [], [], []
            for key, one in sorted(self._tiles.items()):
                rows, columns = np.nonzero(np.isfinite(one.costs) & ~np.eye(len(one.costs), dtype=np.bool_))
                starts.append(self._numbers[key][rows])
                ends.append(self._numbers[key][columns])
                weights.append(one.costs[rows, columns])
            nothing = np.zeros(0, dtype=np.int32)
            start, end = np.concatenate([nothing, *starts]), np.concatenate([nothing, *ends])
            order = np.lexsort((end, start))
            offsets = np.zeros(len(self.portals) + 1, dtype=np.int32)
            np.cumsum(np.bincount(start, minlength=len(self.portals)), out=offsets[1:])
            weight = np.concatenate([NO_OFFSETS, *weights])[order].astype(np.float32)
            self._step = float(weight.mean()) if len(weight) else 1.0
            self._graph = SearchGraph(offsets, end[order], weight, np.zeros(len(self.portals), dtype=np.bool_))
        return self._graph


def _names(one: TilePortals) -> list[Portal]:
    return [(int(x), int(y), int(z)) for x, y, z in one.portals]
