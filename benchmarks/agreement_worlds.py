"""Small random rooms on both maps, for ``agreement.py``: a map, a start and a goal where the robot fits."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

import numpy as np

from mbf_abstract.config.registry import PluginRegistry
from mbf_abstract.geometry import Pose, Twist, quaternions_from_axes
from mbf_abstract.geometry.arcs import arc_poses
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.maps.queries import CellState, PlaceQuery
from mbf_abstract.plugins import PluginKind
from mbf_costmap_nav.grid.costmap import Costmap
from mbf_costmap_nav.grid.footprint_check import FootprintCheck
from mbf_costmap_nav.map.costmap_config import CostmapParameters, build_layered_costmap
from mbf_costmap_nav.plugins import CostmapContext
from mbf_mesh_nav.kernels.search.forbidden_surface import rank_at
from mbf_mesh_nav.layers.inflation import InflationLayer
from mbf_mesh_nav.map.layer import LayerContext, MeshLayer
from mbf_mesh_nav.map.layer_graph import LayerGraph
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.plugins import MeshContext

SIDE, RESOLUTION, PERIOD = 6.0, 0.05, 0.05
OUTLINE = [(0.5, 0.25), (-0.5, 0.25), (-0.5, -0.25), (0.5, -0.25)]
CAR_OUTLINE = [(0.8, 0.25), (-0.2, 0.25), (-0.2, -0.25), (0.8, -0.25)]
TURNING_RADIUS, CAR_SIDE = 0.7, 9.0
RADIUS = 0.25
PADDED = PlaceQuery(use_padded_footprint=True)


class Clock:
    """Time that a drive moves."""

    time = 1.0

    def now(self) -> float:
        """Time [s]."""
        return self.time


class Robot:
    """Where it is; nothing asks for it here."""

    def pose(self) -> Pose:
        """Pose at the origin."""
        return Pose.planar(0.0, 0.0)

    def velocity(self) -> Twist:
        """Zero."""
        return Twist()

    def recent_track(self) -> np.ndarray:
        """Nothing driven."""
        return np.zeros((0, 3))


@dataclass(frozen=True)
class Box:
    """A part of the floor where nothing may stand [m]."""

    x0: float
    x1: float
    y0: float
    y1: float

    def holds(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Which points lie in it."""
        return (x >= self.x0) & (x < self.x1) & (y >= self.y0) & (y < self.y1)


def walls(side: float) -> list[Box]:
    """Around a room of ``side`` [m]."""
    return [
        Box(0, side, 0, 0.05),
        Box(0, side, side - 0.05, side),
        Box(0, 0.05, 0, side),
        Box(side - 0.05, side, 0, side),
    ]


WALLS = walls(SIDE)


def random_boxes(rng: np.random.Generator, is_open: bool = False, side: float = SIDE) -> list[Box]:
    """Walls around unless it is open, four to eleven boxes, and up to two walls with a gap of 0.7 to 1.5 m."""
    boxes = [] if is_open else walls(side)
    for _ in range(rng.integers(4, 12)):
        (x, y), (w, h) = rng.uniform(0.0, side, 2), rng.uniform(0.1, 1.0, 2)
        boxes.append(Box(x, x + w, y, y + h))
    for _ in range(rng.integers(0, 3)):
        at, gap = rng.uniform(0.2 * side, 0.8 * side), rng.uniform(0.7, 1.5)
        begin = rng.uniform(0.0, side - gap)
        parts = [Box(at, at + 0.1, 0, begin), Box(at, at + 0.1, begin + gap, side)]
        boxes += parts if rng.random() < 0.5 else [Box(p.y0, p.y1, p.x0, p.x1) for p in parts]
    return boxes


class World(ABC):
    """One floor with its map, and a start and a goal where the robot fits; None as ends if there are none."""

    backend: str
    map: Any
    side = SIDE

    def __init__(self, seed: int, is_open: bool = False) -> None:
        self.clock = Clock()
        rng = np.random.default_rng(seed)
        self.build(random_boxes(rng, is_open, self.side))
        self.ends = self._ends(rng)

    @abstractmethod
    def build(self, boxes: list[Box]) -> None:
        """Make the map of a floor with boxes."""

    @abstractmethod
    def plugin(self, kind: PluginKind, name: str) -> Any:
        """Make a plugin on the map, with its defaults."""

    @abstractmethod
    def pose_on(self, x: float, y: float, yaw: float) -> Pose:
        """Pose of a robot that stands on the floor."""

    @abstractmethod
    def fits(self, pose: Pose) -> bool:
        """Whether the outline touches nothing."""

    def first_misfit(self, path: Any) -> int:
        """Index of the first pose of a path at which a controller's check finds a collision; -1 if it fits at all."""
        return next((index for index, pose in enumerate(path) if not self.fits(pose)), -1)

    def moved(self, pose: Pose, command: Any) -> Pose:
        """Where a robot without inertia is one period later."""
        turn = (pose.x, pose.y, pose.yaw), command.vx, command.vy, command.wz
        return self.pose_on(*arc_poses(*turn, PERIOD, PERIOD)[-1].tolist())

    def _ends(self, rng: np.random.Generator) -> tuple[Pose, Pose] | None:
        found: list[Pose] = []
        for _ in range(2000):
            pose = self.pose_on(*rng.uniform(0.3, self.side - 0.3, 2), rng.uniform(-math.pi, math.pi))
            if self.fits(pose) and not (found and pose.distance_to(found[0]) < 1.5):
                found.append(pose)
            if len(found) == 2:
                return found[0], found[1]
        return None


class CostmapWorld(World):
    """A robot of 1.0 m x 0.5 m on a costmap."""

    backend = "costmap"
    outline = OUTLINE
    turning_radius = 0.0

    def build(self, boxes: list[Box]) -> None:
        """Make the map of a floor with boxes."""
        centres = (np.arange(round(self.side / RESOLUTION)) + 0.5) * RESOLUTION
        x, y = np.meshgrid(centres, centres)
        cells = np.where(np.any([box.holds(x, y) for box in boxes], axis=0), 254, 0).astype(np.uint8)
        layers = ({"name": "walls", "type": "static"}, {"name": "inflation", "type": "inflation"})
        parameters = CostmapParameters(resolution=RESOLUTION, footprint=self.outline, max_age=0.0, layers=layers)
        inflation = {"inflation_radius": 0.8, "cost_scaling_factor": 5.0}
        self.map = build_layered_costmap(parameters, {"inflation": inflation}, static_map=Costmap(cells, RESOLUTION))
        self.map.update(Pose.planar(0.0, 0.0), 0.0)

    def plugin(self, kind: PluginKind, name: str) -> Any:
        """Make a plugin on the map, with its defaults."""
        plugin_class = PluginRegistry("costmap").load(kind, name)
        maps = {"local": self.map, "global": self.map}
        parameters = plugin_class.Parameters(**self.parameters(name))
        common = "dut", parameters, self.clock, np.random.default_rng(0), Robot(), self.map
        limits = {"transforms": TransformBuffer(), "min_turning_radius": self.turning_radius}
        return plugin_class(CostmapContext(*common, maps=maps, **limits))

    def parameters(self, name: str) -> dict[str, Any]:
        """Parameters of a plugin that are not its defaults: none."""
        return {}

    def first_misfit(self, path: Any) -> int:
        """As for all; here with the samples of the controllers."""
        check, costmap = FootprintCheck(self.map.footprint, RESOLUTION), self.map.snapshot()
        return check.first_collision(costmap, np.array([(pose.x, pose.y, pose.yaw) for pose in path]))

    def pose_on(self, x: float, y: float, yaw: float) -> Pose:
        """Pose of a robot that stands on the floor."""
        return Pose.planar(x, y, yaw)

    def fits(self, pose: Pose) -> bool:
        """Whether the outline touches nothing."""
        centre = self.map.snapshot().cost_at(pose.x, pose.y)
        return centre is not None and centre < 253 and self.map.pose_check(PADDED)(pose).state < CellState.LETHAL


class CarWorld(CostmapWorld):
    """A car of the same size, whose ``base_link`` is on its rear axle, in rooms of 9 m."""

    outline = CAR_OUTLINE
    turning_radius, side = TURNING_RADIUS, CAR_SIDE

    def parameters(self, name: str) -> dict[str, Any]:
        """MPPI has to be told how the robot moves."""
        return {"motion_model": "ackermann"} if name == "mppi" else {}


class PaintedLayer(MeshLayer):
    """Lethal in the boxes."""

    boxes: list[Box] = []  # noqa: RUF012 - set for one world

    def compute(self) -> tuple[np.ndarray, np.ndarray]:
        """Costs and flags."""
        x, y = self.topology.vertices[:, :2].T
        lethal = np.any([box.holds(x, y) for box in self.boxes], axis=0)
        return np.where(lethal, np.inf, 0.0).astype(np.float32), lethal


class MeshWorld(World):
    """A disc of 0.25 m on gentle bumps."""

    backend = "mesh"

    def build(self, boxes: list[Box]) -> None:
        """Make the map of a floor with boxes."""
        spacing = 0.1
        x, y = np.meshgrid(*2 * [np.arange(round(SIDE / spacing) + 1) * spacing])
        self.map = MeshMap.from_heights(0.05 * np.sin(1.5 * x) * np.cos(1.2 * y), spacing, spacing)
        self.map.inscribed_radius = RADIUS
        common = self.map.topology, self.map.locator
        walls = PaintedLayer(LayerContext("walls", *common, PaintedLayer.Parameters()))
        walls.boxes = boxes
        # As on all shipped maps: with the default 0.99 planners may cross places where the disc does not fit.
        closed = {"lethal_value": np.inf, "inscribed_value": 1.0}
        inflation = InflationLayer.Parameters(inscribed_radius=RADIUS, inflation_radius=0.6, **closed)
        shown = InflationLayer(LayerContext("inflation", *common, inflation, (walls,)))
        for layer in (walls, shown):
            layer.recompute()
        self.map.set_layers(LayerGraph([walls, shown]), "inflation", 1.0)

    def plugin(self, kind: PluginKind, name: str) -> Any:
        """Make a plugin on the map, with its defaults."""
        plugin_class = PluginRegistry("mesh").load(kind, name)
        common = "dut", plugin_class.Parameters(), self.clock, np.random.default_rng(0), Robot(), self.map
        return plugin_class(MeshContext(*common, transforms=TransformBuffer()))

    def pose_on(self, x: float, y: float, yaw: float) -> Pose:
        """Pose of a robot that stands on the floor, straight below or above (x, y)."""
        spot = self.map.locate_one((x, y, 0.0))
        for _ in range(2):  # the nearest place of a slope lies beside (x, y); a robot would slide 4 cm/s
            spot = self.map.locate_one((x, y, float(spot.point[2])))
        ahead = np.array([[math.cos(yaw), math.sin(yaw), 0.0]])
        orientation = quaternions_from_axes(ahead, self.map.face_normals[spot.face][None])[0]
        return Pose(tuple(spot.point.tolist()), tuple(orientation.tolist()))

    def first_misfit(self, path: Any) -> int:
        """As for all; the controllers look at the inflated costs below the robot's middle."""
        ranks, mesh = self.map.snapshot().traversability_rank(1.0), self.map.topology
        for index, pose in enumerate(path):
            spot = self.map.locate_one(pose.position)
            if rank_at(mesh.vertices, mesh.faces, ranks, spot.face, tuple(spot.point.tolist())) > 0.0:
                return index
        return -1

    def fits(self, pose: Pose) -> bool:
        """Whether the outline touches nothing."""
        return self.map.pose_check(PADDED)(pose).state < CellState.LETHAL


WORLDS = {"costmap": CostmapWorld, "mesh": MeshWorld, "car": CarWorld}
