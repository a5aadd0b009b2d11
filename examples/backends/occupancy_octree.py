"""A map backend that builds its map while the robot drives: an octree, fed by range sensors.

When to use: as the pattern of a backend with a memory of its own, or where the height of things matters: the robot
drives under a table that a flat map would call an obstacle. When not: ramps and storeys, its ground is flat.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import ClassVar, cast

import numpy as np
from octree import Column, Octree

from mbf_abstract.config.configuration import Config
from mbf_abstract.geometry import FloatArray, Pose
from mbf_abstract.maps.graph.graph_map import GraphMap, GraphMapParameters, IntArray, grid_edges
from mbf_abstract.maps.graph.graph_server import GraphMapServer
from mbf_abstract.maps.queries import CellState, PlaceAnswer
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.parameters import ParameterModel, parameter


class OctreeParameters(GraphMapParameters):
    """The configuration's block ``occupancy_octree``."""

    resolution: float = parameter(0.1, "Edge of the smallest cube.", unit="m", gt=0.0)
    width: float = parameter(20.0, "Extent along x.", unit="m", gt=0.0)
    height: float = parameter(20.0, "Extent along y.", unit="m", gt=0.0)
    origin_x: float = parameter(0.0, "X of the lower-left corner.", unit="m")
    origin_y: float = parameter(0.0, "Y of the lower-left corner.", unit="m")


class OctreeMap(GraphMap):
    """The columns of an octree; a node is the centre of one on the ground; unseen columns are free."""

    def __init__(self, parameters: OctreeParameters, frame_id: str) -> None:
        p = parameters
        self.tree, self.known = Octree(p.resolution), frozenset[Column]()
        self.corner, self.resolution = np.array([p.origin_x, p.origin_y]), p.resolution
        self.shape = round(p.height / p.resolution), round(p.width / p.resolution)
        rows, columns = (index.ravel() for index in np.indices(self.shape))
        middles = self.corner + (np.column_stack([columns, rows]) + 0.5) * p.resolution
        nodes = np.column_stack([middles, np.zeros(len(middles))])
        super().__init__(nodes, grid_edges(self.shape), np.zeros(len(nodes), dtype=bool), parameters, frame_id)

    def nodes_at(self, points: FloatArray) -> IntArray:
        """Number of the column that holds each point; -1 off the extent."""
        ix, iy = np.floor((points[:, :2] - self.corner).T / self.resolution).astype(int)
        inside = (ix >= 0) & (ix < self.shape[1]) & (iy >= 0) & (iy < self.shape[0])
        return np.where(inside, iy * self.shape[1] + ix, -1)

    def take_in(self, scan: RangeScan) -> None:
        """Mark and clear by the rays of a scan."""
        self.tree.insert(scan.origin, scan.ends, scan.hits)

    def seen_nodes(self) -> IntArray:
        """Columns with something between the ground and the robot's height."""
        heights = self.obstacles.parameters.ground_tolerance, self.obstacles.parameters.robot_height
        self.known = frozenset(self.tree.columns(*heights, occupied=False))
        occupied = np.array(sorted(self.tree.columns(*heights, occupied=True)), dtype=float).reshape(-1, 2)
        nodes = self.nodes_at((occupied + 0.5) * self.resolution)
        return nodes[nodes >= 0]

    def clear_area(
        self, center: Pose, size: float, layer_names: Iterable[str] | None = None, *, inside: bool = True
    ) -> list[str]:
        """Forget all that the square holds, also what was free; ``clear`` asks for an endless one."""
        with self._lock:
            if cleared := super().clear_area(center, size, layer_names, inside=inside):
                self.tree.forget((center.x, center.y), 0.5 * size, inside)
        return cleared

    def place(self, x: float, y: float, safety_dist: float = 0.0) -> PlaceAnswer:
        """As on every graph; a free column that was never seen is UNKNOWN."""
        answer = super().place(x, y, safety_dist)
        column = int(np.floor(x / self.resolution)), int(np.floor(y / self.resolution))
        unseen = answer.state is CellState.FREE and column not in self.known
        return replace(answer, state=CellState.UNKNOWN) if unseen else answer


class OctreeServer(GraphMapServer):
    """The server; it starts with an empty map."""

    backend: ClassVar[str] = "occupancy_octree"
    config_sections: ClassVar[Mapping[str, type[ParameterModel]]] = {"occupancy_octree": OctreeParameters}

    def make_map(self, config: Config) -> OctreeMap:
        """Make an empty map."""
        parameters = cast(OctreeParameters, config.sections["occupancy_octree"].parameters)
        return OctreeMap(parameters, config.parameters.global_frame)
