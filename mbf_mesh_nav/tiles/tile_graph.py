"""A tile as the searches see it: the weighted vertex graph of its core, for one cost profile."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.arrays import BoolArray, Float32Array
from mbf_mesh_nav.kernels.layers.edge_weights import show_changes
from mbf_mesh_nav.kernels.mesh.topology import edges_of_neighbours
from mbf_mesh_nav.kernels.search.dijkstra import SearchGraph
from mbf_mesh_nav.map.snapshot import MeshSnapshot
from mbf_mesh_nav.tiles.index import CostProfile
from mbf_mesh_nav.tiles.portals import portal_costs
from mbf_mesh_nav.tiles.tile import Tile

EDGES_OF_A_STEP = 4.0
"""Step of the work lists in mean edges, as of ``leg_search.threshold_step``."""


@dataclass(frozen=True, eq=False)
class TileGraph:
    """The core of a tile under one profile.

    Attributes
    ----------
    snapshot : MeshSnapshot
        Costs, lethal flags and edge weights.
    mean_edge, longest_edge : float
        Lengths [m].
    """

    snapshot: MeshSnapshot
    graph: SearchGraph
    mean_edge: float
    longest_edge: float

    @property
    def threshold_step(self) -> float:
        """Step [m] of the work lists of a search over whole fields."""
        return EDGES_OF_A_STEP * self.mean_edge


def tile_graph(tile: Tile, costs: Float32Array, lethal: BoolArray, profile: CostProfile) -> TileGraph:
    """Weigh the edges of a tile's core by the costs and flags (c,) of a layer, as ``SnapshotSeries`` does for a map."""
    count, factor = tile.core_vertices, profile.edge_cost_factor
    core = tile.vertices[:count]
    _, lengths = edges_of_neighbours(core, tile.offsets, tile.neighbours)
    weights = np.empty(len(tile.neighbours), dtype=np.float32)
    shown_costs, shown_lethal = np.empty_like(costs), np.empty_like(lethal)
    everywhere = np.arange(count, dtype=np.int32)
    graph = tile.offsets, tile.neighbours, lengths
    show_changes(*graph, costs, lethal, factor, everywhere, shown_costs, shown_lethal, weights)
    snapshot = MeshSnapshot(0, shown_costs, shown_lethal, weights, factor)
    blocked = snapshot.blocked(profile.cost_limit)
    search = frozen_graph(tile.offsets, tile.neighbours, weights, blocked)
    return TileGraph(snapshot, search, float(np.mean(lengths)), float(np.max(lengths)))


def frozen_graph(*arrays: NDArray[Any]) -> SearchGraph:
    """A graph of read-only arrays, but for the blocked vertices: the types the planners' kernels are compiled for."""
    views = [array.view() for array in arrays]
    for view in views[:3]:
        view.flags.writeable = False
    return SearchGraph(*views)


def costs_between_portals(tile: Tile, costs: Float32Array, lethal: BoolArray, profile: CostProfile) -> Float32Array:
    """Costs (p, p) [m] between the portals of a tile under a profile."""
    seen = tile_graph(tile, costs, lethal, profile)
    return portal_costs(seen.graph, tile.shared, tile.portal_of, len(tile.portals), seen.threshold_step)
