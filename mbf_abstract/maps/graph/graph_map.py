"""A map that is a graph: places on the ground, edges between neighbours, and obstacles that sensors see.

Derive ``GraphMap`` in a backend of your own: give it the nodes, and the node at a place. Obstacle intake, inflation,
freshness and collision checks are the same for every graph and done here.

When to use: a round robot on one storey, up to some 100,000 nodes. When not: outlines that are not round, bridges.
Cost: one tree query of all nodes an update, about 5 ms for 10,000.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mbf_abstract.geometry import FloatArray, Pose
from mbf_abstract.geometry.arithmetic import norm
from mbf_abstract.geometry.polyline import places_between
from mbf_abstract.maps.avoided_places import AvoidedPlace
from mbf_abstract.maps.disc_map import DiscMap
from mbf_abstract.maps.graph.graph_layers import InflationLayer, InflationParameters, ObstacleLayer, ObstacleParameters
from mbf_abstract.maps.layered_map import LayeredMap
from mbf_abstract.maps.layers.layer_stack import LayerStack
from mbf_abstract.maps.queries import CellState, PlaceAnswer
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.parameters import ParameterModel, parameter

IntArray = NDArray[np.int_]
BoolArray = NDArray[np.bool_]


class GraphMapParameters(ParameterModel):
    """Parameters of every map of this kind; a backend derives it and adds its own."""

    robot_radius: float = parameter(0.3, "Radius of the robot.", unit="m", gt=0.0)
    obstacles: ObstacleParameters = parameter(ObstacleParameters(), "The layer of what sensors see.")
    inflation: InflationParameters = parameter(InflationParameters(), "The layer of costs near obstacles.")


@dataclass(frozen=True, eq=False)
class GraphState:
    """State of the map at one moment; never changed, a new one replaces it.

    Attributes
    ----------
    lethal : (n,) bool
        Nodes that no part of the robot may touch.
    clearance : (n,) float64
        Distance [m] from each node to the nearest lethal one; 0 = lethal, inf = there is none.
    costs : (n,) float64
        Cost of a metre in addition to its length: that of the ground, and up to 1 near obstacles.
    """

    lethal: BoolArray
    clearance: FloatArray
    costs: FloatArray


class GraphMap(LayeredMap, DiscMap):
    """A map of nodes with the layers ``obstacles`` and ``inflation``.

    Parameters
    ----------
    nodes : (n, 3) float
        Places on the ground [m].
    edges : (m, 2) int
        Neighbours that a robot can drive between, each pair once.
    lethal : (n,) bool
        Ground that no part of the robot may touch.
    ground_costs : (n,) float, optional
        Cost of a metre of the ground in addition to its length.

    Attributes
    ----------
    state : GraphState
        As of the last update.
    """

    def __init__(
        self,
        nodes: FloatArray,
        edges: IntArray,
        lethal: BoolArray,
        parameters: GraphMapParameters,
        frame_id: str,
        ground_costs: FloatArray | None = None,
    ) -> None:
        super().__init__()
        self.nodes, self.edges, self.frame_id = nodes, edges, frame_id
        self.robot_radius = parameters.robot_radius
        self.obstacles = ObstacleLayer("obstacles", parameters.obstacles)
        self.inflation = InflationLayer("inflation", parameters.inflation)
        self.layers = LayerStack([self.obstacles, self.inflation])
        self._ground_lethal = lethal
        self._ground_costs = np.zeros(len(nodes)) if ground_costs is None else ground_costs
        self._avoided: tuple[AvoidedPlace, ...] = ()
        self.state = GraphState(np.zeros(len(nodes), dtype=bool), np.full(len(nodes), np.inf), self._ground_costs)
        self._outdated = True
        self.update(None, 0.0)

    @abstractmethod
    def nodes_at(self, points: FloatArray) -> IntArray:
        """Node (k,) next to each of the points (k, 2 or 3) [m]; -1 where there is no ground."""

    def first_line_outside(self, positions: FloatArray) -> int:
        """Index of the first of positions (n, 3) [m] whose line to the next leaves the ground; -1 if none.

        Gaps narrower than the robot's radius may be overlooked.
        """
        places, lines = places_between(positions, self.robot_radius)
        outside = self.nodes_at(places) < 0
        return int(lines[np.argmax(outside)]) if outside.any() else -1

    # ------------------------------------------------------------------------------------------------- sensors
    def take_in(self, scan: RangeScan) -> None:
        """Add a scan to a memory of the map, beside the newest scan of each sensor; called in an update."""

    def seen_nodes(self) -> IntArray:
        """Nodes (k,) int with obstacles that sensors have seen: those below hits, up to the height of the robot."""
        limits, hits = self.obstacles.parameters, self.obstacles.hits()
        nodes = self.nodes_at(hits)
        height = hits[:, 2] - self.nodes[nodes, 2]
        blocking = (height > limits.ground_tolerance) & (height <= limits.robot_height)
        return np.asarray(nodes[(nodes >= 0) & blocking])

    def clear(self, layer_names: Iterable[str] | None = None) -> list[str]:
        """Remove what sensors have marked; the map is stale until the next scan of each sensor."""
        return self.clear_area(Pose.planar(0.0, 0.0), math.inf, layer_names)

    def clear_area(
        self, center: Pose, size: float, layer_names: Iterable[str] | None = None, *, inside: bool = True
    ) -> list[str]:
        """Do the same inside, or outside, a square of side ``size`` [m] around a pose."""
        cleared = [layer for layer in self.layers.chosen(layer_names) if layer is self.obstacles]
        with self._lock:
            for layer in cleared:
                layer.clear_area(np.array(center.position[:2]), size, inside)
            self._outdated = True
        return [layer.name for layer in cleared]

    def stale_reason(self, now: float) -> str:
        """Which layer raised, or which sensor is silent or has sent nothing since the map was cleared."""
        return self.layers.stale_reason(now)

    def update(self, robot_pose: Pose | None, now: float) -> None:
        """Take in scans and changes since the last update; raises what a layer raises, the next one tries again."""
        with self._lock:
            self.end_overrides(now)
            with self.layers.computing(self.obstacles):
                for scan in self.obstacles.take_waiting():
                    self._outdated = True
                    self.take_in(scan)
            if self._outdated or self.layers.problem:
                self._compute()
                self._outdated, self.layers.problem = False, ""

    def avoid(self, places: Sequence[AvoidedPlace]) -> None:
        """Let no plan lead over the nodes of these discs, nor of others that were given before."""
        self._avoided = tuple(places)

    def _compute(self) -> None:
        """Compute the layers again."""
        lethal = self._ground_lethal.copy()
        with self.layers.computing(self.obstacles):
            if self.obstacles.parameters.enabled:
                lethal[self.seen_nodes()] = True
        with self.layers.computing(self.inflation):
            seen_before = np.array_equal(lethal, self.state.lethal)  # most scans show nothing new
            clearance = self.state.clearance if seen_before else self._clearances(lethal)
            costs = self._ground_costs + self.inflation.costs(clearance, self.robot_radius)
        self.state = GraphState(lethal, clearance, costs)

    def _clearances(self, lethal: BoolArray) -> FloatArray:
        """Distances (n,) [m] to the nearest lethal node."""
        from scipy.spatial import cKDTree  # slow to import

        if not lethal.any():
            return np.full(len(self.nodes), np.inf)
        return np.asarray(cKDTree(self.nodes[lethal]).query(self.nodes)[0])

    def take_parameters(self, parameters: Any) -> None:
        """Take over ``robot_radius`` of ``GraphMapParameters``; layers have parameters of their own."""
        self.robot_radius, self._outdated = parameters.robot_radius, True

    def _replace_parameters(self, name: str, parameters: Any) -> None:
        self.layers[name].parameters = parameters
        self._outdated = True

    # ------------------------------------------------------------------------------------------- places
    def node_at(self, x: float, y: float) -> int:
        """Node next to a place [m]; -1 where there is no ground."""
        return int(self.nodes_at(np.array([[x, y]]))[0])

    def place(self, x: float, y: float, safety_dist: float = 0.0) -> PlaceAnswer:
        """State and cost of a place [m] for the robot's centre; INSCRIBED where it would touch something."""
        node, state = self.node_at(x, y), self.state
        if node < 0:
            return PlaceAnswer(CellState.OUTSIDE, 0.0)
        if state.lethal[node]:
            return PlaceAnswer(CellState.LETHAL, float(state.costs[node]))
        touches = state.clearance[node] <= self.robot_radius + safety_dist
        return PlaceAnswer(CellState.INSCRIBED if touches else CellState.FREE, float(state.costs[node]))

    def candidates(self, x: float, y: float, dist_tolerance: float) -> FloatArray:
        """Positions (k, 3) [m] of all nodes on which the robot's centre may be, wherever the pose asked for is."""
        return np.asarray(self.nodes[self.free_nodes()])

    def free_nodes(self) -> BoolArray:
        """Nodes (n,) on which the robot's centre may be in a plan."""
        free = self.state.clearance > self.robot_radius
        for place in self._avoided:
            free &= norm(self.nodes - np.asarray(place.centre.position)) > place.radius
        return np.asarray(free)

    def obstacles_near(self, x: float, y: float, within: float) -> FloatArray:
        """Places (n, 2) [m] of all lethal nodes."""
        return np.asarray(self.nodes[self.state.lethal, :2])

    def clearance(self, x: float, y: float) -> float:
        """Distance [m] of the nearest obstacle from the node at a place; 0 where there is no ground."""
        node = self.node_at(x, y)
        return 0.0 if node < 0 else float(self.state.clearance[node])


def grid_edges(shape: tuple[int, int]) -> IntArray:
    """(m, 2) pairs of neighbours in eight directions, of a grid (rows, columns) numbered row by row."""
    index = np.arange(shape[0] * shape[1]).reshape(shape)
    pairs: list[tuple[ArrayLike, ArrayLike]] = [
        (index[:, :-1], index[:, 1:]),
        (index[:-1], index[1:]),
        (index[:-1, :-1], index[1:, 1:]),
        (index[:-1, 1:], index[1:, :-1]),
    ]
    return np.concatenate([np.column_stack([np.ravel(start), np.ravel(end)]) for start, end in pairs])
