"""A robot's description as lines of a table and as JSON."""

from __future__ import annotations

import math
from typing import Any

from terrain.description.description import RobotDescription
from terrain.description.outline import footprint_radii
from terrain.description.placeholders import robot_values


def lines_of(robot: RobotDescription) -> list[tuple[str, str]]:
    """Names and texts, in the order of a table."""
    inscribed, circumscribed = footprint_radii(robot.footprint)
    gear = robot.gear
    lines = [
        ("drive", f"{gear.drive} ({gear.reason})"),
        ("wheels", ", ".join(wheel.joint for wheel in gear.wheels) or "none"),
        ("steered", ", ".join(sorted({wheel.steering for wheel in gear.wheels} - {""})) or "none"),
        ("supports", ", ".join(support.name for support in gear.supports) or "none"),
        ("base_link", f"{_point(robot.p_root_base.tolist())} m in {robot.urdf.root!r}"),
        ("footprint", f"{' '.join(f'[{x:.3f}, {y:.3f}]' for x, y in robot.footprint)} m"),
        ("radii", f"{inscribed:.3f} m inside, {circumscribed:.3f} m around"),
        ("height", f"{robot.height:.3f} m, ground clearance {robot.ground_clearance:.3f} m"),
        ("mass", f"{robot.mass:.2f} kg, centre at {_point(robot.center_of_mass)} m"),
    ]
    if gear.wheels:
        size = f"radius {robot.wheel_radius:.3f} m, wheelbase {robot.wheelbase:.3f} m, track {robot.track:.3f} m"
        lines.append(("size", size))
    lines.append(("limits", _limits(robot)))
    if robot.tipping is not None:
        found = robot.tipping
        slopes = (found.forward, found.backward, found.left, found.right)
        text = ", ".join(
            f"{name} {_degrees(s)}" for name, s in zip(("down", "up", "left", "right"), slopes, strict=True)
        )
        lines.append(("tips over at", f"{text}, {_degrees(found.least)} at worst"))
    if robot.edges is not None:
        found_edges = robot.edges
        lines.append(("approach angle", _degrees(found_edges.approach)))
        lines.append(("departure angle", _degrees(found_edges.departure)))
        lines.append(("breakover angle", _degrees(found_edges.breakover)))
    return lines + [(name, text) for name, text in robot_values(robot).items() if name != "$ROBOT_FOOTPRINT"]


def _limits(robot: RobotDescription) -> str:
    text = f"{robot.max_speed:.2f} m/s, {robot.max_yaw_rate:.2f} rad/s"
    if robot.motor_torque > 0.0:
        text += f", {robot.motor_torque:.3g} N m a wheel"
    if robot.min_turning_radius > 0.0:
        text += f", turning radius {robot.min_turning_radius:.3f} m"
    return text


def to_json(robot: RobotDescription) -> dict[str, Any]:
    """All numbers, in SI units; angles in radians."""
    tipping, edges = robot.tipping, robot.edges
    return {
        "name": robot.urdf.name,
        "file": str(robot.urdf.file),
        "drive": robot.drive,
        "reason": robot.gear.reason,
        "wheels": [wheel.joint for wheel in robot.gear.wheels],
        "steering": sorted({wheel.steering for wheel in robot.gear.wheels} - {""}),
        "supports": [support.name for support in robot.gear.supports],
        "footprint": robot.footprint,
        "height": robot.height,
        "ground_clearance": robot.ground_clearance,
        "mass": robot.mass,
        "center_of_mass": robot.center_of_mass,
        "wheel_radius": robot.wheel_radius,
        "wheelbase": robot.wheelbase,
        "track": robot.track,
        "max_speed": robot.max_speed,
        "max_yaw_rate": robot.max_yaw_rate,
        "min_turning_radius": robot.min_turning_radius,
        "motor_torque": robot.motor_torque,
        "tips_over_at": None if tipping is None else {name: round(v, 6) for name, v in vars(tipping).items()},
        "clears": None if edges is None else {name: round(v, 6) for name, v in vars(edges).items()},
        "navigation": robot_values(robot),
        "notes": list(robot.notes),
    }


def _degrees(angle: float) -> str:
    return f"{math.degrees(angle):.0f} deg"


def _point(values: list[float] | tuple[float, ...]) -> str:
    return "(" + ", ".join(f"{round(value, 3) + 0.0:.3f}" for value in values) + ")"
