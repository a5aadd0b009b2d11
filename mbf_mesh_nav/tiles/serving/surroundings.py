"""The part of a tiled map around a place, as a mesh map of its own; all storeys, with the stored layers.

It ends where it is cut off. Whoever asks it a question asks for so much that the cut does not matter.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.arrays import BoolArray, Float32Array, FloatArray, IntArray
from mbf_mesh_nav.map.layer import CostArray, LayerContext, LayerParameters, LethalArray, MeshLayer
from mbf_mesh_nav.map.layer_graph import LayerGraph
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.mesh.checked_mesh import CheckedMesh
from mbf_mesh_nav.mesh.topology import build_topology
from mbf_mesh_nav.tiles.index import Box
from mbf_mesh_nav.tiles.sensed import NOTHING_SENSED, SensedCosts
from mbf_mesh_nav.tiles.tile import Tile, TileKey
from mbf_mesh_nav.tiles.tiled_map import TiledMap

SENSED = "sensed"
"""Name of the layer with the sensed costs on surroundings outside the window."""


class StoredLayer(MeshLayer):
    """A layer with the values that the tiles hold."""

    @classmethod
    def reach(cls, parameters: LayerParameters) -> float:
        """0: nothing is computed."""
        return 0.0

    def compute(self) -> tuple[CostArray, LethalArray]:
        """The values it was given."""
        return self._costs, self._lethal


class Surroundings:
    """A part of a tiled map.

    Attributes
    ----------
    map : MeshMap
        With the stored values.
    numbers : (V,) int64
        Numbers of its vertices in the whole map.
    """

    def __init__(self, mesh_map: MeshMap, numbers: NDArray[np.int64]) -> None:
        self.map, self.numbers = mesh_map, numbers
        self._last = NOTHING_SENSED, mesh_map
        self._lock = threading.Lock()

    def with_sensed(self, sensed: SensedCosts) -> MeshMap:
        """A map with the worse of the stored and the sensed costs; they are its layer "sensed".

        It stays as it is when others ask for another one.
        """
        with self._lock:
            if sensed is not self._last[0]:
                self._last = sensed, self._laid_over(sensed)
            return self._last[1]

    def _laid_over(self, sensed: SensedCosts) -> MeshMap:
        stored = self.map.layers[str(self.map.default_layer)]
        values = sensed.laid_over(self.numbers, stored.costs, stored.lethal)
        if values is None:
            return self.map
        over = MeshMap(self.map.topology, self.map.frame_id, locator=self.map.locator)
        layers = LayerGraph([*self.map.layers.values(), stored_layer(over, SENSED, *values)])
        over.set_layers(layers, SENSED, self.map.edge_cost_factor)
        return over


def mesh_within(
    tiled: TiledMap, low: tuple[float, float], high: tuple[float, float], read: Callable[[TileKey], Tile]
) -> Surroundings | None:
    """The faces of a map whose bounding boxes in plan view touch a rectangle; None without any.

    Where tiles have different values for a vertex that they share, it has the worse ones.

    Parameters
    ----------
    tiled : TiledMap
        Its index and profile count; what it has loaded is not touched, so any thread may ask.
    low, high : (x, y) [m]
        Corners of the rectangle.
    read : callable
        Gives a sound tile.

    Raises
    ------
    MeshError
        A tile is damaged.
    """
    _, _, bottom, _, _, top = tiled.index.box
    box: Box = (*low, bottom, *high, top)
    parts = [part for key in tiled.index.tiles_in(box) if (part := _part_of(read(key), low, high)) is not None]
    if not parts:
        return None
    # 1. One vertex for each number of the whole map.
    numbers = np.concatenate([part.numbers for part in parts])
    known, first, vertex_of = np.unique(numbers, return_index=True, return_inverse=True)
    vertices: FloatArray = np.concatenate([part.vertices for part in parts])[first]
    starts = np.cumsum([0, *(len(part.vertices) for part in parts)])
    corners = [vertex_of[part.faces + start] for part, start in zip(parts, starts, strict=False)]
    faces: IntArray = np.concatenate(corners).astype(np.int32)
    own = np.arange(len(vertices), dtype=np.int32), np.arange(len(faces), dtype=np.int32)
    mesh_map = MeshMap(build_topology(CheckedMesh(vertices, faces, *own, own[0])), tiled.index.frame_id)
    # 2. The stored values, by the same numbers.
    costs, lethal = (
        np.concatenate(values, axis=1) for values in zip(*((p.costs, p.lethal) for p in parts), strict=True)
    )
    _put_layers(mesh_map, tiled, *_worst(costs, lethal, vertex_of.astype(np.int32), len(vertices)))
    return Surroundings(mesh_map, known[mesh_map.internal_to_input])


@dataclass(frozen=True, eq=False)
class _Part:
    """Of one tile's core: n vertices with their numbers in the whole map and their values, and the faces of them."""

    numbers: NDArray[np.int64]
    vertices: FloatArray
    faces: IntArray
    costs: Float32Array
    lethal: BoolArray


def _part_of(tile: Tile, low: tuple[float, float], high: tuple[float, float]) -> _Part | None:
    """The core faces of a tile whose bounding boxes in plan view touch a rectangle; None without any.

    A large face may lie over the rectangle with all of its corners outside.
    """
    faces = tile.faces[: int(tile.core_faces[0])]
    touching = np.ones(len(faces), dtype=np.bool_)
    for axis in (0, 1):
        along = tile.vertices[: tile.core_vertices, axis]
        for beyond in (along < low[axis], along > high[axis]):
            touching &= ~(beyond[faces[:, 0]] & beyond[faces[:, 1]] & beyond[faces[:, 2]])
    used, corners = np.unique(faces[touching], return_inverse=True)
    if not len(used):
        return None
    return _Part(
        tile.numbers[used],
        tile.vertices[used],
        corners.reshape(-1, 3).astype(np.int32),
        tile.costs[:, used],
        tile.lethal[:, used],
    )


def stored_layer(mesh_map: MeshMap, name: str, costs: CostArray, lethal: LethalArray) -> StoredLayer:
    """A layer with given values (V,) in internal numbering."""
    layer = StoredLayer(LayerContext(name, mesh_map.topology, mesh_map.locator, LayerParameters()))
    layer.replace(costs, lethal)
    return layer


def _worst(costs: Float32Array, lethal: BoolArray, vertex_of: IntArray, count: int) -> tuple[Float32Array, BoolArray]:
    """The greatest cost and the flags (L, count) of values (L, k) of some vertices, several times for some."""
    worst, flags = np.zeros((len(costs), count), dtype=np.float32), np.zeros((len(costs), count), dtype=np.bool_)
    for row in range(len(costs)):
        np.maximum.at(worst[row], vertex_of, costs[row])
        np.logical_or.at(flags[row], vertex_of, lethal[row])
    return worst, flags


def _put_layers(mesh_map: MeshMap, tiled: TiledMap, costs: Float32Array, lethal: BoolArray) -> None:
    """Layers with the values (L, V) in the numbering the mesh was given in, and the profile's as the default one."""
    order = mesh_map.internal_to_input
    layers = [
        stored_layer(mesh_map, name, costs[row][order], lethal[row][order])
        for row, name in enumerate(tiled.index.layers)
    ]
    mesh_map.set_layers(LayerGraph(layers), tiled.profile_layer, tiled.profile.edge_cost_factor)
