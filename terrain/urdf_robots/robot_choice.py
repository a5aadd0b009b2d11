"""A scenario's robot: one that ships, by name, or one that a URDF describes; both as a model and for planning."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, Discriminator, Tag

from mbf_abstract.config.findings import ConfigError, Finding
from terrain.description.describe import describe
from terrain.description.description import RobotDescription
from terrain.description.mesh_files import find_file, missing_text
from terrain.description.parameters import UrdfRobot
from terrain.description.running_gear import sides_of
from terrain.physics.robot_models import ROBOTS, Drive, RobotSpec
from terrain.urdf_robots.body import write_body

DRIVES = {
    "differential": Drive.DIFFERENTIAL,
    "skid": Drive.SKID_STEER,
    "tracked": Drive.SKID_STEER,
    "ackermann": Drive.ACKERMANN,
    "omni": Drive.HOLONOMIC,
    "legged": Drive.HOLONOMIC,
}
SCRUBBING = (1.0, 0.5, 1.0)  # friction of wheels that skid: half as much along the axle, as the Husky has
OVER_THE_TOP = 0.05  # m; a lidar stands on the robot


def _kind(value: Any) -> str | None:
    """Which of the alternatives of ``RobotChoice`` a value is."""
    if isinstance(value, str):
        return "model" if value in ROBOTS else "file" if value.lower().endswith(".urdf") else None
    return "block" if isinstance(value, Mapping | UrdfRobot) else None


def _of_file(value: str) -> UrdfRobot:
    return UrdfRobot(urdf=value)


RobotChoice = Annotated[
    Annotated[Literal["husky", "turtlebot", "car"], Tag("model")]
    | Annotated[str, AfterValidator(_of_file), Tag("file")]
    | Annotated[UrdfRobot, Tag("block")],
    Discriminator(
        _kind,
        custom_error_type="robot",
        custom_error_message=f"{', '.join(ROBOTS)}, a file .urdf, or a block with the key urdf",
    ),
]


def located(choice: str | UrdfRobot, folder: Path) -> str | UrdfRobot:
    """The choice with the absolute path of its URDF, if there is one; relative paths begin in ``folder``."""
    if isinstance(choice, str):
        return choice
    file = find_file(choice.urdf, folder)
    return choice if file is None else choice.model_copy(update={"urdf": str(file.absolute())})


def missing_urdf(choice: str | UrdfRobot, folder: Path) -> str:
    """Where a URDF was looked for that is not there, relative ones from ``folder``; empty if nothing is missing."""
    if isinstance(choice, str) or find_file(choice.urdf, folder) is not None:
        return ""
    return missing_text(choice.urdf, folder)


def description_of(choice: str | UrdfRobot) -> RobotDescription:
    """Describe a scenario's robot; one that ships has the outline and the limits of its model.

    Raises
    ------
    ConfigError
        All that is wrong with its URDF.
    """
    if isinstance(choice, UrdfRobot):
        return describe(choice)
    spec = ROBOTS[choice]
    return describe(
        UrdfRobot(
            urdf=str(spec.urdf),
            footprint=spec.footprint,
            max_speed=spec.max_speed,
            max_yaw_rate=spec.max_yaw_rate,
            max_acceleration=spec.max_acceleration,
            max_yaw_acceleration=spec.max_yaw_acceleration,
            max_steering_angle=spec.max_steering_angle or None,
            motor_torque=spec.motor_torque,
        )
    )


def spec_of(choice: str | UrdfRobot) -> RobotSpec:
    """The model of a scenario's robot, as worlds take it; raises ConfigError as ``description_of``."""
    return ROBOTS[choice] if isinstance(choice, str) else _spec(describe(choice))


def simulated_spec(choice: str | UrdfRobot, folder: Path, name: str) -> RobotSpec:
    """The model of a robot whose body is to be put into Bullet; one from a URDF is written to ``NAME.urdf``."""
    if isinstance(choice, str):
        return ROBOTS[choice]
    robot = describe(choice)
    return replace(_spec(robot), file=write_body(robot, folder, name))


def find_wrong_robot(choice: str | UrdfRobot) -> list[Finding]:
    """What is wrong with a scenario's robot."""
    try:
        spec_of(choice)
    except ConfigError as error:
        return error.findings
    return []


def notes_on(choice: str | UrdfRobot) -> list[str]:
    """What was assumed of a robot from a URDF, or is odd about it; raises ConfigError as ``description_of``."""
    if isinstance(choice, str):
        return []
    robot = describe(choice)
    return [
        f"{robot.urdf.name}: {robot.drive} ({robot.gear.reason})",
        *(f"{robot.urdf.name}: {n}" for n in robot.notes),
    ]


def is_legged(choice: str | UrdfRobot) -> bool:
    """Whether a robot has legs; raises ConfigError as ``description_of``."""
    return isinstance(choice, UrdfRobot) and describe(choice).drive == "legged"


def _spec(robot: RobotDescription) -> RobotSpec:
    lefts, rights = sides_of(robot.gear.driven)
    xs, ys = zip(*robot.footprint, strict=True)
    top = (0.5 * (min(xs) + max(xs)), 0.5 * (min(ys) + max(ys)), robot.height + OVER_THE_TOP)
    places = np.array([wheel.centre - robot.p_root_base for wheel in robot.gear.wheels]).reshape(-1, 3)
    steered = robot.gear.steered  # the left one first
    drive = DRIVES[robot.drive]
    return RobotSpec(
        name=robot.urdf.name,
        drive=drive,
        footprint=tuple(robot.footprint),
        height=robot.height,
        mass=robot.mass,
        wheel_radius=robot.wheel_radius,
        track=robot.track,
        wheelbase=robot.wheelbase,
        left_wheels=() if drive is Drive.HOLONOMIC else tuple(wheel.joint for wheel in lefts),
        right_wheels=() if drive is Drive.HOLONOMIC else tuple(wheel.joint for wheel in rights),
        max_speed=robot.max_speed,
        max_yaw_rate=robot.max_yaw_rate,
        max_acceleration=robot.stated.max_acceleration,
        max_yaw_acceleration=robot.stated.max_yaw_acceleration,
        motor_torque=robot.motor_torque,
        lidar_position=robot.stated.lidar_position or top,
        steering=tuple(wheel.steering for wheel in steered) if drive is Drive.ACKERMANN else (),
        steers_behind=drive is Drive.ACKERMANN and bool(steered[0].centre[0] < robot.p_root_base[0]),
        max_steering_angle=robot.max_steering_angle,
        track_multiplier=robot.track_multiplier,
        wheel_friction=SCRUBBING if drive is Drive.SKID_STEER else (1.0, 1.0, 1.0),
        wheel_positions=tuple((x, y, z) for x, y, z in places.tolist()),
    )
