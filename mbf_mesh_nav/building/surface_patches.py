"""The surface patches of a map under construction: one for each surface above each cell of a plan view."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.arrays import BoolArray, FloatArray, IntArray
from mbf_mesh_nav.kernels.building.columns import LOWEST, TOP
from mbf_mesh_nav.kernels.building.patches import link_patches
from mbf_mesh_nav.mesh.mesh_report import MeshError

MAX_CELLS = 200_000_000


@dataclass(frozen=True, eq=False)
class Grid:
    """Square cells of a plan view.

    Attributes
    ----------
    corner : (2,) float64
        x and y of the lower left corner [m].
    cell : float
        Side of a cell [m].
    """

    corner: FloatArray
    cell: float
    columns: int
    rows: int

    @classmethod
    def around(cls, points: FloatArray, cell: float) -> Grid:
        """Grid over points (n, 3), its lines at whole multiples of ``cell`` [m].

        Raises
        ------
        MeshError
            It would have more than ``MAX_CELLS`` cells.
        """
        lower, upper = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
        corner = np.floor(lower / cell) * cell
        columns, rows = (int(count) for count in np.floor((upper - corner) / cell) + 1.0)
        if columns * rows > MAX_CELLS:
            text = f"{columns} x {rows} cells of {cell:g} m are too many, the limit is {MAX_CELLS}"
            raise MeshError("point cloud", [text], "Choose larger ones with --cell, or fewer files")
        return cls(corner, cell, columns, rows)

    def centres(self, cells: IntArray) -> FloatArray:
        """Centres (n, 2) [m] of cells (n,)."""
        columns, rows = cells % self.columns, cells // self.columns
        return self.corner + self.cell * (np.stack([columns, rows], axis=1) + 0.5)


@dataclass(frozen=True, eq=False)
class SurfacePatches:
    """Arrays of one entry for each patch (P,), sorted by cell and, within a cell, from the bottom to the top.

    Attributes
    ----------
    cells, kinds : int32
        The cell of a patch, and what it is (see ``kernels.building.columns``).
    firsts, ends : int64
        Its points are numbers ``firsts`` to ``ends - 1``; none for patches that fill a hole.
    bottoms, tops : float64
        Lowest and highest of its points [m].
    heights : float64
        Of the surface at the centre of the cell [m].
    standing : int32
        Number of points that stand on it as an obstacle.
    """

    grid: Grid
    cells: IntArray
    kinds: IntArray
    firsts: NDArray[np.int64]
    ends: NDArray[np.int64]
    bottoms: FloatArray
    tops: FloatArray
    heights: FloatArray
    standing: IntArray

    @property
    def is_filled(self) -> BoolArray:
        """Mask (P,) of the patches without a point, which fill a hole."""
        return np.asarray(self.firsts == self.ends)

    @property
    def is_ground(self) -> BoolArray:
        """Mask (P,) of the lowest patches of their columns, and of those that fill a hole."""
        return np.asarray(self.kinds == LOWEST)

    @property
    def is_top(self) -> BoolArray:
        """Mask (P,) of the upper ends of walls, trunks and crowns."""
        return np.asarray(self.kinds == TOP)

    @property
    def centres(self) -> FloatArray:
        """Centres (P, 2) of the patches' cells [m]."""
        return self.grid.centres(self.cells)

    @property
    def offsets(self) -> IntArray:
        """First patch of each cell, and the number of patches at the end."""
        counts = np.bincount(self.cells, minlength=self.grid.columns * self.grid.rows)
        return np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)

    def links(self, rise: float) -> IntArray:
        """Links (P, 8) as in ``kernels.building.patches``, between heights that differ by at most ``rise`` [m]."""
        return link_patches(self.cells, self.heights, self.offsets, self.grid.columns, rise)

    def without(self, dropped: BoolArray) -> SurfacePatches:
        """Copy without the patches of a mask (P,)."""
        return self._taken(np.flatnonzero(~dropped))

    def with_fillings(self, cells: IntArray, heights: FloatArray) -> tuple[SurfacePatches, NDArray[np.int64]]:
        """Copy with patches of no points at ``heights`` (n,) [m] of ``cells`` (n,), and its order (P + n,).

        The order has numbers of the old patches, and from P on of the new ones.
        """
        none, count = np.zeros(len(cells), dtype=np.int64), np.zeros(len(cells), dtype=np.int32)
        joined = replace(
            self,
            cells=np.concatenate([self.cells, cells]),
            kinds=np.concatenate([self.kinds, count]),
            firsts=np.concatenate([self.firsts, none]),
            ends=np.concatenate([self.ends, none]),
            bottoms=np.concatenate([self.bottoms, heights]),
            tops=np.concatenate([self.tops, heights]),
            heights=np.concatenate([self.heights, heights]),
            standing=np.concatenate([self.standing, count]),
        )
        order = np.lexsort((joined.heights, joined.cells))
        return joined._taken(order), order

    def _taken(self, chosen: NDArray[np.int64]) -> SurfacePatches:
        return SurfacePatches(
            self.grid,
            self.cells[chosen],
            self.kinds[chosen],
            self.firsts[chosen],
            self.ends[chosen],
            self.bottoms[chosen],
            self.tops[chosen],
            self.heights[chosen],
            self.standing[chosen],
        )
