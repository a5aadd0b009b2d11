"""Voxel layer: an obstacle layer with heights, columns of up to 32 voxels kept as bits.

When to use: with depth cameras or 3D lidars, or several planar ones at different heights, where a ray over a low thing
must not clear it. When not: for one planar lidar the obstacle layer is cheaper and equal. Cost: about twice the
obstacle layer's for each ray, 8 bytes a cell. Known failure: obstacles above the top voxel are not recorded.

Thresholds and defaults are costmap_2d's voxel layer; a column without any ray keeps the value of unknown space.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import Pose
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.parameters import parameter
from mbf_costmap_nav.grid.costmap import EMPTY_BOX, CellBox, GridGeometry
from mbf_costmap_nav.kernels.map.rasterisation import fill_polygon
from mbf_costmap_nav.kernels.map.voxel import clear_voxel_rays, mark_voxels, project_columns
from mbf_costmap_nav.layers.obstacle import ObstacleLayer, ObstacleLayerParameters
from mbf_costmap_nav.map.layer import clear_cells, shifted
from mbf_costmap_nav.map.sensor_data import SourceParameters


class VoxelLayerParameters(ObstacleLayerParameters):
    """Parameters of the voxel layer."""

    origin_z: float = parameter(0.0, "Height of the lowest voxel's bottom.", unit="m", dynamic=False)
    z_resolution: float = parameter(0.2, "Height of a voxel.", unit="m", gt=0.0, dynamic=False)
    z_voxels: int = parameter(10, "Voxels in a column.", ge=1, le=32, dynamic=False)
    mark_threshold: int = parameter(0, "A column with more marked voxels than this is lethal.", ge=0, le=32)
    unknown_threshold: int = parameter(15, "A seen column with more unknown voxels is unknown.", ge=0, le=32)


class VoxelLayer(ObstacleLayer):
    """Marks and clears voxels. See the module's text for when to use it."""

    Parameters = VoxelLayerParameters
    parameters: VoxelLayerParameters

    def match_geometry(self, geometry: GridGeometry) -> None:
        """Allocate empty columns."""
        super().match_geometry(geometry)
        self.marked = np.zeros((geometry.height, geometry.width), dtype=np.uint32)
        self.seen = np.zeros_like(self.marked)

    def shift(self, geometry: GridGeometry, dx: int, dy: int) -> None:
        """Move the kept columns."""
        super().shift(geometry, dx, dy)
        self.marked, self.seen = shifted(self.marked, dx, dy, 0), shifted(self.seen, dx, dy, 0)

    def reset(self) -> None:
        """Make every voxel unknown."""
        super().reset()
        self.marked.fill(0)
        self.seen.fill(0)

    def clear_area(self, box: CellBox, inside: bool) -> None:
        """Make the columns inside or outside of ``box`` unknown."""
        super().clear_area(box, inside)
        for columns in (self.marked, self.seen):
            clear_cells(columns, box.clipped(self.geometry.box), inside, 0)

    def parameters_changed(self) -> None:
        """Judge all columns by the new thresholds."""
        self._project(self.geometry.box)

    def update_bounds(self, robot_pose: Pose | None, now: float, box: CellBox) -> CellBox:
        """Trace rays through the voxels, then project the touched columns to cells."""
        touched = super().update_bounds(robot_pose, now, EMPTY_BOX).clipped(self.geometry.box)
        if not touched.empty:
            self._project(touched)
        return box.union(touched)

    def _project(self, box: CellBox) -> None:
        limits = self.parameters
        project_columns(
            self.marked, self.seen, limits.z_voxels, limits.mark_threshold, limits.unknown_threshold,
            self.default_value, self.cells, box,
        )  # fmt: skip

    def _clear(self, seen: RangeScan, limits: SourceParameters, touched: NDArray[np.int64]) -> None:
        clear_voxel_rays(
            self.marked, self.seen, self.parameters.z_voxels, self._lower_corner, self._voxel, seen.origin, seen.ends,
            limits.raytrace_min_range, limits.raytrace_max_range, touched,
        )  # fmt: skip

    def _mark(self, seen: RangeScan, limits: SourceParameters, touched: NDArray[np.int64]) -> None:
        mark_voxels(
            self.marked, self.seen, self.parameters.z_voxels, self._lower_corner, self._voxel, seen.origin, seen.ends,
            seen.hits, limits.obstacle_min_range, limits.obstacle_max_range, touched,
        )  # fmt: skip

    def _free_polygon(self, corners: NDArray[np.float64]) -> CellBox:
        fill_polygon(self.marked, corners, 0)
        return CellBox(*fill_polygon(self.seen, corners, (1 << self.parameters.z_voxels) - 1))

    @property
    def _lower_corner(self) -> NDArray[np.float64]:
        return np.array([self.geometry.origin_x, self.geometry.origin_y, self.parameters.origin_z])

    @property
    def _voxel(self) -> NDArray[np.float64]:
        return np.array([self.geometry.resolution, self.geometry.resolution, self.parameters.z_resolution])
