"""A running warehouse: robot, traffic, lidar and navigation server in lockstep on one simulated clock.

Beside the server's own events the environment logs what an executive cannot know: when the robot starts and stops to
move, and contacts.
"""

from __future__ import annotations

import math
import tempfile
from pathlib import Path

import numpy as np

from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Pose, Twist
from terrain.experiments.table1.conditions import Surroundings
from terrain.experiments.table1.environments import traffic
from terrain.experiments.table1.environments.traffic import CARRIER, TrafficRays, make_traffic, run_ahead
from terrain.experiments.table1.environments.warehouse_world import WarehouseRobot, WarehouseWorld
from terrain.experiments.table1.environments.world import World
from terrain.experiments.table1.plugin_wrappers import SOURCE, wrap_plugins
from terrain.physics.simulation import Simulation
from terrain.sensors.lidar import Lidar, LidarModel, planar_directions
from terrain.sensors.proprioception import Localization
from terrain.sensors.rays import StaticRays
from terrain.session.drive_loop import LoopRates
from terrain.session.simulation_session import SessionOptions, SimulationSession
from terrain.worlds.floor_plan import write_map
from terrain.worlds.occupancy import wall_surface

NAVIGATION = Path(__file__).with_name("navigation.yaml")
LIDAR_RATE, LIDAR_RANGE, LIDAR_RAYS, LIDAR_NOISE = 10.0, 8.0, 360, 0.01  # Hz, m, -, m
STANDS_BELOW = 0.02  # m/s and rad/s
TRAFFIC_STREAM, LIDAR_STREAM, POSE_STREAM = 1, 2, 3  # each part draws from its own generator


def constants() -> dict[str, list[object]]:
    """Constants of the code that decide what happens here, for the hash of an experiment's parameters."""
    return {
        "traffic": [
            traffic.STOP_DISTANCE,
            traffic.SIDE_MARGIN,
            traffic.DWELL,
            traffic.SPEED_RANGE,
            traffic.PHASE_RANGE,
        ],
        "lidar": [LIDAR_RATE, LIDAR_RANGE, LIDAR_RAYS, LIDAR_NOISE],
    }


class WarehouseEnvironment(SimulationSession):
    """One world with its traffic and one robot to be navigated.

    Parameters
    ----------
    seed : int
        Of traffic, sensors, plugins and planner latencies.
    navigation : Path
        Configuration of the server; ``$WORLD_MAP`` in it becomes the map.
    head_start : float
        How long [s] the others have been driving when the run begins.
    """

    max_events = 1_000_000
    rates = LoopRates(period=0.05, ticks_per_sample=1)

    def __init__(
        self,
        world: World,
        surroundings: Surroundings,
        seed: int,
        navigation: Path = NAVIGATION,
        head_start: float = 0.0,
    ) -> None:
        self._goals = world.goals()
        self._moves = False
        grid = world.grid()
        others = make_traffic(
            world.routes, surroundings.robots, surroundings.polite, np.random.default_rng([seed, TRAFFIC_STREAM])
        )
        self.robot = WarehouseRobot(WarehouseWorld(grid, others, self._report_contact), Pose.planar(*world.start))
        run_ahead(others, head_start, self.robot.box)
        lidar = Lidar(
            self.robot,
            "lidar",
            [StaticRays(*wall_surface(grid)), TrafficRays(others)],
            LidarModel(CARRIER.lidar_position, planar_directions(LIDAR_RAYS), LIDAR_RATE, LIDAR_RANGE, LIDAR_NOISE),
            np.random.default_rng([seed, LIDAR_STREAM]),
        )
        exact = Localization(self.robot, np.random.default_rng([seed, POSE_STREAM]))
        self._folder = tempfile.TemporaryDirectory(prefix="mbf_table1_")
        config_file = Path(self._folder.name) / "navigation.yaml"
        map_file = write_map(grid, config_file.parent, "world")
        config_file.write_text(navigation.read_text().replace("$WORLD_MAP", map_file.name))
        simulation = Simulation(self.robot.world, self.robot, {"lidar": lidar})
        super().__init__(simulation, exact, config_file, SessionOptions(seed=seed))
        wrap_plugins(self.navigator.server, seed, surroundings.planner_latency)
        self.loop.on_sample.append(self._report_motion)

    @property
    def goals(self) -> list[Pose]:
        """The waypoints."""
        return self._goals

    @property
    def distance(self) -> float:
        """How far the robot has driven [m]."""
        return self.robot.distance

    def close(self) -> None:
        """Stop the robot, the server and the simulator."""
        super().close()
        self._folder.cleanup()

    def _report_motion(self, time: float, pose: Pose, velocity: Twist) -> None:
        moves = math.hypot(velocity.vx, velocity.vy) > STANDS_BELOW or abs(velocity.wz) > STANDS_BELOW
        if moves != self._moves:
            self._moves = moves
            self.events.emit(EventKind.CUSTOM, SOURCE, what="motion", moves=moves)

    def _report_contact(self, with_what: str, who_moved: str) -> None:
        self.events.emit(EventKind.CUSTOM, SOURCE, what="contact", touched=with_what, moved=who_moved)
