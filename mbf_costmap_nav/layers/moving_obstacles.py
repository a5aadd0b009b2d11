"""Moving obstacles layer: where people and robots will be in the next seconds, and no longer where they were.

When to use: in both maps of a robot among people or other robots, after the obstacle layers and before the inflation
layer. Planners and sampling controllers then go around where something will be. When not: alone, as it marks no
obstacle that stands, nor the place where a moving one is now.
Cost: about 0.2 ms an update among 20 objects, see ``benchmarks/tracking.py``. Known failure: what comes out behind
a corner has no velocity in its first three scans.

Walls are known from the floor plans of the static layers of both costmaps; without any, all that is short enough is
tracked, and pieces of walls between other things may seem to move.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import FloatArray, Pose
from mbf_abstract.geometry.transform import TransformError
from mbf_abstract.maps.layers.layer import LayerParameters
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.maps.tracking.moving_obstacles import (
    MovingObstacles,
    MovingObstaclesParameters,
    Sighting,
    TrackingLayer,
)
from mbf_abstract.parameters import parameter
from mbf_costmap_nav.grid.costmap import EMPTY_BOX, FREE, INSCRIBED, LETHAL, CellArray, CellBox, GridGeometry
from mbf_costmap_nav.grid.footprint import Footprint
from mbf_costmap_nav.kernels.map.rasterisation import raise_discs
from mbf_costmap_nav.map.layer import CombinationMethod, GridLayer, LayerContext, clear_cells, combine, shifted


class MovingObstaclesLayerParameters(LayerParameters, MovingObstaclesParameters):
    """Parameters of the moving obstacles layer."""

    min_obstacle_height: float = parameter(0.0, "Points below this height (map frame) are ignored.", unit="m")
    max_obstacle_height: float = parameter(2.0, "Points above this height (map frame) are ignored.", unit="m")


class MovingObstaclesLayer(TrackingLayer, GridLayer):
    """Predicted places of tracked objects, and their trails. See the module's text for when to use it."""

    Parameters = MovingObstaclesLayerParameters
    parameters: MovingObstaclesLayerParameters

    def __init__(self, context: LayerContext) -> None:
        super().__init__(context)
        self._frame_id, self._static_maps = context.frame_id, context.static_maps
        self._for_plans = not context.rolling_window
        self._objects = MovingObstacles(self.parameters, context.frame_id)
        self._inscribed_radius = 0.0
        self._predicted = EMPTY_BOX
        self._left: FloatArray = np.zeros((0, 3))  # points of moving objects in the last scan

    @property
    def only_raises(self) -> bool:
        """True: what it frees was marked by sensors."""
        return True

    def set_footprint(self, footprint: Footprint, unpadded: Footprint) -> None:
        """Take over the inscribed radius."""
        self._inscribed_radius = footprint.inscribed_radius if len(footprint.vertices) > 2 else 0.0

    def match_geometry(self, geometry: GridGeometry) -> None:
        """Allocate cells without predictions and trails."""
        super().match_geometry(geometry)
        self._trail = np.zeros((geometry.height, geometry.width), dtype=np.bool_)
        self._predicted = EMPTY_BOX

    def shift(self, geometry: GridGeometry, dx: int, dy: int) -> None:
        """Move the kept cells."""
        super().shift(geometry, dx, dy)
        self._trail = shifted(self._trail, dx, dy, 0)
        self._predicted = geometry.box

    def parameters_changed(self) -> None:
        """Forget the trails if they are not to be freed any more."""
        if not self.parameters.clear_trails:
            self._trail.fill(False)

    def update_bounds(self, robot_pose: Pose | None, now: float, box: CellBox) -> CellBox:
        """Follow the objects through new scans; draw where they will be, note where they were."""
        for seen in self._objects.take_in(self.parameters, self._obstacle_points):
            box = box.union(self._note_trail(seen))
        before, self._predicted = self._predicted, self._draw(now, robot_pose)
        return box.union(before).union(self._predicted)

    def update_costs(self, cells: CellArray, box: CellBox) -> None:
        """Free the obstacles of the trails, then raise the costs of the predicted places."""
        window = cells[box.slices]
        window[self._trail[box.slices] & (window == LETHAL)] = FREE
        combine(cells, self.cells, box, CombinationMethod.MAXIMUM_WITHOUT_UNKNOWN_OVERWRITE)

    def _obstacle_points(self, scan: RangeScan) -> tuple[FloatArray, NDArray[np.int64]]:
        """The points of a scan that no floor plan explains, at height 0, and their rays; none while that is unknown."""
        limits, heights = self.parameters, scan.ends[:, 2]
        rays = np.flatnonzero((heights >= limits.min_obstacle_height) & (heights <= limits.max_obstacle_height))
        try:
            explained = self._static_maps.explain(scan.ends[rays], self._frame_id, limits.static_distance)
        except TransformError:
            explained = np.ones(len(rays), dtype=np.bool_)
        rays = rays[~explained]
        return np.asarray(scan.ends[rays] * (1.0, 1.0, 0.0)), rays

    def _note_trail(self, seen: Sighting) -> CellBox:
        """Add what moving objects have left to the trail, take out what is seen now; return the box that changes."""
        if not self.parameters.clear_trails:
            return EMPTY_BOX
        left, here = self._cells_of(self._left), self._cells_of(seen.points)
        self._left = seen.points[seen.of_moving]
        before = self._trail[here[:, 1], here[:, 0]].copy()
        self._trail[left[:, 1], left[:, 0]] = True
        self._trail[here[:, 1], here[:, 0]] = False
        return _box_of(np.concatenate([left, here[before]]))

    def _draw(self, now: float, robot: Pose | None) -> CellBox:
        """Draw the predicted places instead of the last ones; return their box."""
        self.cells[self._predicted.slices] = self.default_value
        p, grid = self.parameters, self.geometry
        driven_on = (
            None if self._for_plans else robot
        )  # plans lead past whoever is being passed, also from ahead of them
        predictions = self._objects.predictions(
            p, self._inscribed_radius, now, for_plans=self._for_plans, robot=driven_on
        )
        if not predictions:
            return EMPTY_BOX
        middles = np.concatenate([prediction.middles for prediction in predictions])
        radii = np.repeat([each.radius for each in predictions], [len(each.costs) for each in predictions])
        discs = np.column_stack([middles[:, :2] - (grid.origin_x, grid.origin_y), radii])
        discs /= grid.resolution
        values = ((INSCRIBED - 1) * np.concatenate([prediction.costs for prediction in predictions])).astype(np.uint8)
        raise_discs(self.cells, discs, values)
        corners = np.concatenate([discs[:, :2] - discs[:, 2:], discs[:, :2] + discs[:, 2:]])
        return _box_of(np.floor(corners).astype(np.int64)).clipped(grid.box)

    def _cells_of(self, points: FloatArray) -> NDArray[np.int32]:
        """Cells (k, 2) of the points (n, 3) [m] that lie on the grid."""
        cells, inside = self.geometry.world_to_cells(points)
        return cells[inside]

    def reset(self) -> None:
        """Forget all objects and trails."""
        super().reset()
        self._trail.fill(False)
        self._forget(None)

    def clear_area(self, box: CellBox, inside: bool) -> None:
        """Forget the objects and trails inside or outside of ``box``."""
        super().clear_area(box, inside)
        clear_cells(self._trail, box.clipped(self.geometry.box), inside, 0)
        x0, y0, resolution = self.geometry.origin_x, self.geometry.origin_y, self.geometry.resolution

        def within(places: FloatArray) -> NDArray[np.bool_]:
            ix, iy = (places[:, 0] - x0) / resolution, (places[:, 1] - y0) / resolution
            in_box = (ix >= box.x0) & (ix < box.x1) & (iy >= box.y0) & (iy < box.y1)
            return np.asarray(in_box == inside)

        self._forget(within)

    def _forget(self, within: Callable[[FloatArray], NDArray[np.bool_]] | None) -> None:
        self._objects.clear(within)
        self._left = np.zeros((0, 3))


def _box_of(cells: NDArray[np.integer]) -> CellBox:
    """Smallest box of cells (n, 2)."""
    if len(cells) == 0:
        return EMPTY_BOX
    low, high = cells.min(axis=0).tolist(), cells.max(axis=0).tolist()
    return CellBox(low[0], low[1], high[0] + 1, high[1] + 1)
