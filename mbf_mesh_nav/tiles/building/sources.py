"""Where the tiles of a map are cut from: a mesh in memory, or heights that are read window by window.

A source gives each tile its core faces and enough of what lies around them. What it gives depends on the tile alone,
not on other tiles or their order, so tiles may be built in any order and by several processes.
"""

from __future__ import annotations

import hashlib
import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.config.bounded_files import special_file
from mbf_abstract.geometry import FARTHEST_COORDINATE
from mbf_mesh_nav.arrays import BoolArray, FloatArray, IntArray
from mbf_mesh_nav.files.vertex_errors import VertexErrors
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh
from mbf_mesh_nav.mesh.mesh_report import MeshError
from mbf_mesh_nav.tiles.tile import TileKey

RINGS = 3
"""Rings of faces beyond the reach of the layers: normals and edge angles there look at neighbours of neighbours."""


@dataclass(frozen=True, eq=False)
class TilePart:
    """A part of the map: vertices (n, 3) [m], their numbers (n,) in the map, faces (m, 3), the core's first.

    ``errors`` are the standard errors of the heights of the vertices (n,), None where the map has none for each.
    """

    vertices: FloatArray
    numbers: NDArray[np.int64]
    faces: IntArray
    core_faces: int
    errors: VertexErrors | None = None


class TileSource(ABC):
    """A map to be cut into tiles."""

    @abstractmethod
    def keys(self, tile_size: float) -> list[TileKey]:
        """Tiles that may have faces, ascending."""

    @abstractmethod
    def part(self, key: TileKey, tile_size: float, reach: float) -> TilePart | None:
        """Core faces of a tile and what lies within ``reach`` [m] of them; None if it has no face."""

    @abstractmethod
    def digest(self) -> str:
        """Hexadecimal SHA-256 of the content."""


class MeshSource(TileSource):
    """A mesh in memory, without defects; a face belongs to the tile in which its centroid lies in plan view.

    Parameters
    ----------
    vertices, faces : (V, 3) float64 [m], (F, 3) int32
        A vertex's number in the map is its place here.
    errors : VertexErrors, optional
        Standard errors of the heights, if the map states them for each vertex.
    """

    def __init__(self, vertices: FloatArray, faces: IntArray, errors: VertexErrors | None = None) -> None:
        self._vertices, self._faces, self._errors = vertices, faces, errors
        corners = vertices[:, :2][faces]
        self._centroids = (corners[:, 0] + corners[:, 1] + corners[:, 2]) / 3.0

    def keys(self, tile_size: float) -> list[TileKey]:
        """Tiles that hold the centroid of a face."""
        return [(int(column), int(row)) for column, row in np.unique(self._cells(tile_size), axis=0)]

    def part(self, key: TileKey, tile_size: float, reach: float) -> TilePart | None:
        """See ``TileSource``; the boundary is ``RINGS`` rings of faces outside of the reach."""
        core = (self._cells(tile_size) == key).all(axis=1)
        if not core.any():
            return None
        inside = self._vertices[self._faces[core].ravel()]
        lower, upper = inside.min(axis=0)[:2] - reach, inside.max(axis=0)[:2] + reach
        chosen = ((self._vertices[:, :2] >= lower) & (self._vertices[:, :2] <= upper)).all(axis=1)
        for _ in range(RINGS):
            touched = chosen[self._faces].any(axis=1)
            chosen[self._faces[touched]] = True
        part = _numbered_part(self._vertices, self._faces, core, touched & ~core)
        return part if self._errors is None else replace(part, errors=self._errors.of(part.numbers))

    def digest(self) -> str:
        """Of vertices, faces and the errors of the heights."""
        digest = hashlib.sha256(np.ascontiguousarray(self._vertices).tobytes())
        digest.update(np.ascontiguousarray(self._faces).tobytes())
        for errors in self._errors or ():
            digest.update(errors.tobytes())
        return digest.hexdigest()

    def _cells(self, tile_size: float) -> NDArray[np.int64]:
        return np.floor(self._centroids / tile_size).astype(np.int64)


def _numbered_part(vertices: FloatArray, faces: IntArray, core: BoolArray, around: BoolArray) -> TilePart:
    """The part with the faces of two masks (F,)."""
    chosen = np.concatenate([faces[core], faces[around]])
    used = np.zeros(len(vertices), dtype=np.bool_)
    used[chosen] = True
    numbers = np.flatnonzero(used)
    place = np.cumsum(used, dtype=np.int32) - np.int32(1)
    return TilePart(vertices[numbers], numbers.astype(np.int64), place[chosen], int(core.sum()))


class HeightSource(TileSource):
    """Heights on a grid; a square between four samples belongs to one tile. Void samples (NaN) are holes.

    Parameters
    ----------
    heights : (ny, nx) float
        z [m], southern row first; anything of that shape whose windows numpy can take, such as a memory map. Only the
        windows of the tiles are read. Sample [iy, ix] has the number ``iy * nx + ix``.
    dx, dy : float
        Spacing of columns and rows [m]; sample [0, 0] lies at x = y = 0.
    """

    def __init__(self, heights: NDArray[np.floating], dx: float, dy: float) -> None:
        if len(heights.shape) != 2 or min(heights.shape) < 2:
            raise ValueError(f"heights must be (ny, nx) with at least 2 x 2 samples, got {heights.shape}")
        if not (0.0 < dx < math.inf and 0.0 < dy < math.inf):
            raise ValueError(f"the spacing must be positive, got dx={dx}, dy={dy}")
        if max((heights.shape[1] - 1) * dx, (heights.shape[0] - 1) * dy) > FARTHEST_COORDINATE:
            got = f"{heights.shape[1]} x {heights.shape[0]} samples with a spacing of {dx:g} x {dy:g} m"
            raise ValueError(f"heights must lie within {FARTHEST_COORDINATE:g} m of the first one, got {got}")
        self._heights, self._dx, self._dy = heights, dx, dy

    def keys(self, tile_size: float) -> list[TileKey]:
        """All tiles of the grid; raises ValueError where they would be smaller than a square of it."""
        if tile_size < max(self._dx, self._dy):
            spacing = f"{max(self._dx, self._dy):g} m of the heights"
            raise ValueError(f"expected a tile size of at least the spacing of {spacing}, got {tile_size:g} m")
        rows, columns = (
            -(-(count - 1) // squares)
            for count, squares in zip(self._heights.shape, self._squares(tile_size)[::-1], strict=True)
        )
        return [(column, row) for column in range(columns) for row in range(rows)]

    def part(self, key: TileKey, tile_size: float, reach: float) -> TilePart | None:
        """See ``TileSource``; reads the samples of the core and of the reach, and ``RINGS`` more on each side."""
        (ny, nx), squares = self._heights.shape, self._squares(tile_size)
        margin = math.ceil(reach / min(self._dx, self._dy)) + RINGS
        starts = [key[axis] * squares[axis] for axis in (0, 1)]
        ends = [min(start + count, limit - 1) for start, count, limit in zip(starts, squares, (nx, ny), strict=True)]
        left, bottom = (max(start - margin, 0) for start in starts)
        right, top = (min(end + margin + 1, limit) for end, limit in zip(ends, (nx, ny), strict=True))
        window = np.asarray(self._heights[bottom:top, left:right], dtype=np.float32)
        vertices, faces = heightfield_mesh(window, self._dx, self._dy, keep_grid=True)
        if len(faces) == 0:
            return None
        # 1. Number and place of every sample as in the whole grid, to the last bit.
        rows, columns = np.divmod(np.arange(window.size), window.shape[1])
        rows, columns = rows + bottom, columns + left
        vertices[:, 0], vertices[:, 1] = self._dx * columns, self._dy * rows
        # 2. The square of a face is that of its least column and row.
        column, row = columns[faces].min(axis=1), rows[faces].min(axis=1)
        core = (column >= starts[0]) & (column < ends[0]) & (row >= starts[1]) & (row < ends[1])
        if not core.any():
            return None
        part = _numbered_part(vertices, faces, core, ~core)
        return TilePart(part.vertices, (rows * nx + columns)[part.numbers], part.faces, part.core_faces)

    def digest(self) -> str:
        """Of spacing, shape and all heights, read row by row."""
        digest = hashlib.sha256(repr((self._heights.shape, self._dx, self._dy)).encode())
        for row in self._heights:
            digest.update(np.asarray(row, dtype=np.float32).tobytes())
        return digest.hexdigest()

    def _squares(self, tile_size: float) -> tuple[int, int]:
        """Squares of a tile along x and y."""
        return max(1, round(tile_size / self._dx)), max(1, round(tile_size / self._dy))


def open_heights(path: Path, max_samples: int) -> NDArray[np.floating]:
    """Heights of a ``.npy`` file as a memory map, which takes no memory.

    Raises
    ------
    MeshError
        The file cannot be read, is no grid of numbers, or holds more than ``max_samples``.
    """
    if not path.exists():
        raise MeshError(str(path), ["there is no such file"])
    try:
        if kind := special_file(path):
            raise ValueError(f"expected a file, got {kind}")
        heights: NDArray[np.floating] = np.load(path, mmap_mode="r", allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise MeshError(str(path), [f"cannot be read as heights: {error}"]) from error
    if not isinstance(heights, np.ndarray) or heights.ndim != 2 or heights.dtype.kind != "f":
        got = f"{heights.dtype} of shape {heights.shape}" if isinstance(heights, np.ndarray) else "an archive"
        raise MeshError(str(path), [f"expected an array (ny, nx) of floats, got {got}"])
    if heights.size > max_samples:
        raise MeshError(str(path), [f"holds {heights.size} heights, the limit is {max_samples}"])
    return heights
