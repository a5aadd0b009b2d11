"""How far it is, on one costmap, from where a robot must not stand to where it may, and what it may cross."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from mbf_abstract.geometry import FloatArray, Pose
from mbf_abstract.geometry.transform import Transform
from mbf_abstract.maps.manoeuvres import LEAST_LEFT
from mbf_abstract.maps.queries import PlanarPose
from mbf_costmap_nav.grid.costmap import UNKNOWN, CellBox, Costmap
from mbf_costmap_nav.grid.footprint import Footprint
from mbf_costmap_nav.grid.motion_check import blocked_cells
from mbf_costmap_nav.map.layered_costmap import LayeredCostmap


class Leaving:
    """Leaving one pose, on the map of the moment.

    Parameters
    ----------
    costmap : LayeredCostmap
    begin : Pose
        Of the robot, in the frame of the costmap; poses of its methods are as seen from there.
    reach : float
        How far [m] from there poses are asked for.
    free_cost : int
        The robot's centre is free below this cost.
    """

    def __init__(self, costmap: LayeredCostmap, begin: Pose, reach: float, free_cost: int) -> None:
        self._layered, self._begin, self._free_cost = costmap, begin, free_cost
        self._frame = Transform(begin.position, begin.orientation, begin.frame_id, "begin")
        self._map, self._footprint = costmap.snapshot(), costmap.footprint
        self._allowed: dict[float, tuple[Footprint, int]] = {}  # by the room: the outline, how much it touches now
        self._reach = reach + self._footprint.circumscribed_radius + 1.0
        self._counts_border = not costmap.rolling_window  # beyond the end of a window is more of the same

    @property
    def is_free(self) -> bool:
        """Whether the robot may stand where it begins."""
        return self._is_free_at(self._begin)

    @property
    def reason(self) -> str:
        """Why it may not stand where it begins."""
        x, y = self._begin.x, self._begin.y
        layer = self._layered.lethal_reason(x, y)
        cost = self._map.cost_at(x, y)
        closed = "off the map" if cost is None else f"of cost {cost}"
        return f"({x:.2f}, {y:.2f}) is {closed}{f', lethal in layer {layer}' if layer else ''}"

    def may_pass(self, pose: PlanarPose, room: float) -> bool:
        """Whether at a pose nothing stands within room [m] around its outline, or not more than where it begins."""
        if room not in self._allowed:
            outline = self._footprint.padded(room)
            self._allowed[room] = outline, self._touched(self._standing, self._begin, outline)
        outline, allowed = self._allowed[room]
        return self._touched(self._standing, self._on_map(pose), outline) <= allowed

    def left(self, pose: PlanarPose) -> float:
        """Distance [m] to where it may stand, at least; 0 there."""
        there = self._on_map(pose)
        if self._is_free_at(there):
            return 0.0
        distances, box = self._distances
        column, row = self._map.world_to_cell_clamped(there.x, there.y)
        inside = box.x0 <= column < box.x1 and box.y0 <= row < box.y1
        away = float(distances[row - box.y0, column - box.x0]) if inside else 0.0
        return max(away - self._map.resolution, LEAST_LEFT)

    def _on_map(self, pose: PlanarPose) -> Pose:
        return self._frame.apply_to_pose(Pose.planar(*pose, frame_id="begin"))

    def _is_free_at(self, pose: Pose) -> bool:
        cost = self._map.cost_at(pose.x, pose.y)
        if cost is None:
            return not self._counts_border
        is_low = cost == UNKNOWN or cost < self._free_cost
        return is_low and self._touched(self._map, pose, self._footprint) == 0

    def _touched(self, costmap: Costmap, pose: Pose, outline: Footprint) -> int:
        return blocked_cells(costmap, outline, pose.x, pose.y, pose.yaw, counts_border=self._counts_border)[0]

    @cached_property
    def _standing(self) -> Costmap:
        """The map around without drawn areas."""
        return self._layered.without_areas(self._begin.x, self._begin.y, self._reach)

    @cached_property
    def _distances(self) -> tuple[FloatArray, CellBox]:
        """Distances [m] of cells to the nearest one with a cost that is free, and which cells these are."""
        from scipy import ndimage  # takes 0.13 s to import

        x, y, reach = self._begin.x, self._begin.y, self._reach
        low = self._map.world_to_cell_clamped(x - reach, y - reach)
        high = self._map.world_to_cell_clamped(x + reach, y + reach)
        box = CellBox(*low, high[0] + 1, high[1] + 1)
        cells = self._map.cells[box.slices]
        closed = (cells >= self._free_cost) & (cells != UNKNOWN)
        if closed.all():
            return np.full(cells.shape, np.inf if self._counts_border else 0.0), box
        return np.asarray(self._map.resolution * ndimage.distance_transform_edt(closed)), box
