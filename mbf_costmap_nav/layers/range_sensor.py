"""Range sensor layer: sonars and infrared sensors, whose single reading fills a cone.

When to use: for sensors with one distance and a field of view of several degrees. When not: for lidars and cameras; the
obstacle layer places their points exactly. Cost: one visit per cell of a square around the cone. Known failure: the
side lobes of a sonar mark walls beside the axis at the wrong place; ``mark_threshold`` decides how soon.

Readings come as scans: the ray's end lies on the sensor's axis at the measured distance, its hit flag is false for a
reading at maximum range. Cells hold a probability that readings update by Bayes' rule. The cell at the measured
point itself is raised to a strong belief at once, as costmap_2d's range sensor layer does.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import Pose
from mbf_abstract.maps.layers.layer import LayerParameters
from mbf_abstract.maps.layers.source_watch import SourceWatch
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.parameters import parameter
from mbf_costmap_nav.grid.costmap import FREE, LETHAL, UNKNOWN, CellArray, CellBox, GridGeometry
from mbf_costmap_nav.kernels.map.sonar import update_cone
from mbf_costmap_nav.map.layer import CombinationMethod, CostmapLayer, LayerContext, clear_cells, combine, shifted
from mbf_costmap_nav.map.sensor_data import MAX_OBSERVATIONS, SourceTiming

UNDECIDED = 0.5
TARGET_PROBABILITY = 233.0 / 254.0
"""Belief of the cell at the measured point."""


class RangeSourceParameters(SourceTiming):
    """One range sensor."""

    field_of_view: float = parameter(math.radians(15.0), "Full angle of the cone.", unit="rad", gt=0.0, le=math.pi)


class RangeSensorLayerParameters(LayerParameters):
    """Parameters of the range sensor layer."""

    sources: dict[str, RangeSourceParameters] = parameter({}, "Range sensors by name.", dynamic=False)
    clear_on_max_reading: bool = parameter(False, "Free the whole cone when nothing was seen.")
    mark_threshold: float = parameter(0.8, "A cell believed occupied above this is lethal.", gt=0.5, lt=1.0)
    clear_threshold: float = parameter(0.2, "A cell believed occupied below this is free.", gt=0.0, lt=0.5)


class RangeSensorLayer(CostmapLayer):
    """Cones of single readings. See the module's text for when to use it."""

    Parameters = RangeSensorLayerParameters
    parameters: RangeSensorLayerParameters
    marks_obstacles = True
    """It belongs before an inflation layer."""

    def __init__(self, context: LayerContext) -> None:
        super().__init__(context)
        self.watches = {name: SourceWatch(name) for name in self.parameters.sources}
        self._waiting: deque[RangeScan] = deque(maxlen=MAX_OBSERVATIONS)

    def match_geometry(self, geometry: GridGeometry) -> None:
        """Start undecided everywhere."""
        super().match_geometry(geometry)
        self.probability: NDArray[np.float32] = np.full((geometry.height, geometry.width), UNDECIDED, dtype=np.float32)

    def shift(self, geometry: GridGeometry, dx: int, dy: int) -> None:
        """Move the beliefs with the window."""
        super().shift(geometry, dx, dy)
        self.probability = shifted(self.probability, dx, dy, UNDECIDED)

    def reset(self) -> None:
        """Clear all readings."""
        self.probability.fill(UNDECIDED)
        self._drop_waiting()

    def clear_area(self, box: CellBox, inside: bool) -> None:
        """Clear the readings inside or outside of ``box``, and the queued ones, which would mark them again."""
        clear_cells(self.probability, box.clipped(self.geometry.box), inside, UNDECIDED)
        self._drop_waiting()

    def _drop_waiting(self) -> None:
        self._waiting.clear()
        for watch in self.watches.values():
            watch.cleared()

    @property
    def source_names(self) -> tuple[str, ...]:
        """Names of the configured sensors."""
        return tuple(self.watches)

    def insert_scan(self, scan: RangeScan) -> None:
        """Keep a reading for the next update; unlike points, every reading counts once."""
        self.watches[scan.source].heard(scan.stamp)
        self._waiting.append(scan)

    def watched_sources(self) -> Iterator[tuple[SourceWatch, float]]:
        """All sensors, each with its limit."""
        sources = self.parameters.sources
        return ((watch, sources[name].expected_update_rate) for name, watch in self.watches.items())

    def update_bounds(self, robot_pose: Pose | None, now: float, box: CellBox) -> CellBox:
        """Update the beliefs with the queued readings."""
        while self._waiting:
            seen = self._waiting.popleft()
            limits = self.parameters.sources[seen.source]
            self.watches[seen.source].used()
            for end, hit in zip(seen.ends, seen.hits, strict=True):
                box = box.union(self._take(seen.origin, end, bool(hit), limits))
        return box

    def _take(
        self, origin: NDArray[np.float64], end: NDArray[np.float64], hit: bool, limits: RangeSourceParameters
    ) -> CellBox:
        if not hit and not self.parameters.clear_on_max_reading:
            return CellBox(0, 0, 0, 0)
        grid = self.geometry
        lower_left = np.array([grid.origin_x, grid.origin_y])
        changed = CellBox(
            *update_cone(
                self.probability, lower_left, grid.resolution, origin, end, limits.field_of_view / 2.0, not hit
            )
        )
        target = grid.world_to_cell(float(end[0]), float(end[1]))
        if hit and target is not None:
            ix, iy = target
            self.probability[iy, ix] = TARGET_PROBABILITY
            changed = changed.union(CellBox(ix, iy, ix + 1, iy + 1))
        return changed

    def update_costs(self, cells: CellArray, box: CellBox) -> None:
        """Write decided cells; free ones replace only unknown ones."""
        window = self.probability[box.slices]
        decided = np.full(window.shape, UNKNOWN, dtype=np.uint8)
        decided[window > self.parameters.mark_threshold] = LETHAL
        decided[window < self.parameters.clear_threshold] = FREE
        whole = CellBox(0, 0, box.x1 - box.x0, box.y1 - box.y0)
        combine(cells[box.slices], decided, whole, CombinationMethod.MAXIMUM)
