"""A warehouse that runs: robot, traffic, lidar and navigation server in lockstep on one simulated clock.

Beside the server's own events the stage writes to the same log what an executive cannot know: when the robot starts
and stops to move, and contacts. A context manager; time passes only inside the ``with`` block.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from mbf_abstract.drive.robot import Odometry
from mbf_abstract.events import EventBus, EventKind, MemorySink
from mbf_abstract.geometry import Command, Pose
from mbf_abstract.geometry.transform import Transform
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.navigator import Navigator
from mbf_abstract.server.factory import read_config
from mbf_abstract.time.clock import Priority
from mbf_abstract.time.sim_clock import SimClock
from terrain.experiments.table1.conditions import Conditions
from terrain.experiments.table1.environments.robot import CARRIER
from terrain.experiments.table1.environments.traffic import TrafficRays, make_traffic
from terrain.experiments.table1.environments.warehouse_world import WarehouseRobot, WarehouseWorld
from terrain.experiments.table1.environments.world import Table1World
from terrain.experiments.table1.plugin_wrappers import SOURCE, wrap_plugins
from terrain.physics.simulation import Simulation
from terrain.recording.run_digest import RunDigest
from terrain.sensors.lidar import Lidar, planar_directions
from terrain.sensors.rays import StaticRays
from terrain.session.session import TIME_TO_END
from terrain.worlds.floor_plan import write_map
from terrain.worlds.occupancy import wall_triangles

NAVIGATION = Path(__file__).with_name("navigation.yaml")
PERIOD = 0.05  # s between two publications of the pose
SENSE_FIRST = 0.5  # s until sensors and maps are alive
LIDAR_RATE, LIDAR_RANGE, LIDAR_RAYS, LIDAR_NOISE = 10.0, 8.0, 360, 0.01  # Hz, m, -, m
STANDS_BELOW = 0.02  # m/s and rad/s
MAX_EVENTS = 1_000_000
TRAFFIC_STREAM, LIDAR_STREAM = 1, 2  # each part draws from its own generator


class Stage:
    """One world with its traffic and one robot to be navigated.

    Parameters
    ----------
    world : Table1World
    conditions : Conditions
    seed : int
        Of traffic, sensors, plugins and planner latencies.

    Attributes
    ----------
    navigator : Navigator
    memory : MemorySink
        The event log.
    digest : RunDigest
        Of every pose, command and event.
    on_tick : list of callables
        Called with the time [s] at every publication of the pose, on the simulator's thread.
    """

    def __init__(self, world: Table1World, conditions: Conditions, seed: int) -> None:
        self.clock = SimClock()
        self.memory = MemorySink(maxlen=MAX_EVENTS)
        self.digest = RunDigest(self.clock.now)
        self.events = EventBus(self.clock.now, [self.memory, self.digest])
        self.on_tick: list[Callable[[float], None]] = []
        grid = world.grid()
        traffic = make_traffic(
            world.routes, conditions.robots, conditions.polite, np.random.default_rng([seed, TRAFFIC_STREAM])
        )
        self.warehouse = WarehouseWorld(grid, traffic, self._tell_contact)
        self.robot = WarehouseRobot(self.warehouse, Pose.planar(*world.start))
        lidar = Lidar(
            self.robot,
            "lidar",
            [StaticRays(*wall_triangles(grid)), TrafficRays(traffic)],
            CARRIER.lidar_position,
            planar_directions(LIDAR_RAYS),
            LIDAR_RATE,
            np.random.default_rng([seed, LIDAR_STREAM]),
            max_range=LIDAR_RANGE,
            noise=LIDAR_NOISE,
        )
        self.simulation = Simulation(self.warehouse, self.robot, {"lidar": lidar})
        self._goals = world.goals()
        self._moves = False
        self._stopped = False
        self._origin = 0.0
        self._folder = tempfile.TemporaryDirectory(prefix="mbf_table1_")
        self._start_server(Path(self._folder.name), world, conditions, seed)

    def _start_server(self, folder: Path, world: Table1World, conditions: Conditions, seed: int) -> None:
        map_file = write_map(world.grid(), folder, "world")
        config_file = folder / "navigation.yaml"
        config_file.write_text(NAVIGATION.read_text().replace("$WORLD_MAP", map_file.name))
        server_class, config = read_config(config_file)
        self.server = server_class(config, ClockedCarrier(self), self.clock, TransformBuffer(), self.events, seed)
        self._publish()
        self.server.warm_up(self.robot.pose(), self._goals[0])
        wrap_plugins(self.server, seed, conditions.planner_latency)
        self.navigator = Navigator(self.server)
        self.simulation.on_measurement(lambda name, scan: self._take_scan(scan))

    def __enter__(self) -> Stage:
        self._origin = self.clock.now()
        self.clock.spawn(self._loop, "simulator", Priority.SIMULATOR)
        self.clock.sleep(SENSE_FIRST)
        return self

    def __exit__(self, *exc: object) -> None:
        self._stopped = True
        self.navigator.close()
        self.clock.sleep(TIME_TO_END)
        self.events.close()
        self._folder.cleanup()

    @property
    def distance(self) -> float:
        """How far the robot has driven [m]."""
        return self.robot.distance

    def goals(self) -> list[Pose]:
        """Return the waypoints."""
        return self._goals

    @property
    def time_offset(self) -> float:
        """Time of the clock [s] at which the simulation's time was 0."""
        return self._origin

    def _loop(self) -> None:
        tick = 0
        while not self._stopped:
            self.simulation.advance_to(self.clock.now() - self._origin)
            self.digest.pose(self.robot.pose())
            self._publish()
            self._tell_motion()
            for listener in self.on_tick:
                listener(self.clock.now())
            tick += 1
            self.clock.sleep_until(self._origin + tick * PERIOD)

    def _publish(self) -> None:
        pose, frames = self.robot.pose(), self.server.runtime.robot
        self.server.runtime.transforms.set(
            Transform(pose.position, pose.orientation, frames.global_frame, frames.robot_frame, self.clock.now())
        )

    def _take_scan(self, scan: RangeScan) -> None:
        self.server.take_scan(replace(scan, stamp=self._origin + scan.stamp))

    def _tell_motion(self) -> None:
        velocity = self.robot.velocity()
        moves = math.hypot(velocity.vx, velocity.vy) > STANDS_BELOW or abs(velocity.wz) > STANDS_BELOW
        if moves != self._moves:
            self._moves = moves
            self.events.emit(EventKind.CUSTOM, SOURCE, what="motion", moves=moves)

    def _tell_contact(self, with_what: str, who_moved: str) -> None:
        self.events.emit(EventKind.CUSTOM, SOURCE, what="contact", touched=with_what, moved=who_moved)


class ClockedCarrier:
    """The simulated robot as the server sees it: its odometry is stamped with the server's clock."""

    def __init__(self, stage: Stage) -> None:
        self._stage = stage

    def send_command(self, command: Command) -> None:
        """Hand the command to the simulated motors."""
        self._stage.digest.command(command)
        self._stage.robot.send_command(command)

    def odometry(self) -> Odometry:
        """Measured velocity; the stamp is the clock's time, not the simulation's."""
        measured = self._stage.robot.odometry()
        return Odometry(measured.velocity, measured.stamp + self._stage.time_offset)
