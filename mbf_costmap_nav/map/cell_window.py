"""The cells of a layered costmap: their grid, what the next update computes anew, and the copy that plugins get."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from mbf_abstract.geometry import Pose
from mbf_costmap_nav.grid.costmap import INSCRIBED, LETHAL, CellArray, CellBox, Costmap, GridGeometry
from mbf_costmap_nav.map.layer import shifted


class CellWindow:
    """Cells on a grid that may move; not thread-safe.

    Attributes
    ----------
    geometry : GridGeometry
        The grid; after it is replaced, ``forbid_all`` makes its cells.
    pending : CellBox
        Cells that the next update computes anew, whatever the layers report.
    renewals : int
        How often ``recompute_all`` was called.
    """

    def __init__(self, geometry: GridGeometry, default_cost: int, frame_id: str) -> None:
        self.geometry = geometry
        self.pending, self.renewals = geometry.box, 0
        self._default_cost, self._frame_id = default_cost, frame_id
        self._cells = self.default_cells()
        self._version = 0
        self._snapshot: Costmap | None = None

    def default_cells(self) -> CellArray:
        """Cells (height, width) that no layer has written."""
        return self._filled(self._default_cost)

    def compute_all(self) -> None:
        """Let the next update compute all cells, though no layer is another one."""
        self.pending = self.geometry.box

    def recompute_all(self) -> None:
        """Let the next update compute all cells, as a layer, the grid or the robot's outline is another one."""
        self.renewals += 1
        self.compute_all()

    def forbid_all(self) -> None:
        """Forbid all cells until the update is done: if a layer raises now, nobody plans over the last floor."""
        self._cells = self._filled(LETHAL)
        self.recompute_all()
        self._changed()

    @contextmanager
    def writing(self, box: CellBox) -> Iterator[CellArray]:
        """Let layers write the cells (height, width) of a box, which begin with the default cost."""
        self._cells[box.slices] = self._default_cost
        yield self._cells
        self._changed()

    def close_disc(self, centre: tuple[float, float], radius: float, box: CellBox) -> None:
        """Forbid the robot's centre, not its outline, in the cells of ``box`` whose middles lie in a disc [m]."""
        grid = self.geometry
        rows, columns = np.mgrid[box.slices]
        x = grid.origin_x + (columns + 0.5) * grid.resolution
        y = grid.origin_y + (rows + 0.5) * grid.resolution
        inside = (x - centre[0]) ** 2 + (y - centre[1]) ** 2 <= radius**2
        cells = self._cells[box.slices]
        cells[inside & (cells < INSCRIBED)] = INSCRIBED

    def centre_on(self, pose: Pose) -> tuple[int, int]:
        """Move the window by whole cells so that ``pose`` is in its middle; return by how many along x and y.

        Origins stay multiples of the resolution.
        """
        grid = self.geometry
        ix = round(pose.x / grid.resolution - grid.width / 2)
        iy = round(pose.y / grid.resolution - grid.height / 2)
        dx = ix - round(grid.origin_x / grid.resolution)
        dy = iy - round(grid.origin_y / grid.resolution)
        if dx or dy:
            origin = ix * grid.resolution, iy * grid.resolution
            self.geometry = GridGeometry(grid.width, grid.height, grid.resolution, *origin)
            self._cells = shifted(self._cells, dx, dy, self._default_cost)
            self.recompute_all()
        return dx, dy

    def snapshot(self, stamp: float) -> Costmap:
        """Read-only copy of the cells; the same object until they change."""
        if self._snapshot is None:
            cells = self._cells.copy()
            cells.flags.writeable = False
            self._snapshot = self.costmap(cells, stamp)
        return self._snapshot

    def costmap(self, cells: CellArray, stamp: float) -> Costmap:
        """Make a costmap of cells on this grid."""
        grid = self.geometry
        return Costmap(cells, grid.resolution, grid.origin_x, grid.origin_y, self._frame_id, stamp, self._version)

    def _filled(self, cost: int) -> CellArray:
        return np.full((self.geometry.height, self.geometry.width), cost, dtype=np.uint8)

    def _changed(self) -> None:
        self._version += 1
        self._snapshot = None
