"""What a user may state about a robot that has a URDF, here or on a command line; the rest is found from it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, Literal

import yaml
from pydantic import field_validator, model_validator

from mbf_abstract.config.findings import ConfigError, Finding
from mbf_abstract.config.validation import validate
from mbf_abstract.config.yaml_source import YamlDocument
from mbf_abstract.parameters import ParameterModel, parameter
from terrain.description.outline import surrounds_base

DriveName = Literal["differential", "skid", "ackermann", "omni", "tracked", "legged"]
Corners = tuple[tuple[float, float], ...]


class UrdfRobot(ParameterModel):
    """A robot described by a URDF. Positions are in ``base_link`` as navigation has it: on the ground, x ahead."""

    urdf: str = parameter(..., "The URDF: a file, or package://NAME/... .")
    drive: DriveName | None = parameter(None, "How its wheels move it; absent = found from the wheels.")
    wheels: tuple[str, ...] = parameter((), "Joints of its wheels; empty = found from axes and shapes.")
    footprint: Literal["auto"] | Corners = parameter(
        "auto", "Corners of the outline, counter-clockwise; auto = the hull of the collision shapes.", unit="m"
    )
    footprint_heights: tuple[float, float] = parameter(
        (0.0, 100.0), "Heights above the ground between which collision shapes count for the footprint.", unit="m"
    )
    footprint_corners: int = parameter(12, "Most corners of a footprint that is found.", ge=4, le=64)
    height: float | None = parameter(None, "Height above the ground.", unit="m", gt=0.0, le=100.0)
    mass: float | None = parameter(None, "Of the whole robot; all parts become heavier alike.", unit="kg", gt=0.0)
    center_of_mass: tuple[float, float, float] | None = parameter(None, "Centre of mass, above the ground.", unit="m")
    wheel_radius: float | None = parameter(None, "Of its wheels, casters apart.", unit="m", gt=0.0)
    wheelbase: float | None = parameter(None, "Distance of the outermost axles.", unit="m", gt=0.0)
    track: float | None = parameter(None, "Distance of left and right wheels, from middle to middle.", unit="m", gt=0.0)
    track_multiplier: float | None = parameter(
        None, "A robot that skids turns as if its track were this much wider.", ge=1.0, le=10.0
    )
    ground_clearance: float | None = parameter(None, "Height of the belly above the ground.", unit="m", gt=0.0)
    max_speed: float | None = parameter(None, "Speed limit.", unit="m/s", gt=0.0, le=100.0)
    max_yaw_rate: float | None = parameter(None, "Limit of the yaw rate.", unit="rad/s", gt=0.0, le=50.0)
    max_acceleration: float = parameter(1.5, "Limit; a URDF has none.", unit="m/s^2", gt=0.0, le=100.0)
    max_yaw_acceleration: float = parameter(4.0, "Limit; a URDF has none.", unit="rad/s^2", gt=0.0, le=100.0)
    max_steering_angle: float | None = parameter(
        None, "Of a car, for the wheel in the middle of its axle.", unit="rad", gt=0.0, lt=1.4
    )
    motor_torque: float | None = parameter(None, "Limit of each driven wheel.", unit="N m", gt=0.0)
    max_slope: float = parameter(
        0.45, "Steepest slope that planning may use, on which wheels still hold.", unit="rad", gt=0.0, lt=1.57
    )
    tip_over_margin: float = parameter(0.15, "Angle to keep from tipping over.", unit="rad", ge=0.0, lt=1.57)
    lidar_position: tuple[float, float, float] | None = parameter(
        None, "Of the scanner; absent = above the middle, 5 cm over the top.", unit="m"
    )

    @field_validator("footprint")
    @classmethod
    def _footprint_is_convex(cls, value: Literal["auto"] | Corners) -> Literal["auto"] | Corners:
        if value == "auto":
            return value
        ahead = (*value[1:], *value[:1])
        beyond = (*value[2:], *value[:2])
        turns = [
            (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0])
            for a, b, c in zip(value, ahead, beyond, strict=True)
        ]
        if len(value) < 3 or min(turns) <= 0.0 or not _goes_around_once(value):
            raise ValueError("auto, or at least three corners of a convex outline, counter-clockwise")
        if not surrounds_base(value):
            raise ValueError("auto, or an outline around base_link, (0, 0), which lies outside of it")
        return value

    @field_validator("center_of_mass")
    @classmethod
    def _mass_is_above_the_ground(cls, value: tuple[float, float, float] | None) -> tuple[float, float, float] | None:
        if value is not None and not value[2] > 0.0:
            raise ValueError("x, y, z [m] with z above 0, the ground")
        return value

    @model_validator(mode="after")
    def _heights_rise(self) -> UrdfRobot:
        if self.footprint_heights[0] >= self.footprint_heights[1]:
            raise ValueError("footprint_heights: the lower height first")
        return self


def _goes_around_once(corners: Corners) -> bool:
    """Whether an outline that turns left at every corner turns once in all; a star of five points turns twice."""
    ends = [*corners[1:], corners[0]]
    headings = [math.atan2(b[1] - a[1], b[0] - a[0]) for a, b in zip(corners, ends, strict=True)]
    turned = sum(
        (after - before) % math.tau for before, after in zip(headings, [*headings[1:], headings[0]], strict=True)
    )
    return turned < 1.5 * math.tau


def stated_robot(urdf: str, settings: list[str]) -> UrdfRobot:
    """Make a robot's parameters from a URDF and ``KEY=VALUE`` texts of a command line, whose values are YAML.

    Raises
    ------
    ConfigError
        A text is no such pair, a key is unknown, or a value is not legal; all findings.
    """
    data: dict[str, Any] = {"urdf": urdf}
    findings: list[Finding] = []
    for text in settings:
        key, _, value = text.partition("=")
        if not key or not value or key == "urdf":
            findings.append(Finding("--set", 1, "", "KEY=VALUE with a key of a scenario's robot", repr(text)))
            continue
        try:
            data[key] = yaml.safe_load(value)
        except yaml.YAMLError:
            findings.append(Finding("--set", 1, key, "a value as in a YAML file", repr(value)))
    robot = validate(UrdfRobot, data, YamlDocument(Path("--set"), data), (), findings)
    if robot is None or findings:
        raise ConfigError(findings)
    return robot
