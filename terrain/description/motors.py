"""Whether a robot's motors hold it on the slopes that its plans lead over.

When to use: once, on a whole description. When not: to find the least torque for a speed; losses are not looked at.
"""

from __future__ import annotations

import math
from dataclasses import replace

from terrain.description.description import RobotDescription

GRAVITY = 9.81
"""[m/s^2]"""


def holds_on(robot: RobotDescription) -> float:
    """Steepest slope [rad] on which the torque of the driven wheels keeps the robot from rolling back."""
    pull = robot.motor_torque * len(robot.gear.driven) / robot.wheel_radius
    return math.asin(min(1.0, pull / (robot.mass * GRAVITY)))


def with_note_on_motors(robot: RobotDescription) -> RobotDescription:
    """The description, with a note where motors are too weak for the slopes that configurations are given for it."""
    if robot.tipping is None or not robot.gear.driven or robot.wheel_radius <= 0.0:
        return robot
    held, steepest = holds_on(robot), min(robot.stated.max_slope, robot.tipping.least - robot.stated.tip_over_margin)
    if held >= steepest:
        return robot
    count, degrees = len(robot.gear.driven), math.degrees
    text = (
        f"its motors hold it on slopes of up to {degrees(held):.0f} degrees ({robot.motor_torque:.3g} N m on each of "
        f"{count} wheels of {robot.wheel_radius:.3g} m, {robot.mass:.3g} kg), and plans lead it over slopes of up to "
        f"{degrees(steepest):.0f} degrees: set max_slope, or motor_torque if that is wrong"
    )
    return replace(robot, notes=(*robot.notes, text))
