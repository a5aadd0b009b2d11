"""The robots of a scenario that run a navigation server each, and their sensors."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Literal

from pydantic import field_validator

from mbf_abstract.parameters import ParameterModel, parameter
from terrain.scenarios.faults import Fault
from terrain.scenarios.noise import LocalizationNoise
from terrain.scenarios.perturbation import Perturbation
from terrain.scenarios.places import FARTHEST, Place
from terrain.urdf_robots.robot_choice import RobotChoice

NAME_OF_A_ROBOT = re.compile(r"[A-Za-z][A-Za-z0-9_]*")  # also of a folder, and the first part of sources of events


class Sensor(ParameterModel):
    """A lidar or depth camera on the robot."""

    name: str = parameter("lidar", "Name of the source, as the map layers call it.")
    type: Literal["planar", "rings", "depth"] = parameter(
        "planar", "One horizontal ring, 16 rings, or a depth camera of 70 degrees that looks ahead."
    )
    rate: float = parameter(10.0, "Scans a second.", unit="Hz", gt=0.0, le=60.0)
    rays: int = parameter(360, "Rays of a ring; columns of a camera, which has 3/4 as many rows.", ge=3, le=10_000)
    max_range: float = parameter(10.0, "Range.", unit="m", gt=0.0, le=FARTHEST)
    noise: float = parameter(0.01, "Standard deviation of a range.", unit="m", ge=0.0, le=FARTHEST)
    drop_out: float = parameter(0.0, "Share of rays without an answer.", ge=0.0, lt=1.0)


class OwnRobot(ParameterModel):
    """One of several robots, each with a navigation server of its own; what is absent is that of the scenario."""

    name: str = parameter(..., "Its name, and that of its results; letters, digits and _.")
    start: Place = parameter(..., "Where it starts: x, y, yaw, or the name of a place of the world.")
    goals: tuple[Place, ...] = parameter(..., "Where it goes, in order.")
    robot: RobotChoice | None = parameter(None, "Model of the robot.")
    backend: str | None = parameter(None, "Map backend.")
    navigation: dict[str, Path] | None = parameter(None, "Configuration file of each backend.")
    sensors: tuple[Sensor, ...] | None = parameter(None, "Its lidars and cameras.")
    odometry: Literal["exact", "wheels"] | None = parameter(None, "Its velocity: the true one, or that of its wheels.")
    localization: LocalizationNoise | None = parameter(None, "Noise of its pose.")
    perturb: Perturbation | None = parameter(None, "What each run may change of it, and how late its commands are.")
    faults: tuple[Fault, ...] | None = parameter(None, "What goes wrong with its sensors and its localisation.")

    @field_validator("name")
    @classmethod
    def _is_a_name(cls, name: str) -> str:
        if NAME_OF_A_ROBOT.fullmatch(name) is None:
            raise ValueError("a letter, then letters, digits and _")
        return name

    @field_validator("goals")
    @classmethod
    def _has_a_goal(cls, goals: tuple[Place, ...]) -> tuple[Place, ...]:
        if not goals:
            raise ValueError("at least one goal")
        return goals
