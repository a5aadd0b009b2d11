"""The robot's numbers for a navigation configuration: ``$ROBOT_FOOTPRINT`` and others stand there for what is found.

The limits of slope are the steepest that the wheels hold on (``max_slope``), or less, so that ``tip_over_margin`` is
left to where the robot tips over.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable

from mbf_abstract.config.findings import ConfigError, Finding, suggest
from terrain.description.description import RobotDescription
from terrain.description.outline import footprint_radii

PLACEHOLDER = re.compile(r"\$ROBOT_[A-Z_]*[A-Z]")
SLOPES = ("$ROBOT_MAX_ROLL", "$ROBOT_MAX_PITCH_UP", "$ROBOT_MAX_PITCH_DOWN")
MOTION_MODELS = {"ackermann": "ackermann", "omni": "omni", "legged": "omni"}
DIGITS = 4


def robot_values(robot: RobotDescription) -> dict[str, str]:
    """Placeholders and the YAML text that stands for each; those that the robot has no number for are left out."""
    inscribed, circumscribed = footprint_radii(robot.footprint)
    corners = ", ".join(f"[{_text(x)}, {_text(y)}]" for x, y in robot.footprint)
    values = {
        "$ROBOT_FOOTPRINT": f"[{corners}]",
        "$ROBOT_INSCRIBED_RADIUS": _text(inscribed),
        "$ROBOT_CIRCUMSCRIBED_RADIUS": _text(circumscribed),
        "$ROBOT_HALF_WIDTH": _text(max(abs(y) for _, y in robot.footprint)),
        "$ROBOT_HEIGHT": _text(robot.height),
        "$ROBOT_MOTION_MODEL": MOTION_MODELS.get(robot.drive, "differential"),
        "$ROBOT_MIN_TURNING_RADIUS": _text(robot.min_turning_radius),
        "$ROBOT_MAX_SPEED": _text(robot.max_speed),
        "$ROBOT_MAX_SIDE_SPEED": _text(robot.max_speed if robot.drive in ("omni", "legged") else 0.0),
        "$ROBOT_MAX_YAW_RATE": _text(robot.max_yaw_rate),
        "$ROBOT_MAX_ACCELERATION": _text(robot.stated.max_acceleration),
        "$ROBOT_MAX_YAW_ACCELERATION": _text(robot.stated.max_yaw_acceleration),
    }
    return values | _of_a_standing_robot(robot)


def _of_a_standing_robot(robot: RobotDescription) -> dict[str, str]:
    """What the tilt layer takes; empty where the slopes at which the robot tips over are not known."""
    if robot.tipping is None:
        return {}
    xs, ys = robot.contacts[:, 0].tolist(), robot.contacts[:, 1].tolist()
    x, _, z = robot.center_of_mass
    found, stated = robot.tipping, robot.stated

    def limit(*slopes: float) -> str:
        return _text(max(0.0, min(stated.max_slope, *(slope - stated.tip_over_margin for slope in slopes))))

    steepest = max(0.0, min(stated.max_slope, found.least - stated.tip_over_margin))
    return {
        "$ROBOT_WHEELBASE": _text(max(xs) - min(xs)),
        "$ROBOT_TRACK": _text(max(ys) - min(ys)),
        "$ROBOT_GROUND_CLEARANCE": _text(robot.ground_clearance),
        "$ROBOT_CENTER_OF_MASS_HEIGHT": _text(z),
        "$ROBOT_CENTER_OF_MASS_X": _text(x - 0.5 * (max(xs) + min(xs))),
        "$ROBOT_MAX_ROLL": limit(found.left, found.right),
        "$ROBOT_MAX_PITCH_UP": limit(found.backward),
        "$ROBOT_MAX_PITCH_DOWN": limit(found.forward),
        "$ROBOT_MAX_TILT": _text(max(0.0, 0.5 * (steepest + found.least))),
    }


def fill_in(text: str, file: str, describe: Callable[[], RobotDescription]) -> str:
    """Return a configuration with its placeholders replaced; ``describe`` is called if there are any.

    Raises
    ------
    ConfigError
        There is no such placeholder, or the robot has no number for it, or it takes no slope in a direction asked for.
    """
    asked = sorted({match[0] for match in PLACEHOLDER.finditer(text)})
    if not asked:
        return text
    robot = describe()
    values = robot_values(robot)
    lines = text.splitlines()
    wrong = {name: _expected(robot, values) for name in asked if name not in values}
    wrong |= {name: _steeper(robot) for name in SLOPES if name in asked and float(values.get(name, "1")) == 0.0}
    findings = [
        Finding(file, number, "", expected, *((f"{name}, 0",) if name in values else (name, suggest(name, values))))
        for name, expected in wrong.items()
        for number, line in enumerate(lines, 1)
        if name in PLACEHOLDER.findall(line)
    ]
    if findings:
        raise ConfigError(findings)
    return PLACEHOLDER.sub(lambda match: values[match[0]], text)


def _expected(robot: RobotDescription, values: dict[str, str]) -> str:
    return f"a number that is known of {robot.urdf.name} ({robot.drive}): {', '.join(values)}"


def _steeper(robot: RobotDescription) -> str:
    """What a robot needs that takes no slope."""
    assert robot.tipping is not None
    least, margin = math.degrees(robot.tipping.least), math.degrees(robot.stated.tip_over_margin)
    found = f"{robot.urdf.name} tips over at {least:.0f} degrees, tip_over_margin is {margin:.0f} degrees"
    return f"a slope above 0 ({found}; is its center_of_mass right?)"


def _text(value: float) -> str:
    return f"{round(value, DIGITS) + 0.0:g}" if abs(value) < 1e-3 else repr(round(value, DIGITS))
