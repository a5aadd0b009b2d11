"""Scenarios: a world, a robot, its sensors, goals and limits in one YAML file, for any map backend.

The navigation itself is configured in files of its own, one per backend, so that a scenario does not change when the
backend does. In those files the texts ``$WORLD_MESH`` and ``$WORLD_MAP`` stand for the mesh and the map_server yaml
that the run writes of its world.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Literal

from mbf_abstract.config.findings import ConfigError, Finding
from mbf_abstract.config.validation import validate
from mbf_abstract.config.yaml_source import YamlDocument, load_yaml
from mbf_abstract.parameters import ParameterModel, parameter
from terrain.scenarios.actors import Actor
from terrain.scenarios.faults import IMU, LOCALIZATION, ODOMETRY, Fault, SensorFault
from terrain.scenarios.limits import Limits
from terrain.scenarios.noise import LocalizationNoise, MapNoise
from terrain.scenarios.obstacles import Forest, Obstacle
from terrain.scenarios.perturbation import Perturbation
from terrain.scenarios.places import Place, PlanarPose
from terrain.scenarios.world_types import LevelsWorld, MapWorld, TerrainWorld, World

__all__ = ["MapWorld", "Obstacle", "PlanarPose", "Scenario", "Sensor", "load_scenario", "shipped_scenarios"]

SHIPPED = Path(__file__).parent / "library"


class Sensor(ParameterModel):
    """A lidar or depth camera on the robot."""

    name: str = parameter("lidar", "Name of the source, as the map layers call it.")
    type: Literal["planar", "rings", "depth"] = parameter(
        "planar", "One horizontal ring, 16 rings, or a depth camera of 70 degrees that looks ahead."
    )
    rate: float = parameter(10.0, "Scans a second.", unit="Hz", gt=0.0, le=60.0)
    rays: int = parameter(360, "Rays of a ring; columns of a camera, which has 3/4 as many rows.", ge=3, le=10_000)
    max_range: float = parameter(10.0, "Range.", unit="m", gt=0.0)
    noise: float = parameter(0.01, "Standard deviation of a range.", unit="m", ge=0.0)
    drop_out: float = parameter(0.0, "Share of rays without an answer.", ge=0.0, lt=1.0)


class Scenario(ParameterModel):
    """One scenario file."""

    name: str = parameter(..., "Short name.")
    proves: str = parameter(..., "One line: what a successful run shows.")
    backend: str = parameter(..., "Map backend to use where the command line names none.")
    navigation: dict[str, Path] = parameter(..., "Configuration file of each backend.")
    world: World = parameter(..., "What it takes place in.")
    robot: Literal["husky", "turtlebot", "car"] = parameter(..., "Model of the robot.")
    start: Place = parameter(..., "Where the robot starts: x, y, yaw, or the name of a place of the world.")
    goals: tuple[Place, ...] = parameter(..., "Where it goes, in order.")
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
        path = SHIPPED / f"{name_or_file}.yaml"
        if not path.is_file():
            known = ", ".join(sorted(shipped_scenarios()))
            raise ConfigError(
                [Finding(str(name_or_file), 1, "", f"a file, or one of {known}", repr(str(name_or_file)))]
            )
    return path


def read_scenario(document: YamlDocument, findings: list[Finding]) -> Scenario | None:
    """Make a scenario of a document; what is wrong is appended to ``findings``, None if it is no scenario at all."""
    scenario = validate(Scenario, document.data, document, (), findings)
    if scenario is None:
        return None
    scenario = _with_absolute_files(scenario, document.path.parent)
    findings += _find_contradictions(scenario, document)
    return scenario


def _with_absolute_files(scenario: Scenario, folder: Path) -> Scenario:
    """Let relative files count from the scenario's folder."""
    navigation = {backend: folder / file for backend, file in scenario.navigation.items()}
    file = getattr(scenario.world, "file", None)
    world = scenario.world if file is None else scenario.world.model_copy(update={"file": folder / file})
    return scenario.model_copy(update={"navigation": navigation, "world": world})


def _find_contradictions(scenario: Scenario, document: YamlDocument) -> list[Finding]:
    """Find what is legal key by key and wrong together."""
    findings = []
    if not scenario.goals:
        findings.append(document.finding(("goals",), "at least one goal", "none"))
    if scenario.backend not in scenario.navigation:
        known = ", ".join(scenario.navigation) or "none"
        expected = f"a backend listed under navigation ({known})"
        findings.append(document.finding(("backend",), expected, scenario.backend))
    for backend, file in scenario.navigation.items():
        if not file.is_file():
            findings.append(document.finding(("navigation", backend), "a configuration file", f"no file {file}"))
    if scenario.physics == "kinematic" and isinstance(scenario.world, LevelsWorld):
        findings.append(document.finding(("physics",), "bullet, for a world with several levels", scenario.physics))
    if scenario.map.spacing is not None and not isinstance(scenario.world, TerrainWorld):
        expected = f"no spacing, which only maps of open ground have (a world of type {scenario.world.type} has none)"
        findings.append(document.finding(("map", "spacing"), expected, f"{scenario.map.spacing:g}"))
    sensors = [*(sensor.name for sensor in scenario.sensors), *proprioceptive_sensors(scenario), LOCALIZATION]
    for index, fault in enumerate(scenario.faults):
        if isinstance(fault, SensorFault) and fault.sensor not in sensors:
            expected = "one of " + ", ".join(sensors)
            findings.append(document.finding(("faults", index, "sensor"), expected, repr(fault.sensor)))
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
    files = list(load_yaml(known[name]).data["navigation"].values())
    copies = {folder / known[name].name: known[name]} | {folder / file: SHIPPED / file for file in files}
    there = [Finding(str(copy), 1, "", "no file, because a copy comes here", "one") for copy in copies if copy.exists()]
    if there:
        raise ConfigError(there)
    for copy, source in copies.items():
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_bytes(source.read_bytes())
    return list(copies)


def shipped_scenarios() -> dict[str, Path]:
    """Names and files of the scenarios that come with the package."""
    return {file.stem: file for file in sorted(SHIPPED.glob("*.yaml"))}
