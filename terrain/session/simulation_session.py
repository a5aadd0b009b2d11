"""A simulation and the navigation of its robot on one clock: what scenarios and experiments have in common."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

from mbf_abstract.events import EventSink
from mbf_abstract.geometry import Command, Pose
from mbf_abstract.geometry.transform import Transform, frame_name_problem
from mbf_abstract.server.factory import read_config
from mbf_abstract.session import NavigationSession
from mbf_abstract.time.clock import Clock, WallClock
from mbf_abstract.time.sim_clock import SimClock
from terrain.physics.simulation import Simulation
from terrain.recording.run_digest import RunDigest
from terrain.sensors.lidar import Lidar
from terrain.sensors.proprioception import Localization
from terrain.session.drive_loop import DEFAULT_RATES, ClockedRobot, DriveLoop

S = TypeVar("S", bound="SimulationSession")

SENSE_FIRST = 0.5  # s; by then every sensor has measured and every map has been updated


@dataclass(frozen=True)
class SessionOptions:
    """How a session is built.

    Attributes
    ----------
    folder : Path, optional
        Where the world's map files and ``navigation.yaml`` are written; a temporary folder without it.
    backend : str, optional
        Map backend instead of the scenario's own.
    seed : int, optional
        Instead of the scenario's own.
    wall_clock : bool
        Real time instead of lockstep simulated time.
    settings : mapping of str to str
        Changes of the scenario's world and navigation, see ``terrain.scenarios.settings``.
    sinks : tuple of EventSink
        Where events go, beside the session's memory.
    on_step : callable
        Called with the name of each step of the preparation that may take a while.
    """

    folder: Path | None = None
    backend: str | None = None
    seed: int | None = None
    wall_clock: bool = False
    settings: Mapping[str, str] = field(default_factory=dict)
    sinks: tuple[EventSink, ...] = ()
    on_step: Callable[[str], None] = lambda text: None


class SimulationSession(NavigationSession, ABC):
    """Wires simulation, server and navigator on one clock; a context manager in which time passes.

    Parameters
    ----------
    localization : Localization
        Gives the server its pose.
    config_file : Path
        Of the navigation.
    options : SessionOptions
        Clock, seed (0 if none is given), sinks and ``on_step``; the rest belongs to scenarios.
    send : callable, optional
        Takes the robot's commands instead of its motors.
    clock : Clock, optional
        One that is shared, instead of one of its own.

    Attributes
    ----------
    digest : RunDigest
        Of every pose, command and event.
    loop : DriveLoop

    Raises
    ------
    ConfigError
        The configuration is wrong; all findings.
    """

    max_events = 200_000
    rates = DEFAULT_RATES

    def __init__(
        self,
        simulation: Simulation,
        localization: Localization,
        config_file: Path,
        options: SessionOptions,
        send: Callable[[Command], None] | None = None,
        clock: Clock | None = None,
    ) -> None:
        self.simulation = simulation
        clock = clock or (WallClock() if options.wall_clock else SimClock())
        self.digest = RunDigest(clock.now)
        super().__init__(clock, [self.digest, *options.sinks], self.max_events)
        self.on_initial_pose.append(localization.seat)
        robot = ClockedRobot(simulation, send or simulation.robot.send_command, self.digest)
        options.on_step("building the map")
        server = self.serve(*read_config(config_file), robot, seed=options.seed or 0)
        self.sensor_mounts = {
            name: Transform(sensor.model.position, parent=server.runtime.robot.robot_frame, child=name, static=True)
            for name, sensor in simulation.sensors.items()
            if isinstance(sensor, Lidar) and not frame_name_problem(name)  # such a sensor is no frame
        }
        self.loop = DriveLoop(simulation, robot, localization, server, self.digest, self.rates)
        self.on_close(self.loop.stop)
        self.loop.publish()
        options.on_step("compiling kernels (first run only)")
        server.warm_up(simulation.robot.pose(), self.goals[0], options.on_step, only_defaults=not options.wall_clock)

    @property
    @abstractmethod
    def goals(self) -> list[Pose]:
        """The robot's goals, in order."""

    def run(self) -> None:
        """Let time pass: start stepping the simulator, and wait until sensors and maps are alive."""
        self.loop.start()
        self.clock.sleep(SENSE_FIRST)

    def __enter__(self: S) -> S:
        self.run()
        return self
