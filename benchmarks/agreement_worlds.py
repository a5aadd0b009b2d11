"""Small random rooms on both maps, for ``agreement.py``: a map, a start and a goal where the robot fits."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import Any

import numpy as np
from agreement_robots import Motion, SimulatedRobot
from agreement_rooms import SIDE, Box, random_boxes

from mbf_abstract.config.registry import PluginRegistry
from mbf_abstract.drive.command_delay import CommandDelay
from mbf_abstract.geometry import FloatArray, Pose, Twist, quaternions_from_axes
from mbf_abstract.geometry.arithmetic import plane_rotation, rotated_back
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

RESOLUTION = 0.05  # m
RECTANGLE = SimulatedRobot(((0.5, 0.25), (-0.5, 0.25), (-0.5, -0.25), (0.5, -0.25)))
CAR = SimulatedRobot(((0.8, 0.25), (-0.2, 0.25), (-0.2, -0.25), (0.8, -0.25)))
DISC = SimulatedRobot(radius=0.25)
TURNING_RADIUS, CAR_SIDE = 0.7, 9.0
LONGEST_STOP = 20.0  # s
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


class World(ABC):
    """One floor with its map, and a start and a goal where the robot fits; None as ends if there are none."""

    backend: str
    map: Any
    side = SIDE
    robot: SimulatedRobot

    def __init__(self, seed: int, is_open: bool = False, robot: SimulatedRobot | None = None) -> None:
        self.clock, self.robot = Clock(), robot or self.robot
        self.motion, self.delay = Motion(self.robot), CommandDelay()
        rng, scale = np.random.default_rng(seed), self.robot.scale
        boxes = random_boxes(rng, is_open, self.side)
        self.side *= scale
        self.build([box.scaled(scale) for box in boxes])
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

    @abstractmethod
    def touches(self, poses: FloatArray) -> bool:
        """Whether the robot touches something at any of poses (n, 3: x, y [m], yaw [rad]), its padding left out."""

    def when_it_acts(self, pose: Pose) -> tuple[Pose, Twist]:
        """Pose and velocity when a command that is sent now takes effect, as the core predicts them."""
        return self.delay.ahead(self.clock.time, self.robot.delay, pose, self.motion.velocity)

    def moved(self, pose: Pose, command: Any) -> tuple[Pose, bool]:
        """Where the robot is one period later, and whether it has touched something by then."""
        self.delay.note(self.clock.time, command)
        poses = self.motion.drive(pose, command)
        self.clock.time += self.robot.period
        return self.pose_on(*poses[-1].tolist()), self.touches(poses)

    def stopped(self, pose: Pose) -> tuple[Pose, bool]:
        """Where the robot stands after commands of zero, and whether it has touched something by then."""
        if not self.robot.is_drawn:
            self.motion.velocity = Twist()
            self.clock.time += self.robot.period
            return pose, False
        for _ in range(math.ceil(LONGEST_STOP / self.robot.period)):
            pose, touched = self.moved(pose, Twist())
            if touched or self.motion.velocity == Twist():
                return pose, touched
        return pose, False

    def _ends(self, rng: np.random.Generator) -> tuple[Pose, Pose] | None:
        found: list[Pose] = []
        margin = 0.3 * self.robot.scale
        for _ in range(2000):
            pose = self.pose_on(*rng.uniform(margin, self.side - margin, 2), rng.uniform(-math.pi, math.pi))
            if self.fits(pose) and not (found and pose.distance_to(found[0]) < 1.5 * self.robot.scale):
                found.append(pose)
            if len(found) == 2:
                return found[0], found[1]
        return None


class CostmapWorld(World):
    """A robot of 1.0 m x 0.5 m on a costmap."""

    backend = "costmap"
    robot = RECTANGLE
    turning_radius = 0.0

    def build(self, boxes: list[Box]) -> None:
        """Make the map of a floor with boxes."""
        self.resolution = RESOLUTION * min(self.robot.scale, 1.0)
        centres = (np.arange(round(self.side / self.resolution)) + 0.5) * self.resolution
        x, y = np.meshgrid(centres, centres)
        cells = np.where(np.any([box.holds(x, y) for box in boxes], axis=0), 254, 0).astype(np.uint8)
        layers = ({"name": "walls", "type": "static"}, {"name": "inflation", "type": "inflation"})
        footprint = self.robot.footprint
        outline = [(float(x), float(y)) for x, y in footprint.vertices]
        parameters = CostmapParameters(resolution=self.resolution, footprint=outline, max_age=0.0, layers=layers)
        inflation = {"inflation_radius": max(0.8, footprint.inscribed_radius + 0.55), "cost_scaling_factor": 5.0}
        static_map = Costmap(cells, self.resolution)
        self.map = build_layered_costmap(parameters, {"inflation": inflation}, static_map=static_map)
        self.map.update(Pose.planar(0.0, 0.0), 0.0)

    def plugin(self, kind: PluginKind, name: str) -> Any:
        """Make a plugin on the map, with its defaults."""
        plugin_class = PluginRegistry("costmap").load(kind, name)
        maps = {"local": self.map, "global": self.map}
        parameters = plugin_class.Parameters(**self.parameters(name, plugin_class))
        common = "dut", parameters, self.clock, np.random.default_rng(0), Robot(), self.map
        limits = {"transforms": TransformBuffer(), "min_turning_radius": self.turning_radius}
        return plugin_class(CostmapContext(*common, maps=maps, **limits))

    def parameters(self, name: str, plugin_class: Any) -> dict[str, Any]:
        """Parameters of a plugin that are not its defaults; a shim's inner controller is the default one."""
        given = self.robot.parameters(plugin_class)
        if name == "rotation_shim" and self.robot.is_drawn:
            inner = PluginRegistry("costmap").load(PluginKind.CONTROLLER, plugin_class.Parameters().inner_type)
            given["inner"] = self.robot.parameters(inner)
        return given

    def first_misfit(self, path: Any) -> int:
        """As for all; here with the samples of the controllers."""
        check, costmap = FootprintCheck(self.map.footprint, self.resolution), self.map.snapshot()
        return check.first_collision(costmap, path.planar_poses)

    def touches(self, poses: FloatArray) -> bool:
        """As for all."""
        check = FootprintCheck(self.map.unpadded_footprint, self.resolution)
        return check.first_collision(self.map.snapshot(), poses) >= 0

    def pose_on(self, x: float, y: float, yaw: float) -> Pose:
        """Pose of a robot that stands on the floor."""
        return Pose.planar(x, y, yaw)

    def fits(self, pose: Pose) -> bool:
        """Whether the outline touches nothing."""
        centre = self.map.snapshot().cost_at(pose.x, pose.y)
        return centre is not None and centre < 253 and self.map.pose_check(PADDED)(pose).state < CellState.LETHAL


class CarWorld(CostmapWorld):
    """A car of the same size, whose ``base_link`` is on its rear axle, in rooms of 9 m."""

    robot = CAR
    turning_radius, side = TURNING_RADIUS, CAR_SIDE

    def parameters(self, name: str, plugin_class: Any) -> dict[str, Any]:
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
    robot = DISC

    def build(self, boxes: list[Box]) -> None:
        """Make the map of a floor with boxes."""
        spacing, radius = 0.1 * min(self.robot.scale, 1.0), self.robot.radius
        x, y = np.meshgrid(*2 * [np.arange(round(self.side / spacing) + 1) * spacing])
        self.map = MeshMap.from_heights(0.05 * np.sin(1.5 * x) * np.cos(1.2 * y), spacing, spacing)
        self.map.inscribed_radius = radius
        common = self.map.topology, self.map.locator
        walls = PaintedLayer(LayerContext("walls", *common, PaintedLayer.Parameters()))
        walls.boxes = boxes
        # As on all shipped maps: with the default 0.99 planners may cross places where the disc does not fit.
        closed = {"lethal_value": np.inf, "inscribed_value": 1.0}
        inflation = InflationLayer.Parameters(inscribed_radius=radius, inflation_radius=radius + 0.35, **closed)
        shown = InflationLayer(LayerContext("inflation", *common, inflation, (walls,)))
        for layer in (walls, shown):
            layer.recompute()
        self.walls = walls
        self.map.set_layers(LayerGraph([walls, shown]), "inflation", 1.0)

    def plugin(self, kind: PluginKind, name: str) -> Any:
        """Make a plugin on the map, with its defaults."""
        plugin_class = PluginRegistry("mesh").load(kind, name)
        parameters = plugin_class.Parameters(**self.robot.parameters(plugin_class))
        common = "dut", parameters, self.clock, np.random.default_rng(0), Robot(), self.map
        return plugin_class(MeshContext(*common, transforms=TransformBuffer()))

    def touches(self, poses: FloatArray) -> bool:
        """As for all: a lethal vertex is nearer than the radius by half the longest edge; a plan may come so near."""
        lethal = self.map.topology.vertices[self.walls.lethal, :2]
        reach = self.robot.radius - 0.5 * float(self.map.neighbour_lengths.max())
        return bool((np.square(poses[:, None, :2] - lethal).sum(axis=2) < reach**2).any())

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


class LongMeshWorld(MeshWorld):
    """The robot of the costmaps on a mesh, where its outline has to fit besides the disc."""

    robot = SimulatedRobot(RECTANGLE.outline, radius=0.25)

    def build(self, boxes: list[Box]) -> None:
        """Make the map of a floor with boxes."""
        super().build(boxes)
        self.map.footprint, self.map.check_footprint = self.robot.outline, True

    def touches(self, poses: FloatArray) -> bool:
        """As for all: a lethal vertex is inside the outline by half the longest edge."""
        lethal = self.map.topology.vertices[self.walls.lethal, :2]
        slack = 0.5 * float(self.map.neighbour_lengths.max())
        half_length, half_width = np.max(self.robot.outline, axis=0) - slack
        for x, y, yaw in poses.tolist():
            ahead, left = rotated_back(plane_rotation(yaw), lethal - (x, y)).T
            if ((np.abs(ahead) < half_length) & (np.abs(left) < half_width)).any():
                return True
        return False


WORLDS = {"costmap": CostmapWorld, "mesh": MeshWorld, "car": CarWorld, "long_mesh": LongMeshWorld}
