"""The layers of a ``GraphMap``: what sensors see, and the distance kept from it."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from mbf_abstract.geometry import FloatArray
from mbf_abstract.geometry.arithmetic import exp
from mbf_abstract.maps.layers.inflation import InflationRadii
from mbf_abstract.maps.layers.layer import LayerParameters, MapLayer
from mbf_abstract.maps.layers.source_watch import SourceWatch
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.parameters import parameter

MAX_WAITING = 64
"""Most scans that wait for an update; older ones are dropped."""


class ObstacleParameters(LayerParameters):
    """Parameters of the obstacles."""

    sources: tuple[str, ...] = parameter((), "Names of the sensors that it listens to.", dynamic=False)
    expected_update_rate: float = parameter(
        1.0, "Longest allowed time between two scans of a sensor; 0 switches the check off.", unit="s", ge=0.0
    )
    robot_height: float = parameter(1.0, "Hits higher above the ground are not obstacles.", unit="m", gt=0.0)
    ground_tolerance: float = parameter(0.05, "Hits lower above the ground are part of it.", unit="m", ge=0.0)


class ObstacleLayer(MapLayer):
    """The newest scan of each sensor; obstacles that it no longer shows are removed."""

    parameters: ObstacleParameters

    def __init__(self, name: str, parameters: ObstacleParameters) -> None:
        super().__init__(name, parameters)
        self._watches = {source: SourceWatch(source) for source in parameters.sources}
        self._waiting: deque[RangeScan] = deque(maxlen=MAX_WAITING)
        self._newest: dict[str, RangeScan] = {}

    @property
    def source_names(self) -> tuple[str, ...]:
        """Names of the sensors."""
        return tuple(self._watches)

    def insert_scan(self, scan: RangeScan) -> None:
        """Keep a scan for the next update."""
        self._watches[scan.source].heard(scan.stamp)
        self._waiting.append(scan)

    def take_waiting(self) -> list[RangeScan]:
        """The scans since the last update, oldest first; they are in the map from now on."""
        scans = [self._waiting.popleft() for _ in range(len(self._waiting))]
        for scan in scans:
            self._newest[scan.source] = scan
            self._watches[scan.source].used()
        return scans

    def hits(self) -> FloatArray:
        """Points (k, 3) [m] that the newest scans hit."""
        return np.concatenate([np.zeros((0, 3)), *(scan.points for scan in self._newest.values())])

    def clear_area(self, center: FloatArray, size: float, inside: bool) -> None:
        """Forget what was hit inside, or outside, a square of side ``size`` [m] around a place (2,), from above."""
        self._waiting.clear()
        for source, scan in self._newest.items():
            within = (np.abs(scan.ends[:, :2] - center) <= 0.5 * size).all(axis=1)
            self._newest[source] = replace(scan, hits=scan.hits & (within != inside))
        for watch in self._watches.values():
            watch.cleared()

    def watched_sources(self) -> Iterator[tuple[SourceWatch, float]]:
        """All sensors, with one limit."""
        return ((watch, self.parameters.expected_update_rate) for watch in self._watches.values())


class InflationParameters(LayerParameters, InflationRadii):
    """Parameters of the inflation."""

    inflation_radius: float = parameter(0.6, "Distance from obstacles with a cost.", unit="m", ge=0.0)
    cost_scaling_factor: float = parameter(
        5.0, "Rate of decay of the costs beyond the robot's radius.", unit="1/m", ge=0.0
    )


class InflationLayer(MapLayer):
    """Costs near obstacles, which decay as costmap_2d's do: exp(-factor * (distance - radius of the robot))."""

    parameters: InflationParameters

    def costs(self, clearance: FloatArray, robot_radius: float) -> FloatArray:
        """Costs (n,) from 0 to 1 for distances (n,) [m] from obstacles."""
        costs = np.zeros(len(clearance))
        if self.parameters.enabled:
            near = clearance <= self.parameters.inflation_radius
            beyond = np.maximum(clearance[near] - robot_radius, 0.0)
            costs[near] = exp(-self.parameters.cost_scaling_factor * beyond)
        return costs
