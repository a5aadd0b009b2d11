"""A map backend of its own in one file: a 2.5D grid of heights, with server, planner and queries.

When to use: as the pattern of a backend, or for open ground of a known shape. When not: bridges, overhangs, sensors.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, cast

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt
from scipy.sparse import coo_array, csgraph

from mbf_abstract.config.configuration import Config
from mbf_abstract.drive.robot import RobotInformation
from mbf_abstract.geometry import FloatArray, Path
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.maps.disc_map import DiscMap
from mbf_abstract.maps.disc_queries import DiscQueries
from mbf_abstract.maps.navigation_map import MapContext
from mbf_abstract.maps.queries import CellState, MapQueries, PlaceAnswer
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.parameters import ParameterModel, parameter
from mbf_abstract.plugins import AbstractPlanner, PlanRequest, PlanResult, PluginContext, PluginKind
from mbf_abstract.server.navigation_server import AbstractNavigationServer


class ElevationGridParameters(ParameterModel):
    """The configuration's block ``elevation_grid``."""

    file: str = parameter(..., "File of a (rows, columns) array of heights [m], as numpy.save writes it.")
    resolution: float = parameter(0.5, "Distance of two samples.", unit="m", gt=0.0)
    max_slope: float = parameter(0.5, "Lethal above this inclination.", unit="rad", gt=0.0, lt=1.57)
    robot_radius: float = parameter(0.3, "Radius of the robot.", unit="m", ge=0.0)


class ElevationGrid(DiscMap):
    """The map: heights (ny, nx) [m] at ``resolution`` [m] with row 0 at y = 0, and what follows from them."""

    def __init__(self, heights: FloatArray, parameters: ElevationGridParameters, frame_id: str) -> None:
        self.heights, self.frame_id, self.robot_radius = heights, frame_id, parameters.robot_radius
        self.resolution = parameters.resolution
        rise = np.hypot(*np.gradient(heights, self.resolution))
        self.slope = np.arctan(np.nan_to_num(rise, nan=np.inf))  # unknown ground counts as a wall
        steps = distance_transform_edt(np.pad(self.slope <= parameters.max_slope, 1))[1:-1, 1:-1]
        self.clearance = steps * self.resolution  # [m] to the next sample that is lethal or off the map; 0 = lethal

    def index(self, x: float, y: float) -> int:
        """Flat index of the sample next to a point [m], -1 outside the grid."""
        (ny, nx), iy, ix = self.heights.shape, round(y / self.resolution), round(x / self.resolution)
        return iy * nx + ix if 0 <= iy < ny and 0 <= ix < nx else -1

    def obstacles_near(self, x: float, y: float, within: float) -> FloatArray:
        """Places (n, 2) [m] of the lethal samples around, and of those that the grid does not have."""
        (ny, nx), reach = self.heights.shape, np.arange(-1 - within // self.resolution, 2 + within // self.resolution)
        ix, iy = np.meshgrid(np.rint(x / self.resolution) + reach, np.rint(y / self.resolution) + reach)
        lethal = (ix < 0) | (ix >= nx) | (iy < 0) | (iy >= ny)
        lethal[~lethal] = self.clearance[iy[~lethal].astype(int), ix[~lethal].astype(int)] == 0.0
        return np.column_stack([ix[lethal], iy[lethal]]) * self.resolution

    def points(self, samples: NDArray[np.int_]) -> FloatArray:
        """Positions (n, 3) [m] of samples given by flat index (n,)."""
        iy, ix = np.unravel_index(samples, self.heights.shape)
        return np.column_stack([ix * self.resolution, iy * self.resolution, self.heights[iy, ix]])

    def graph(self) -> coo_array:
        """Sparse matrix of the 3D lengths [m] between free neighbours, each pair once."""
        index = np.arange(self.heights.size).reshape(self.heights.shape)
        pairs = [(index[:, :-1], index[:, 1:]), (index[:-1], index[1:])]
        pairs += [(index[:-1, :-1], index[1:, 1:]), (index[:-1, 1:], index[1:, :-1])]
        start, end = (np.concatenate([pair[side].ravel() for pair in pairs]) for side in (0, 1))
        free = (self.clearance > self.robot_radius).ravel()
        start, end = np.array([start, end])[:, free[start] & free[end]]
        lengths = np.linalg.norm(self.points(end) - self.points(start), axis=1)
        return coo_array((lengths, (start, end)), shape=(index.size, index.size))

    def state(self, x: float, y: float, safety_dist: float = 0.0) -> tuple[CellState, float]:
        """State of the robot at a point, and the slope [rad] there as its cost."""
        index = self.index(x, y)
        if index < 0:
            return CellState.OUTSIDE, 0.0
        clearance, slope = float(self.clearance.flat[index]), float(self.slope.flat[index])
        if clearance == 0.0:
            return CellState.LETHAL, slope
        return (CellState.FREE if clearance > self.robot_radius + safety_dist else CellState.INSCRIBED), slope


@dataclass(frozen=True)
class ElevationContext(MapContext[ElevationGrid]):
    """What plugins of this server are constructed with."""


class ElevationPlanner(AbstractPlanner):
    """Dijkstra's search over the samples; the shortest way on the ground in eight directions."""

    def __init__(self, context: ElevationContext) -> None:
        super().__init__(context)
        self.grid = context.navigation_map
        self._graph = self.grid.graph().tocsr()

    def make_plan(self, request: PlanRequest) -> PlanResult:
        """Search from the sample next to the start to the sample next to the goal, by those next to the via poses."""
        if request.cancel_token.cancelled:
            return PlanResult(GetPathOutcome.CANCELED, request.cancel_token.reason)
        stops = (request.start, *request.via, request.goal)
        for pose in stops:
            state, slope = self.grid.state(pose.x, pose.y)
            if state is not CellState.FREE:
                code = GetPathOutcome.BLOCKED_START if pose is request.start else GetPathOutcome.BLOCKED_GOAL
                return PlanResult(code, f"({pose.x:.2f}, {pose.y:.2f}) is {state.name}, slope {slope:.2f} rad")
        ends = [self.grid.index(pose.x, pose.y) for pose in stops]
        lengths, before = csgraph.dijkstra(self._graph, False, ends[:-1], return_predecessors=True)
        if not np.isfinite(length := lengths[range(len(ends) - 1), ends[1:]].sum()):
            return PlanResult(GetPathOutcome.NO_PATH_FOUND, "start and goal are not connected")
        samples = ends[-1:]
        for came_from, start in zip(before[::-1], ends[-2::-1], strict=True):  # each leg from its end to its start
            while samples[0] != start:
                samples.insert(0, came_from[samples[0]])
        points, frame_id = self.grid.points(np.array(samples)), self.grid.frame_id
        path = Path.from_points(points, request.goal.orientation, frame_id=frame_id)
        return PlanResult(GetPathOutcome.SUCCESS, f"{length:.1f} m over ground", path, float(length))


class ElevationQueries(DiscQueries):
    """The map-independent questions; the map never changes, so clearing and updating do nothing."""

    def __init__(self, grid: ElevationGrid, robot: RobotInformation, transforms: TransformBuffer) -> None:
        super().__init__(grid.frame_id, robot, transforms)
        self._grid = grid

    def place(self, x: float, y: float, safety_dist: float) -> PlaceAnswer:
        """State and slope of the robot's disc."""
        return PlaceAnswer(*self._grid.state(x, y, safety_dist))

    def candidates(self, x: float, y: float, dist_tolerance: float) -> FloatArray:
        """All samples where the robot's middle may be."""
        return self._grid.points(np.flatnonzero(self._grid.clearance > self._grid.robot_radius))


class ElevationGridServer(AbstractNavigationServer):
    """The server: it loads the map and hands it to the plugins, the rest is inherited."""

    backend: ClassVar[str] = "elevation_grid"
    config_sections: ClassVar[Mapping[str, type[ParameterModel]]] = {"elevation_grid": ElevationGridParameters}
    grid: ElevationGrid

    def load_map(self, config: Config) -> None:
        """Read the array."""
        parameters = cast(ElevationGridParameters, config.sections["elevation_grid"].parameters)
        heights = np.load(config.path.parent / parameters.file, allow_pickle=False).astype(np.float64)
        self.grid = ElevationGrid(heights, parameters, config.parameters.global_frame)

    def make_context(self, kind: PluginKind, options: Mapping[str, Any], base: PluginContext) -> PluginContext:
        """Add the grid."""
        return ElevationContext(**vars(base), navigation_map=self.grid, transforms=self.runtime.transforms)

    @property
    def queries(self) -> MapQueries:
        """The map-independent questions."""
        return ElevationQueries(self.grid, self.runtime.robot, self.runtime.transforms)

    def take_scan(self, scan: RangeScan) -> None:
        """Look away: this map is static."""

    def ground_heights(self, x: float, y: float) -> tuple[float, ...]:
        """Height of the next sample, if there is one."""
        height = np.nan if (index := self.grid.index(x, y)) < 0 else float(self.grid.heights.flat[index])
        return () if np.isnan(height) else (height,)
