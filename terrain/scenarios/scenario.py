"""Scenarios: a world, a robot, its sensors, goals and limits in one YAML file, for any map backend.

The navigation itself is configured in files of its own, one per backend, so that a scenario does not change when the
backend does. In those files the texts ``$WORLD_MESH`` and ``$WORLD_MAP`` stand for the mesh and the map_server yaml
that the run writes of its world, and ``$ROBOT_FOOTPRINT`` and others for the robot's numbers.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Literal

from mbf_abstract.config.bounded_files import is_file
from mbf_abstract.config.configuration import PLUGIN_LISTS
from mbf_abstract.config.findings import ConfigError, Finding, KeyPath
from mbf_abstract.config.validation import validate
from mbf_abstract.config.yaml_source import YamlDocument, load_yaml
from mbf_abstract.parameters import ParameterModel, parameter
from terrain.scenarios.actors import Actor
from terrain.scenarios.faults import IMU, LOCALIZATION, ODOMETRY, Fault, SensorFault
from terrain.scenarios.library import LIBRARY, shipped_scenarios
from terrain.scenarios.limits import Limits
from terrain.scenarios.noise import LocalizationNoise, MapNoise
from terrain.scenarios.obstacles import Forest, Obstacle
from terrain.scenarios.perturbation import Perturbation
from terrain.scenarios.places import Place, PlanarPose
from terrain.scenarios.robots import OwnRobot, Sensor
from terrain.scenarios.world_types import LevelsWorld, MapWorld, TerrainWorld, World
from terrain.urdf_robots.robot_choice import RobotChoice, find_wrong_robot, is_legged, located, missing_urdf

__all__ = ["MapWorld", "Obstacle", "PlanarPose", "Scenario", "Sensor", "load_scenario"]


class Scenario(ParameterModel):
    """One scenario file."""

    name: str = parameter(..., "Short name.")
    proves: str = parameter(..., "One line: what a successful run shows.")
    backend: str = parameter(..., "Map backend to use where the command line names none.")
    navigation: dict[str, Path] = parameter(..., "Configuration file of each backend.")
    world: World = parameter(..., "What it takes place in.")
    robot: RobotChoice = parameter(..., "A model that ships, or a robot of your own: my.urdf, or urdf: and more.")
    start: Place | None = parameter(None, "Where the robot starts: x, y, yaw, or the name of a place of the world.")
    goals: tuple[Place, ...] = parameter((), "Where it goes, in order.")
    robots: tuple[OwnRobot, ...] = parameter(
        (), "Several robots instead of one with start and goals, each with a navigation server, on one clock."
    )
    sensors: tuple[Sensor, ...] = parameter((), "Its lidars and cameras.")
    odometry: Literal["exact", "wheels"] = parameter(
        "exact", "True velocity, or that of the turning wheels; then odom drifts and map -> odom corrects it."
    )
    imu: bool = parameter(False, "Whether it has an IMU, for scripts: simulation.latest['imu'] is the tilt.")
    localization: LocalizationNoise = parameter(LocalizationNoise(), "Noise of the pose; none = exact.")
    map: MapNoise = parameter(MapNoise(), "What is wrong with the map; nothing = it is the world itself.")
    perturb: Perturbation = parameter(Perturbation(), "What each run may change, drawn from its seed.")
    obstacles: tuple[Obstacle, ...] = parameter((), "Things that are on no map.")
    forests: tuple[Forest, ...] = parameter((), "Posts that are on no map, drawn from the seed.")
    actors: tuple[Actor, ...] = parameter((), "What moves by itself.")
    faults: tuple[Fault, ...] = parameter((), "What goes wrong with sensors and localisation, and when.")
    limits: Limits = parameter(Limits(), "What must not happen.")
    physics: Literal["bullet", "kinematic"] = parameter(
        "bullet", "Real physics, or robots that follow commands exactly: for sweeps on flat ground, much faster."
    )
    physics_rate: float = parameter(
        240.0,
        "Steps of the physics a second; 120 takes half as long and moves a robot almost alike.",
        unit="Hz",
        ge=60.0,
        le=1000.0,
    )
    time_limit: float = parameter(300.0, "Simulated time after which the run is ended.", unit="s", gt=0.0)
    seed: int = parameter(0, "Seed where the command line names none.", ge=0)


def load_scenario(name_or_file: str | os.PathLike[str]) -> Scenario:
    """Read a shipped scenario by name, or a file; raises ConfigError with all findings."""
    document, findings = load_yaml(scenario_file(name_or_file)), list[Finding]()
    scenario = read_scenario(document, findings)
    if scenario is None or findings:
        raise ConfigError(findings)
    return scenario


def scenario_file(name_or_file: str | os.PathLike[str]) -> Path:
    """Return the file of a shipped scenario, or the file that is named; raises ConfigError for an unknown name."""
    path = Path(name_or_file)
    if path.suffix not in (".yaml", ".yml"):
        path = LIBRARY / f"{name_or_file}.yaml"
        if not is_file(path):
            known = ", ".join(sorted(shipped_scenarios()))
            raise ConfigError(
                [Finding(str(name_or_file), 1, "", f"a file, or one of {known}", repr(str(name_or_file)))]
            )
    return path


def read_scenario(document: YamlDocument, findings: list[Finding]) -> Scenario | None:
    """Make a scenario of a document; what is wrong is appended to ``findings``, None if it is no scenario at all."""
    if document.data.keys() & PLUGIN_LISTS.keys() and not document.data.keys() & {"world", "navigation"}:
        hint = "a scenario has a world, a robot and goals, and names its configurations under navigation"
        findings.append(document.finding((), "a scenario", "a configuration", hint))
        return None
    scenario = validate(Scenario, document.data, document, (), findings)
    if scenario is None:
        return None
    scenario = _with_absolute_files(scenario, document.path.parent)
    findings += _find_contradictions(scenario, document)
    return scenario


def _with_absolute_files(scenario: Scenario, folder: Path) -> Scenario:
    """Let relative files count from the scenario's folder."""

    def absolute(files: dict[str, Path]) -> dict[str, Path]:
        return {backend: folder / file for backend, file in files.items()}

    file = getattr(scenario.world, "file", None)
    world = scenario.world if file is None else scenario.world.model_copy(update={"file": folder / file})
    robots = []
    for robot in scenario.robots:
        of_own = {} if robot.navigation is None else {"navigation": absolute(robot.navigation)}
        choice = robot.robot if robot.robot is None else located(robot.robot, folder)
        robots.append(robot.model_copy(update={**of_own, "robot": choice}))
    changes = {"navigation": absolute(scenario.navigation), "world": world, "robots": tuple(robots)}
    return scenario.model_copy(update={**changes, "robot": located(scenario.robot, folder)})


def robot_scenarios(scenario: Scenario) -> dict[str, Scenario]:
    """Return what each robot of a scenario drives, by its name: the scenario with this robot as its only one.

    The one robot of a scenario without ``robots`` has no name, and its scenario is the scenario itself.
    """
    if not scenario.robots:
        return {"": scenario}
    views = {}
    for robot in scenario.robots:
        own = {key: value for key, value in robot if value is not None}
        own["name"] = f"{scenario.name}/{robot.name}"
        views[robot.name] = scenario.model_copy(update={**own, "robots": ()})
    return views


def _find_contradictions(scenario: Scenario, document: YamlDocument) -> list[Finding]:
    """Find what is legal key by key and wrong together."""
    findings = _find_missing_robots(scenario, document)
    for number, view in enumerate(robot_scenarios(scenario).values()):
        findings += _find_contradictions_of(view, document, partial(_keys_of, scenario, number))
    if scenario.physics == "kinematic" and isinstance(scenario.world, LevelsWorld):
        findings.append(document.finding(("physics",), "bullet, for a world with several levels", scenario.physics))
    if scenario.map.spacing is not None and not isinstance(scenario.world, TerrainWorld):
        expected = f"nothing in a world of type {scenario.world.type}: only maps of open ground have a spacing"
        findings.append(document.finding(("map", "spacing"), expected, f"{scenario.map.spacing:g}"))
    return list(dict.fromkeys(findings))


def _find_missing_robots(scenario: Scenario, document: YamlDocument) -> list[Finding]:
    """Either one robot with start and goals, or several with names of their own."""
    findings = []
    if not scenario.robots:
        if scenario.start is None:
            findings.append(document.finding(("start",), "a value", "nothing"))
        if not scenario.goals:
            findings.append(document.finding(("goals",), "at least one goal", "none"))
        return findings
    for key in ("start", "goals"):
        if getattr(scenario, key):
            findings.append(document.finding((key,), "nothing beside robots, which have their own", "a value"))
    names = [robot.name for robot in scenario.robots]
    for number, name in enumerate(names):
        if name in names[:number]:
            findings.append(document.finding(("robots", number, "name"), "a name of its own", repr(name)))
    return findings


def _keys_of(scenario: Scenario, number: int, *keys: str | int) -> KeyPath:
    """Where a value of a robot stands: in its own block if it is there, else in the scenario."""
    is_own = scenario.robots and getattr(scenario.robots[number], str(keys[0])) is not None
    return ("robots", number, *keys) if is_own else keys


def _find_contradictions_of(scenario: Scenario, document: YamlDocument, at: Callable[..., KeyPath]) -> list[Finding]:
    """Find what is wrong together in what one robot drives; ``at`` returns where a value of it stands."""
    findings = find_wrong_robot(scenario.robot)
    if missing := missing_urdf(scenario.robot, document.path.parent):
        findings = [document.finding(at("robot"), "a URDF", missing)]
    if not findings and scenario.physics != "kinematic" and is_legged(scenario.robot):
        expected = "kinematic, for a robot on legs, whose gait is not simulated"
        findings.append(document.finding(("physics",), expected, scenario.physics))
    if scenario.backend not in scenario.navigation:
        known = ", ".join(scenario.navigation) or "none"
        expected = f"a backend listed under navigation ({known})"
        findings.append(document.finding(at("backend"), expected, scenario.backend))
    for backend, file in scenario.navigation.items():
        if not is_file(file):
            findings.append(document.finding(at("navigation", backend), "a configuration file", f"no file {file}"))
    own = [sensor.name for sensor in scenario.sensors]
    for index, name in enumerate(own):
        if name in own[:index]:  # of two with one name only the last would be there
            findings.append(document.finding(at("sensors", index, "name"), "a name of its own", repr(name)))
    sensors = [*own, *proprioceptive_sensors(scenario), LOCALIZATION]
    for index, fault in enumerate(scenario.faults):
        if isinstance(fault, SensorFault) and fault.sensor not in sensors:
            expected = "one of " + ", ".join(sensors)
            findings.append(document.finding(at("faults", index, "sensor"), expected, repr(fault.sensor)))
    return findings


def proprioceptive_sensors(scenario: Scenario) -> list[str]:
    """Names of the proprioceptive sensors."""
    return [ODOMETRY] * (scenario.odometry == "wheels") + [IMU] * scenario.imu


def copy_scenario(name: str, folder: Path) -> list[Path]:
    """Copy a shipped scenario with the configurations it names into ``folder``; the copy runs as it is.

    Returns
    -------
    list of Path
        The copies, the scenario first.

    Raises
    ------
    ConfigError
        There is no such scenario, or a file of a copy's name is there already; then nothing is copied.
    """
    known = shipped_scenarios()
    if name not in known:
        raise ConfigError([Finding("scenarios", 1, name, f"one of {', '.join(known)}", repr(name))])
    data = load_yaml(known[name]).data
    files = [file for block in (data, *data.get("robots", ())) for file in block.get("navigation", {}).values()]
    copies = {folder / known[name].name: known[name]} | {folder / file: LIBRARY / file for file in files}
    there = [
        Finding(str(copy), 1, "", "a file that does not exist yet", "one that exists")
        for copy in copies
        if copy.exists()
    ]
    if there:
        raise ConfigError(there)
    for copy, source in copies.items():
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_bytes(source.read_bytes())
    return list(copies)
