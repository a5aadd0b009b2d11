"""Denoise layer: frees obstacle cells in groups too small to be real.

When to use: after obstacle layers fed by a sensor with speckle noise, before the inflation layer. When not: where a
thin pole may be one cell wide. Cost: one labelling of the changed box, about 10 ns a cell. Known failure: a real thing
smaller than ``minimal_group_size`` cells is removed too; keep that number small.

A group is a set of obstacle cells connected by sides, or by sides and corners. The rule is Nav2's denoise layer.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from mbf_abstract.geometry import Pose
from mbf_abstract.maps.layers.layer import LayerParameters
from mbf_abstract.parameters import parameter
from mbf_costmap_nav.grid.costmap import FREE, LETHAL, UNKNOWN, CellArray, CellBox, GridGeometry
from mbf_costmap_nav.map.layer import CostmapLayer, shifted


class DenoiseLayerParameters(LayerParameters):
    """Parameters of the denoise layer."""

    minimal_group_size: int = parameter(2, "Smaller groups of cells are freed; 1 keeps all.", ge=1, le=1000)
    group_connectivity_type: Literal[4, 8] = parameter(8, "Neighbours of a cell: 4 by sides, 8 with corners.")
    no_information_is_obstacle: bool = parameter(False, "Whether unknown cells belong to groups, and can be noise.")


class DenoiseLayer(CostmapLayer):
    """Frees small groups. See the module's text for when to use it."""

    Parameters = DenoiseLayerParameters
    parameters: DenoiseLayerParameters

    def match_geometry(self, geometry: GridGeometry) -> None:
        """Drop the record of the cells before denoising."""
        super().match_geometry(geometry)
        self._obstacles = np.zeros((geometry.height, geometry.width), dtype=np.bool_)

    def shift(self, geometry: GridGeometry, dx: int, dy: int) -> None:
        """Move with the window."""
        super().shift(geometry, dx, dy)
        self._obstacles = shifted(self._obstacles, dx, dy, 0)

    def update_bounds(self, robot_pose: Pose | None, now: float, box: CellBox) -> CellBox:
        """Grow the box: a new cell may complete a group that reaches this far."""
        return box.grown(self.parameters.minimal_group_size)

    def update_costs(self, cells: CellArray, box: CellBox) -> None:
        """Free the small groups of the box.

        A group that extends beyond the box is judged by the obstacles remembered there; one that is too small ends
        within ``minimal_group_size`` cells.
        """
        window = cells[box.slices]
        obstacles = window == LETHAL
        if self.parameters.no_information_is_obstacle:
            obstacles |= window == UNKNOWN
        self._obstacles[box.slices] = obstacles
        around = box.grown(self.parameters.minimal_group_size).clipped(self.geometry.box)
        noise = small_groups(
            self._obstacles[around.slices], self.parameters.minimal_group_size, self.parameters.group_connectivity_type
        )
        x, y = box.x0 - around.x0, box.y0 - around.y0
        window[noise[y : y + box.y1 - box.y0, x : x + box.x1 - box.x0]] = FREE


def small_groups(obstacles: NDArray[np.bool_], minimal_size: int, connectivity: Literal[4, 8]) -> NDArray[np.bool_]:
    """Mask of the cells in groups of fewer than ``minimal_size`` cells.

    Parameters
    ----------
    obstacles : (height, width) bool
    minimal_size : int
        Size of the smallest group that is kept.
    connectivity : {4, 8}
        Neighbours of a cell.
    """
    labels, _ = ndimage.label(obstacles, structure=ndimage.generate_binary_structure(2, connectivity // 4))
    sizes = np.bincount(labels.ravel())
    sizes[0] = minimal_size  # label 0 is the free space
    return np.asarray((sizes < minimal_size)[labels])
