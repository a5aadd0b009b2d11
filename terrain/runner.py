"""Runs a scenario: world, robot, server and executive on one clock, and writes what happened into a folder.

The order of one run: scenario -> world and its map files -> navigation configuration of the chosen backend ->
server -> kernels warmed up -> ``move_base`` to each goal while a thread steps the simulator -> recording, metrics,
picture, replay.
On a ``SimClock`` the same scenario and seed write the same ``events.jsonl``, byte for byte.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from mbf_abstract.actions.goals import MoveBaseGoal, MoveBaseResult
from mbf_abstract.actions.handle import AnyGoalHandle
from mbf_abstract.clock import Clock, WallClock, wall_seconds
from mbf_abstract.events import EventBus, JsonLinesSink, MemorySink
from mbf_abstract.findings import ConfigError, Finding
from mbf_abstract.geometry import Pose
from mbf_abstract.navigator import Navigator
from mbf_abstract.server import AbstractNavigationServer
from mbf_abstract.server_factory import read_config
from mbf_abstract.sim_clock import SimClock
from mbf_abstract.transforms import TransformBuffer
from terrain.drive_loop import ClockedRobot, DriveLoop
from terrain.metrics import measure
from terrain.recorder import Recorder
from terrain.recording import Recording, RobotShape
from terrain.robot_models import ROBOTS
from terrain.robots import WheeledRobot
from terrain.scenario import Scenario, ground_pose
from terrain.scenario_sensors import make_sensors
from terrain.scenario_world import ScenarioWorld, build_world
from terrain.simulation import Simulation


@dataclass(frozen=True)
class Progress:
    """One line of news while a run goes on; times in seconds, tilt in radians."""

    time: float
    wall_time: float
    distance_left: float
    speed: float
    tilt: float
    state: str


@dataclass(frozen=True)
class RunResult:
    """What became of a run."""

    success: bool
    outcome: int
    outcome_name: str
    message: str
    folder: Path
    metrics: dict[str, Any] = field(repr=False)


@dataclass(frozen=True)
class RunOptions:
    """How a scenario is run.

    Attributes
    ----------
    backend, seed : optional
        Instead of the scenario's own.
    wall_clock : bool
        Real time instead of lockstep simulated time.
    on_progress : callable
        Told about ten times a simulated second.
    on_step : callable
        Told the name of each preparation that may take a while.
    """

    folder: Path
    backend: str | None = None
    seed: int | None = None
    wall_clock: bool = False
    on_progress: Callable[[Progress], None] = lambda progress: None
    on_step: Callable[[str], None] = lambda text: None


def run_scenario(scenario: Scenario, options: RunOptions) -> RunResult:
    """Run a scenario to its end and write its results.

    Raises
    ------
    ConfigError
        The scenario has no configuration for the backend, or that configuration is wrong; all findings.
    """
    folder, seed = options.folder, scenario.seed if options.seed is None else options.seed
    folder.mkdir(parents=True, exist_ok=True)
    options.on_step("building the world")
    world = build_world(scenario, folder, np.random.default_rng([seed, 1]))
    with world.bullet:
        config_file = _navigation_config(scenario, options.backend or scenario.backend, world, folder)
        run = _Run(scenario, options, world, seed)
        recording = run.drive(config_file)
    return _write_results(recording, run, options)


class _Run:
    """One run's parts, wired together."""

    def __init__(self, scenario: Scenario, options: RunOptions, world: ScenarioWorld, seed: int) -> None:
        self.scenario = scenario
        self.options = options
        self.world = world
        self.seed = seed
        self.result = MoveBaseResult(17, "not started")
        self.wall_time = 0.0
        self._handle: AnyGoalHandle | None = None
        self.spec = ROBOTS[scenario.robot]
        self.goals = [ground_pose(goal, world.height_at(goal.x, goal.y)) for goal in scenario.goals]
        self.start = ground_pose(scenario.start, world.height_at(scenario.start.x, scenario.start.y))
        self.robot = WheeledRobot(world.bullet, self.spec, self.start)
        self.robot.settle()
        sensors = make_sensors(scenario.sensors, self.robot, world, seed)
        self.simulation = Simulation(world.bullet, self.robot, sensors)
        backend = options.backend or scenario.backend
        self.recorder = Recorder(scenario.name, backend, RobotShape.of(self.spec), self.robot.pose(), list(self.goals))
        self.recorder.ground, self.recorder.walls = world.ground, world.walls
        self.recorder.obstacles = world.obstacles

    def drive(self, config_file: Path) -> Recording:
        """Start the server, drive to all goals, and return what was recorded."""
        clock: Clock = WallClock() if self.options.wall_clock else SimClock()
        memory = MemorySink(maxlen=200_000)
        events = EventBus(clock.now, [memory, JsonLinesSink(self.options.folder / "events.jsonl")])
        transforms = TransformBuffer()
        server_class, config = read_config(config_file)
        self.options.on_step("building the map")
        robot = ClockedRobot(self.robot)
        server = server_class(config, robot, clock, transforms, events, self.seed)
        server.get_path.listeners.append(self._record_plan)
        with Navigator(server) as navigator:
            loop = DriveLoop(self.simulation, robot, server, self.recorder)
            loop.publish()
            self._warm_up(server)
            started = wall_seconds()
            loop.start(self._reporter(navigator, started))
            clock.sleep(0.5)  # let every sensor speak and every map be updated once
            self.result = self._visit_goals(navigator, clock)
            self.wall_time = wall_seconds() - started
            loop.stop()
        events.close()
        result = self.result
        return self.recorder.finish(result.success, result.outcome_name, result.message, list(memory.events))

    def _warm_up(self, server: AbstractNavigationServer) -> None:
        """Compile every kernel the run needs before time starts; the first run on a machine takes a while here."""
        self.options.on_step("compiling kernels (first run only)")
        server.warm_up(self.robot.pose(), self.goals[0], self.options.on_step)

    def _visit_goals(self, navigator: Navigator, clock: Clock) -> MoveBaseResult:
        """Send the goals one by one; the first failure, or the time limit, ends the run."""
        result = self.result
        for goal in self.goals:
            handle = navigator.send(MoveBaseGoal(goal))
            self._handle = handle
            try:
                result = handle.wait(max(0.0, self.scenario.time_limit - clock.now()))
            except TimeoutError:
                handle.cancel(f"the time limit of {self.scenario.time_limit:g} s")
                result = handle.wait(10.0)
            if not result.success:
                break
        return result

    def _record_plan(self, handle: AnyGoalHandle) -> None:
        path = handle.result.path if handle.result is not None else None
        if path is not None:
            self.recorder.path(self.simulation.time, path.positions)

    def _reporter(self, navigator: Navigator, started: float) -> Callable[[float, Pose, float], None]:
        def report(time: float, pose: Pose, speed: float) -> None:
            handle = self._handle
            feedback = handle.feedback if handle is not None else None
            self.options.on_progress(
                Progress(
                    time=time,
                    wall_time=wall_seconds() - started,
                    distance_left=feedback.distance_along_path if feedback else float("nan"),
                    speed=speed,
                    tilt=float(np.arccos(np.clip(pose.rotation[2, 2], -1.0, 1.0))),
                    state=handle.status.value if handle is not None else "starting",
                )
            )

        return report


def _navigation_config(scenario: Scenario, backend: str, world: ScenarioWorld, folder: Path) -> Path:
    """Write the backend's configuration with the world's files filled in; a run can be planned again from it."""
    source = scenario.navigation.get(backend)
    if source is None:
        known = ", ".join(scenario.navigation)
        raise ConfigError([Finding(scenario.name, 1, "navigation", f"one of {known}", repr(backend))])
    text = source.read_text()
    for placeholder, file in world.files.items():
        text = text.replace(placeholder, json.dumps(file.name))
    target = folder / "navigation.yaml"
    target.write_text(text)
    return target


def _write_results(recording: Recording, run: _Run, options: RunOptions) -> RunResult:
    """Write metrics, recording, picture and replay."""
    folder = options.folder
    metrics = measure(recording).to_json()
    metrics["mishaps"] = sorted({mishap.kind.value for mishap in run.simulation.mishaps})
    metrics["seed"] = run.seed
    (folder / "metrics.json").write_text(json.dumps(metrics, indent=2, sort_keys=True) + "\n")
    factor = recording.duration / run.wall_time if run.wall_time > 0.0 else 0.0
    timing = {"wall_time_s": run.wall_time, "real_time_factor": factor}
    (folder / "timing.json").write_text(json.dumps(timing, indent=2) + "\n")
    recording.save(folder / "recording.npz")
    _draw(recording, options)
    return RunResult(
        success=run.result.success,
        outcome=run.result.outcome,
        outcome_name=run.result.outcome_name,
        message=run.result.message,
        folder=folder,
        metrics={**metrics, **timing},
    )


def _draw(recording: Recording, options: RunOptions) -> None:
    from terrain.viewer.picture import write_picture
    from terrain.viewer.replay import write_replay

    options.on_step("drawing the picture")
    write_picture(options.folder / "picture.png", recording)
    options.on_step("writing the replay")
    write_replay(options.folder / "replay.html", recording)
