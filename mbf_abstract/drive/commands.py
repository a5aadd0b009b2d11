"""Checks of commands for the velocity gate: legal, standing still; and the numbers that an event records."""

from __future__ import annotations

import math
from dataclasses import replace

from mbf_abstract.geometry import AckermannCommand, Command, Twist


def command_problem(command: object) -> str:
    """Why this must not reach a robot; empty if it may.

    A type of the user's own, a subclass too, is refused: its numbers may change with each access. The numbers are
    checked again although the constructors refuse what is not finite, because a frozen value can be overwritten.
    """
    numbers: tuple[float, ...]
    if type(command) is Twist:
        numbers = (*command.linear, *command.angular)
    elif type(command) is AckermannCommand:
        numbers = (command.speed, command.steering_angle)
    else:
        return f"a command is a Twist or an AckermannCommand, got {type(command).__name__}"
    try:
        finite = all(math.isfinite(number) for number in numbers)
    except TypeError:
        finite = False
    return "" if finite else f"a command must be finite, got {command}"


def require_command(command: object) -> None:
    """Raise TypeError for what is no command of either type: a fault of who made it, which no later call changes."""
    if type(command) not in (Twist, AckermannCommand):
        raise TypeError(command_problem(command))


def stands_still(command: Command) -> bool:
    """Whether a command asks for no motion at all, also along z and about x and y; a car's wheels may be turned."""
    if isinstance(command, AckermannCommand):
        return command.speed == 0.0
    return not any(command.linear) and not any(command.angular)


def zero_like(command: Command) -> Command:
    """The stop command of the same type; a car keeps its steering angle."""
    return replace(command, speed=0.0) if isinstance(command, AckermannCommand) else Twist()


def command_data(command: Command) -> list[float]:
    """The command's numbers for an event: [vx, vy, wz], all six where others are used, or [speed, steering angle]."""
    if isinstance(command, AckermannCommand):
        return [command.speed, command.steering_angle]
    if command.linear[2] or command.angular[0] or command.angular[1]:
        return [*command.linear, *command.angular]
    return [command.vx, command.vy, command.wz]
