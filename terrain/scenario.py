"""Scenarios: a world, a robot, its sensors, goals and limits in one YAML file, for any map backend.

The navigation itself is configured in files of its own, one per backend, so that a scenario does not change when the
backend does. In those files the texts ``$WORLD_MESH`` and ``$WORLD_MAP`` stand for the mesh and the map_server yaml
that the run writes of its world.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from mbf_abstract.findings import ConfigError, Finding
from mbf_abstract.geometry import Pose
from mbf_abstract.parameters import ParameterModel, parameter
from mbf_abstract.validation import validate
from mbf_abstract.yaml_source import load_yaml

SHIPPED = Path(__file__).parent / "scenarios"


class JacksboroWorld(ParameterModel):
    """Real hills: the Jacksboro fault, shrunk isotropically."""

    type: Literal["jacksboro"]
    size: float = parameter(100.0, "Length along x.", unit="m", gt=1.0, le=1000.0)
    spacing: float | None = parameter(None, "Sample again at this distance; absent = the survey's own.", unit="m")
    roughness: float = parameter(0.0, "Root mean square height of small bumps added to the survey.", unit="m", ge=0.0)


class OfficeWorld(ParameterModel):
    """The office floor that comes with the package."""

    type: Literal["office"]


class MapWorld(ParameterModel):
    """A building from a map_server map."""

    type: Literal["map"]
    file: Path = parameter(..., "The map's yaml file.")


World = Annotated[JacksboroWorld | OfficeWorld | MapWorld, Field(discriminator="type")]


class Obstacle(ParameterModel):
    """Something that stands in the world but on no map."""

    shape: Literal["box", "cylinder"] = parameter("box", "Its form.")
    x: float = parameter(..., "Position of its middle.", unit="m")
    y: float = parameter(..., "Position of its middle.", unit="m")
    yaw: float = parameter(0.0, "Heading.", unit="rad")
    size: tuple[float, float, float] = parameter((0.5, 0.5, 1.0), "Length, width, height; a cylinder's diameter.")


class Sensor(ParameterModel):
    """A lidar on the robot."""

    name: str = parameter("lidar", "Name of the source, as the map layers call it.")
    type: Literal["planar", "rings"] = parameter("planar", "One horizontal ring, or 16 rings.")
    rate: float = parameter(10.0, "Scans a second.", unit="Hz", gt=0.0, le=60.0)
    rays: int = parameter(360, "Rays of a ring.", ge=3, le=10_000)
    max_range: float = parameter(10.0, "Range.", unit="m", gt=0.0)
    noise: float = parameter(0.01, "Standard deviation of a range.", unit="m", ge=0.0)
    drop_out: float = parameter(0.0, "Share of rays without an answer.", ge=0.0, lt=1.0)


class PlanarPose(ParameterModel):
    """A place on the ground."""

    x: float = parameter(..., "Position.", unit="m")
    y: float = parameter(..., "Position.", unit="m")
    yaw: float = parameter(0.0, "Heading.", unit="rad")


class Scenario(ParameterModel):
    """One scenario file."""

    name: str = parameter(..., "Short name.")
    proves: str = parameter(..., "One line: what a successful run shows.")
    backend: str = parameter(..., "Map backend to use where the command line names none.")
    navigation: dict[str, Path] = parameter(..., "Configuration file of each backend.")
    world: World = parameter(..., "What it takes place in.")
    robot: Literal["husky", "turtlebot"] = parameter(..., "Model of the robot.")
    start: PlanarPose = parameter(..., "Where the robot starts.")
    goals: tuple[PlanarPose, ...] = parameter(..., "Where it shall go, in order.")
    sensors: tuple[Sensor, ...] = parameter((), "Its lidars.")
    obstacles: tuple[Obstacle, ...] = parameter((), "Things that are on no map.")
    time_limit: float = parameter(300.0, "Simulated time after which the run is ended.", unit="s", gt=0.0)
    seed: int = parameter(0, "Seed where the command line names none.", ge=0)


def load_scenario(name_or_file: str | os.PathLike[str]) -> Scenario:
    """Read a shipped scenario by name, or a file; raises ConfigError with all findings."""
    path = Path(name_or_file)
    if path.suffix not in (".yaml", ".yml"):
        path = SHIPPED / f"{name_or_file}.yaml"
        if not path.is_file():
            known = ", ".join(sorted(shipped_scenarios()))
            raise ConfigError(
                [Finding(str(name_or_file), 1, "", f"a file, or one of {known}", repr(str(name_or_file)))]
            )
    document = load_yaml(path)
    findings: list[Finding] = []
    scenario = validate(Scenario, document.data, document, (), findings)
    if scenario is not None and not scenario.goals:
        findings.append(document.finding(("goals",), "at least one goal", "none"))
    if scenario is not None and scenario.backend not in scenario.navigation:
        known = ", ".join(scenario.navigation) or "none"
        findings.append(
            document.finding(("backend",), f"a backend listed under navigation ({known})", scenario.backend)
        )
    if findings or scenario is None:
        raise ConfigError(findings)
    configs = {backend: document.path.parent / file for backend, file in scenario.navigation.items()}
    for backend, file in configs.items():
        if not file.is_file():
            findings.append(document.finding(("navigation", backend), "a configuration file", f"no file {file}"))
    if findings:
        raise ConfigError(findings)
    return scenario.model_copy(update={"navigation": configs})


def shipped_scenarios() -> dict[str, Path]:
    """Names and files of the scenarios that come with the package."""
    return {file.stem: file for file in sorted(SHIPPED.glob("*.yaml"))}


def ground_pose(place: PlanarPose, z: float) -> Pose:
    """Pose of a place on the ground at height ``z`` [m], upright."""
    return Pose.planar(place.x, place.y, place.yaw, z)
