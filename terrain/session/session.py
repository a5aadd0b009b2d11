"""A scenario, ready to be driven by your own script: world, robot, server and navigator on one simulated clock.

``mbf run`` is this plus ``move_base`` to each goal and the results on disk; use ``Session`` to try an executive or
plugins of your own in a world that ships.

Example
-------
>>> with Session("outdoor", "mesh") as session:
...     plan = session.navigator.get_path(session.goals[0])
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from mbf_abstract.config.findings import ConfigError, Finding
from mbf_abstract.drive.robot import Odometry
from mbf_abstract.events import EventBus, EventSink, MemorySink
from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.goals.handle import AnyGoalHandle
from mbf_abstract.navigator import Navigator
from mbf_abstract.server.factory import read_config
from mbf_abstract.time.clock import Clock, WallClock
from mbf_abstract.time.sim_clock import SimClock
from terrain.physics.command_delay import CommandDelay
from terrain.physics.kinematic_robot import KinematicRobot
from terrain.physics.kinematic_world import KinematicWorld
from terrain.physics.robot_models import ROBOTS
from terrain.physics.robots import WheeledRobot
from terrain.physics.simulation import Simulation
from terrain.recording.recorder import Recorder
from terrain.recording.recording import RobotShape
from terrain.recording.run_digest import RunDigest
from terrain.scenarios.environment import set_stage, with_noise
from terrain.scenarios.faults import ODOMETRY, FaultSchedule
from terrain.scenarios.perturbation import draw_disturbance
from terrain.scenarios.scenario import Scenario, load_scenario
from terrain.scenarios.sensors import AnyRobot, make_localization, make_proprioceptive_sensors, make_sensors
from terrain.scenarios.settings import apply_settings, apply_world_settings
from terrain.scenarios.world import ScenarioWorld
from terrain.sensors.lidar import Sensor
from terrain.session.drive_loop import ClockedRobot, DriveLoop, Report

SENSE_FIRST = 0.5  # s; every sensor has spoken and every map has been updated when a script gets its turn
MAX_EVENTS = 200_000
TIME_TO_END = 1.0  # s of simulated time for threads to end; it passes only while somebody waits for it


class Session:
    """One scenario, built and running; a context manager.

    Parameters
    ----------
    scenario : Scenario or str
        A scenario, the name of a shipped one, or a file.
    backend : str, optional
        Map backend instead of the scenario's own.
    seed : int, optional
        Instead of the scenario's own.
    folder : path, optional
        Where the world's map files and ``navigation.yaml`` are written; a temporary folder without it.
    wall_clock : bool
        Real time instead of lockstep simulated time.
    sinks : sequence of EventSink
        Where events go, beside ``memory``.
    on_step : callable
        Told the name of each preparation that may take a while.
    settings : mapping of str to str
        Changes of the scenario's world and navigation, see ``terrain.scenarios.settings``.

    Raises
    ------
    ConfigError
        The scenario has no configuration for the backend, or that configuration is wrong; all findings.
    """

    def __init__(
        self,
        scenario: Scenario | str,
        backend: str | None = None,
        seed: int | None = None,
        folder: str | os.PathLike[str] | None = None,
        wall_clock: bool = False,
        sinks: tuple[EventSink, ...] = (),
        on_step: Callable[[str], None] = lambda text: None,
        settings: Mapping[str, str] | None = None,
    ) -> None:
        loaded = load_scenario(scenario) if isinstance(scenario, str) else scenario
        asked, self._settings = apply_world_settings(loaded, settings or {})
        self.scenario = with_noise(asked)
        self.backend = backend or self.scenario.backend
        self.seed = self.scenario.seed if seed is None else seed
        self._temporary = tempfile.TemporaryDirectory(prefix="mbf_bench_")  # removed with the session, used or not
        self.folder = Path(self._temporary.name if folder is None else folder)
        self.folder.mkdir(parents=True, exist_ok=True)
        try:
            on_step("building the world")
            self.world, self._obstacles = set_stage(self.scenario, self.folder, self.seed)
        except BaseException:
            self._temporary.cleanup()
            raise
        try:
            self._start(wall_clock, sinks, on_step)
        except BaseException:
            self.world.physics.close()
            self._temporary.cleanup()
            raise

    def _start(self, wall_clock: bool, sinks: tuple[EventSink, ...], on_step: Callable[[str], None]) -> None:
        """Robot and sensors, then the server on their map, then time."""
        config_file = write_navigation_config(self.scenario, self.backend, self.world, self.folder, self._settings)
        server_class, config = read_config(config_file)
        self.robot, self.simulation = self._make_simulation()
        self.recorder = self._make_recorder()
        self.clock: Clock = WallClock() if wall_clock else SimClock()
        self.memory = MemorySink(maxlen=MAX_EVENTS)
        self.digest = RunDigest(self.clock.now)
        self.events = EventBus(self.clock.now, [self.memory, self.digest, *sinks])
        delay = CommandDelay(self.world.physics, self.robot.send_command, self.scenario.perturb.command_delay)
        clocked = ClockedRobot(delay, self._odometry, self.digest, self.robot.spec.min_turning_radius)
        on_step("building the map")
        server = server_class(config, clocked, self.clock, TransformBuffer(), self.events, self.seed)
        server.get_path.listeners.append(self._record_plan)
        self.navigator = Navigator(server)
        self.loop = DriveLoop(self.simulation, clocked, self.localization, server, self.recorder, self.digest)
        self.loop.publish()
        on_step("compiling kernels (first run only)")
        server.warm_up(self.robot.pose(), self.goals[0], on_step)

    @property
    def goals(self) -> list[Pose]:
        """The scenario's goals on the ground."""
        return [self.world.pose_of(goal) for goal in self.scenario.goals]

    def run(self, report: Report = lambda time, pose, speed: None) -> None:
        """Let time pass: start stepping the simulator, and wait until sensors and maps are alive."""
        self.loop.start(report)
        self.clock.sleep(SENSE_FIRST)

    def close(self) -> None:
        """Stop the robot, the server and the simulator."""
        self.loop.stop()
        self.navigator.close()
        if isinstance(self.clock, SimClock):
            self.clock.sleep(TIME_TO_END)
        self.events.close()
        self.world.physics.close()
        self._temporary.cleanup()

    def __enter__(self) -> Session:
        self.run()
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()

    def _make_simulation(self) -> tuple[AnyRobot, Simulation]:
        spec, physics = ROBOTS[self.scenario.robot], self.world.physics
        disturbance = draw_disturbance(self.scenario.perturb, self.seed)
        pose = disturbance.moved(self.scenario.start, self.world.pose_of)
        robot: AnyRobot
        if isinstance(physics, KinematicWorld):
            robot = KinematicRobot(physics, spec, pose)
        else:
            robot = WheeledRobot(physics, spec, pose, friction=disturbance.friction, mass_factor=disturbance.mass)
        robot.settle()
        self.world.introduce(robot)
        sensors: dict[str, Sensor[Any]] = {
            **make_sensors(self.scenario.sensors, robot, self.world, self.seed),
            **make_proprioceptive_sensors(self.scenario, robot, self.seed),
        }
        self.localization = make_localization(self.scenario.localization, robot, self.seed)
        self.faults = FaultSchedule(self.world.physics, sensors, self.localization, self.scenario.faults)
        return robot, Simulation(self.world.physics, robot, sensors)

    def _make_recorder(self) -> Recorder:
        shape = RobotShape.of(self.robot.spec)
        recorder = Recorder(self.scenario.name, self.backend, shape, self.robot.pose(), self.goals)
        recorder.ground, recorder.walls = self.world.ground, self.world.walls
        recorder.obstacles, recorder.actors = self._obstacles, self.world.actors
        return recorder

    def _odometry(self) -> Odometry:
        """What the wheels say, if the scenario wants that, else the truth."""
        reading = self.simulation.latest.get(ODOMETRY)
        return self.robot.odometry() if reading is None else reading.odometry

    def _record_plan(self, handle: AnyGoalHandle) -> None:
        path = handle.result.path if handle.result is not None else None
        if path is not None:
            self.recorder.path(self.simulation.time, path.positions)
            self.recorder.map(self.simulation.time, self.navigator.server.map_view)


def write_navigation_config(
    scenario: Scenario, backend: str, world: ScenarioWorld, folder: Path, settings: Mapping[str, str]
) -> Path:
    """Write the backend's configuration with the world's files filled in; a run can be planned again from it."""
    source = scenario.navigation.get(backend)
    if source is None:
        known = ", ".join(scenario.navigation)
        raise ConfigError([Finding(scenario.name, 1, "navigation", f"one of {known}", repr(backend))])
    text = source.read_text()
    for placeholder, file in world.files.items():
        text = text.replace(placeholder, file.name)
    target = folder / "navigation.yaml"
    target.write_text(apply_settings(text, settings))
    return target
