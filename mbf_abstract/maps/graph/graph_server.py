"""A server on a ``GraphMap``, with scan intake, queries and updates.

>>> class MyServer(GraphMapServer):
...     backend = "mine"
...     config_sections = {"mine": MyParameters}
...
...     def make_map(self, config):
...         return MyMap(config.sections["mine"].parameters, config.parameters.global_frame)
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from mbf_abstract.config.configuration import Config
from mbf_abstract.maps.disc_map import disc_radius
from mbf_abstract.maps.graph.graph_map import GraphMap
from mbf_abstract.maps.map_plugin import MapContext
from mbf_abstract.maps.served_map import ServedMap
from mbf_abstract.plugins import PluginContext, PluginKind
from mbf_abstract.server.map_server import MapServer

UPDATE_FREQUENCY = 10.0  # Hz


class GraphMapServer(MapServer):
    """A server with one map that is a graph, in the first of its ``config_sections``; write ``make_map``."""

    map_type = GraphMap
    navigation_map: GraphMap

    @abstractmethod
    def make_map(self, config: Config) -> GraphMap:
        """Make the map of a configuration; raises where its files are bad."""

    def serve_maps(self, config: Config) -> Iterator[ServedMap[Any]]:
        """Make the map and keep it up to date."""
        section = next(iter(self.config_sections))
        self.navigation_map = self.make_map(config)
        parameters = config.sections[section].parameters
        yield ServedMap(self.navigation_map, self.runtime, section, parameters, UPDATE_FREQUENCY)

    def footprint_changes(self, footprint: str | Sequence[Sequence[float]] | float) -> Mapping[str, Any]:
        """The radius of a round robot."""
        return {"robot_radius": disc_radius(footprint)}

    def make_context(self, kind: PluginKind, options: Mapping[str, Any], base: PluginContext) -> PluginContext:
        """Add the map."""
        transforms = self.runtime.transforms
        return MapContext(**vars(base), navigation_map=self.navigation_map, transforms=transforms, scans=self.scans)

    def ground_heights(self, x: float, y: float) -> tuple[float, ...]:
        """Height [m] of the node at a place (x, y) [m] of the global frame, if there is one."""
        node = self.navigation_map.node_at(x, y)
        return () if node < 0 else (float(self.navigation_map.nodes[node, 2]),)
