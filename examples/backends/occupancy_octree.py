"""A map backend that learns its map while it drives: an octree, fed by range sensors, with server, planner and queries.

When to use: as the pattern of a backend with sensors, or where the height of things matters: the robot drives under a
table that a flat map would call an obstacle. When not: ramps and storeys, the ground is taken to be flat.
"""

from __future__ import annotations

import heapq
import itertools
import math
from collections.abc import Mapping, Set
from dataclasses import dataclass
from typing import Any, ClassVar, cast

from octree import Column, OctreeMap, OctreeParameters

from mbf_abstract.config.configuration import Config
from mbf_abstract.drive.robot import RobotInformation
from mbf_abstract.geometry import FloatArray, Path
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.maps.disc_queries import DiscQueries
from mbf_abstract.maps.navigation_map import MapContext
from mbf_abstract.maps.queries import CellState, MapQueries, PlaceAnswer
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.parameters import ParameterModel
from mbf_abstract.plugins import AbstractPlanner, PlanRequest, PlanResult, PluginContext, PluginKind
from mbf_abstract.server.navigation_server import AbstractNavigationServer
from mbf_abstract.time.cancel import CancelToken

STEPS = [(dx, dy) for dx in (-1, 0, 1) for dy in (-1, 0, 1) if dx or dy]


@dataclass(frozen=True)
class OctreeContext(MapContext[OctreeMap]):
    """What plugins of this server are constructed with."""


class OctreePlanner(AbstractPlanner):
    """A* over columns in eight directions; what was never seen counts as free."""

    def __init__(self, context: OctreeContext) -> None:
        super().__init__(context)
        self.map = context.navigation_map

    def make_plan(self, request: PlanRequest) -> PlanResult:
        """Search from the column of the start to the column of the goal, by those of the via poses."""
        stops = [self.map.column(pose.x, pose.y) for pose in (request.start, *request.via, request.goal)]
        blocked, columns = self.map.view.blocked, stops[:1]
        for stop, code in ((stops[0], GetPathOutcome.BLOCKED_START), (stops[-1], GetPathOutcome.BLOCKED_GOAL)):
            if stop in blocked:
                return PlanResult(code, f"something is too near to {self.map.middles([stop])[0, :2]}")
        for start, goal in itertools.pairwise(stops):
            leg = self._search(blocked, start, goal, request.cancel_token)
            if request.cancel_token.cancelled:
                return PlanResult(GetPathOutcome.CANCELED, request.cancel_token.reason)
            if not leg:
                return PlanResult(GetPathOutcome.NO_PATH_FOUND, "walls all around, or farther than the reach")
            columns += leg[1:]
        path = Path.from_points(self.map.middles(columns), request.goal.orientation, frame_id=self.map.frame_id)
        return PlanResult(GetPathOutcome.SUCCESS, f"{path.length:.1f} m", path, path.length)

    def _search(self, blocked: Set[Column], start: Column, goal: Column, cancel_token: CancelToken) -> list[Column]:
        """A*: the columns from start to goal; none if there is no way, or canceled."""
        reach = self.map.parameters.reach / self.map.resolution
        waiting, lengths, before = [(math.dist(start, goal), start)], {start: 0.0}, {start: start}
        while waiting and not cancel_token.cancelled:
            _, here = heapq.heappop(waiting)
            if here == goal:
                return _way_to(goal, before)
            for dx, dy in STEPS:
                there, length = (here[0] + dx, here[1] + dy), lengths[here] + math.hypot(dx, dy)
                reachable = there not in blocked and math.dist(start, there) < reach
                if reachable and length < lengths.get(there, math.inf):
                    lengths[there], before[there] = length, here
                    heapq.heappush(waiting, (length + math.dist(there, goal), there))
        return []


def _way_to(goal: Column, before: Mapping[Column, Column]) -> list[Column]:
    columns = [goal]
    while before[columns[-1]] != columns[-1]:
        columns.append(before[columns[-1]])
    return columns[::-1]


class OctreeQueries(DiscQueries):
    """The map-independent questions; a place costs nothing."""

    def __init__(self, octree_map: OctreeMap, robot: RobotInformation, transforms: TransformBuffer) -> None:
        super().__init__(octree_map.frame_id, robot, transforms)
        self.map = octree_map

    def place(self, x: float, y: float, safety_dist: float) -> PlaceAnswer:
        """State of the robot's disc."""
        view, (ix, iy) = self.map.view, self.map.column(x, y)
        if (ix, iy) in view.occupied:
            return PlaceAnswer(CellState.LETHAL, 0.0)
        if any((ix + dx, iy + dy) in view.blocked for dx, dy in self.map.around(safety_dist)):
            return PlaceAnswer(CellState.INSCRIBED, 0.0)
        return PlaceAnswer(CellState.FREE if (ix, iy) in view.known else CellState.UNKNOWN, 0.0)

    def candidates(self, x: float, y: float, dist_tolerance: float) -> FloatArray:
        """The middles of all columns around."""
        ix, iy = self.map.column(x, y)
        return self.map.middles([(ix + dx, iy + dy) for dx, dy in self.map.around(dist_tolerance)])

    def clear_map(self) -> None:
        """Forget everything that was seen."""
        self.map.clear()


class OctreeServer(AbstractNavigationServer):
    """The server: it feeds scans to the map and holds the robot when none come."""

    backend: ClassVar[str] = "occupancy_octree"
    config_sections: ClassVar[Mapping[str, type[ParameterModel]]] = {"occupancy_octree": OctreeParameters}
    map: OctreeMap

    def load_map(self, config: Config) -> None:
        """Begin with nothing known."""
        parameters = cast(OctreeParameters, config.sections["occupancy_octree"].parameters)
        self.map = OctreeMap(parameters, config.parameters.global_frame)

    def make_context(self, kind: PluginKind, options: Mapping[str, Any], base: PluginContext) -> PluginContext:
        """Add the map."""
        return OctreeContext(**vars(base), navigation_map=self.map, transforms=self.runtime.transforms)

    @property
    def queries(self) -> MapQueries:
        """The map-independent questions."""
        return OctreeQueries(self.map, self.runtime.robot, self.runtime.transforms)

    def take_scan(self, scan: RangeScan) -> None:
        """Put a scan into the octree, placed by the transform of its stamp."""
        scan = scan.in_frame(self.map.frame_id, self.runtime.transforms)
        self.map.tree.insert(scan.origin, scan.ends, scan.hits)
        self.map.last_scan = scan.stamp
        self.map.look()

    def map_problem(self) -> str:
        """Whether the sensors have gone silent."""
        return self.map.stale_reason(self.runtime.clock.now())
