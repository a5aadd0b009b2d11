"""One tile of a map: a part of the mesh with what it needs of its neighbours, its layers and its portals, in one file.

Every face of the map belongs to exactly one tile, the *core* faces of that tile. Vertices at which cores meet are in
each of these tiles (*shared* vertices). Around the core lies the *overlap*: as much of the neighbours as the layers
look at, so that they have at every core vertex the values that they have on the whole mesh.

The file is an ``.npz`` without compression. It is written beside and renamed, so that there is no half a tile, and
what its headers promise is compared with its size before anything is read.
"""

from __future__ import annotations

import hashlib
from collections.abc import Collection
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.config.bounded_files import ArrayFileError, read_arrays
from mbf_abstract.whole_files import replacing
from mbf_mesh_nav.arrays import BoolArray, Float32Array, FloatArray, IntArray
from mbf_mesh_nav.mesh.mesh_report import MeshError
from mbf_mesh_nav.tiles.tile_arrays import FORMAT, misfit

TileKey = tuple[int, int]
"""Column and row of a tile in the grid of tiles."""


@dataclass(frozen=True, eq=False)
class Tile:
    """Arrays of one tile: n vertices of which c are of the core, L layers, s shared vertices, p portals, R profiles.

    Attributes
    ----------
    vertices : (n, 3) float64
        Positions [m]; those of the core come first.
    numbers : (n,) int64
        Number of every vertex in the whole map, by which tiles know the vertices they share.
    faces : (m, 3) int32
        Corners, counter-clockwise seen from above; those of the core come first.
    core_faces : (1,) int64
        Number of faces of the core.
    normals : (c, 3) float32
        Unit normals.
    offsets, neighbours : (c+1,), (e,) int32
        The vertex graph of the core, see ``MeshTopology.neighbour_offsets``.
    costs, lethal : (L, c) float32, bool
        Values of the layers.
    shared : (s,) int32
        Core vertices that belong to other tiles, too, ascending.
    portals : (p, 3) int64
        Cubes that hold shared vertices, see ``portals``, in ascending order.
    portal_of : (s,) int32
        Portal of every shared vertex.
    portal_costs : (R, p, p) float32
        Least cost [m] over the core from any vertex of one portal to any of another, inf without a path.
    build : (32,) uint8
        SHA-256 of what the tile was built from.
    values : (32,) uint8
        SHA-256 of the layers as they were built; that of ``costs`` and ``lethal`` unless a layer was changed since.
    """

    vertices: FloatArray
    numbers: NDArray[np.int64]
    faces: IntArray
    core_faces: NDArray[np.int64]
    normals: Float32Array
    offsets: IntArray
    neighbours: IntArray
    costs: Float32Array
    lethal: BoolArray
    shared: IntArray
    portals: NDArray[np.int64]
    portal_of: IntArray
    portal_costs: Float32Array
    build: NDArray[np.uint8]
    values: NDArray[np.uint8]

    @property
    def core_vertices(self) -> int:
        """Number of vertices of the core."""
        return len(self.normals)

    @property
    def is_as_built(self) -> bool:
        """Whether the layers have the values they were built with."""
        return np.array_equal(self.values, digest_of_layers(self.costs, self.lethal))


def digest_of_layers(costs: Float32Array, lethal: BoolArray) -> NDArray[np.uint8]:
    """SHA-256 (32,) of the values (L, c) of layers."""
    digest = hashlib.sha256(costs.tobytes())
    digest.update(lethal.tobytes())
    return np.frombuffer(digest.digest(), dtype=np.uint8)


def tile_file(folder: Path, key: TileKey) -> Path:
    """File of a tile in the folder of its map."""
    return folder / f"tile_{key[0]}_{key[1]}.npz"


def write_tile(path: Path, tile: Tile) -> None:
    """Write a tile; a file of that name is replaced when the new one is complete. ``MeshError`` if that fails."""
    try:
        with replacing(path) as unfinished:
            np.savez(unfinished, **{field.name: getattr(tile, field.name) for field in fields(tile)})
    except OSError as error:
        raise MeshError(str(path), [f"cannot be written: {error.strerror or error}"]) from error


def read_tile(path: Path) -> Tile:
    """Read a tile.

    Raises
    ------
    MeshError
        The file is missing, damaged or no tile; the text names the array.
    """
    return Tile(**read_tile_arrays(path, FORMAT))


def read_tile_arrays(path: Path, names: Collection[str]) -> dict[str, NDArray[Any]]:
    """Read some of a tile's arrays, by name; ``MeshError`` as of ``read_tile``."""
    try:
        arrays = read_arrays(path, path.stat().st_size, names)  # nothing in it is compressed
    except OSError as error:
        raise MeshError(str(path), [f"cannot be read: {error.strerror or error}"]) from error
    except ArrayFileError as error:
        raise MeshError(str(path), [str(error)]) from error
    if missing := [name for name in names if name not in arrays]:
        raise MeshError(str(path), [f"has no array '{missing[0]}'; it is not a tile"])
    if wrong := misfit(arrays):
        raise MeshError(str(path), [wrong])
    return arrays
