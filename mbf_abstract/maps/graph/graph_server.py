"""A server on a ``GraphMap``: scans go in, questions are answered, the map is kept up to date.

>>> class MyServer(GraphMapServer):
...     backend = "mine"
...     config_sections = {"mine": MyParameters}
...
...     def make_map(self, config):
...         return MyMap(config.sections["mine"].parameters, config.parameters.global_frame)
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import Any

import numpy as np

from mbf_abstract.config.configuration import Config
from mbf_abstract.geometry import FloatArray
from mbf_abstract.maps.disc_queries import DiscQueries
from mbf_abstract.maps.graph.graph_map import GraphMap
from mbf_abstract.maps.navigation_map import MapContext
from mbf_abstract.maps.queries import MapQueries, PlaceAnswer
from mbf_abstract.maps.scan_intake import ScanIntake, ScanTarget
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.plugins import PluginContext, PluginKind
from mbf_abstract.server.navigation_server import AbstractNavigationServer
from mbf_abstract.time.ticker import Ticker

UPDATE_PERIOD = 0.1  # s


class GraphMapServer(AbstractNavigationServer):
    """A server with one map that is a graph; write ``make_map``."""

    navigation_map: GraphMap

    @abstractmethod
    def make_map(self, config: Config) -> GraphMap:
        """Make the map of a configuration; raises where its files are bad."""

    def load_map(self, config: Config) -> None:
        """Make the map and keep it up to date."""
        self.navigation_map = graph = self.make_map(config)
        layers = graph.layers
        target = ScanTarget(graph.frame_id, lambda: layers.source_names, layers.listens_to, graph.insert_scan)
        self._scans = ScanIntake(self.runtime, {self.backend: target})
        clock = self.runtime.clock
        self._updates = Ticker(
            clock, self.runtime.events, lambda: graph.update(None, clock.now()), UPDATE_PERIOD, f"{self.backend} map"
        )

    def make_context(self, kind: PluginKind, options: Mapping[str, Any], base: PluginContext) -> PluginContext:
        """Add the map."""
        transforms = self.runtime.transforms
        return MapContext(**vars(base), navigation_map=self.navigation_map, transforms=transforms)

    @property
    def queries(self) -> MapQueries:
        """The map-independent questions."""
        return GraphQueries(self)

    def take_scan(self, scan: RangeScan) -> None:
        """Feed a scan to the map, as ``ScanIntake.take``, whose errors it raises."""
        self._scans.take(scan)

    def ground_heights(self, x: float, y: float) -> tuple[float, ...]:
        """Height of the node at a place, if there is one."""
        node = self.navigation_map.node_at(x, y)
        return () if node < 0 else (float(self.navigation_map.nodes[node, 2]),)

    def map_problem(self) -> str:
        """Which sensor is silent, if one is."""
        return self.navigation_map.stale_reason(self.runtime.clock.now())

    def close_map(self) -> None:
        """End the updates."""
        if hasattr(self, "_updates"):
            self._updates.stop()


class GraphQueries(DiscQueries):
    """The questions to a graph."""

    def __init__(self, server: GraphMapServer) -> None:
        self._map, runtime = server.navigation_map, server.runtime
        super().__init__(self._map.frame_id, runtime.robot, runtime.transforms)
        self._clock = runtime.clock

    def place(self, x: float, y: float, safety_dist: float) -> PlaceAnswer:
        """State and cost of the robot's disc."""
        return self._map.place(x, y, safety_dist)

    def candidates(self, x: float, y: float, dist_tolerance: float) -> FloatArray:
        """All nodes on which the robot's middle may be."""
        return np.asarray(self._map.nodes[self._map.free_nodes()])

    def clear_map(self) -> None:
        """Forget what sensors have marked."""
        self._map.clear()
        self.update_map()

    def update_map(self) -> None:
        """Show what was seen since the last update."""
        self._map.update(None, self._clock.now())
