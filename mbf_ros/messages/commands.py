"""Commands of a robot as messages: Twist, or TwistStamped in the robot's frame."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from mbf_abstract.geometry import AckermannCommand, Command, Twist
from mbf_ros.messages.geometry import MessageContext, twist, twist_of
from mbf_ros.messages.interfaces import Message

STAMPED = "geometry_msgs/TwistStamped"


def command_type(stamped: bool) -> str:
    """Return the type of the messages."""
    return STAMPED if stamped else "geometry_msgs/Twist"


def command_message(
    command: Command | None, stamped: bool, frame_id: str, stamp: float, context: MessageContext
) -> Message:
    """Return a command of this moment, ``stamp`` [s]."""
    body = twist(command_twist(command))
    return {"header": context.header(frame_id, stamp), "twist": body} if stamped else body


def command_of(message: Mapping[str, Any], stamped: bool) -> Twist:
    """Return a command; raises InvalidValueError where a number is not finite."""
    return twist_of(message["twist"] if stamped else message)


def command_twist(command: Command | None) -> Twist:
    """Return a command as a Twist; the steering angle of a car is its ``angular.z``, as the `teb_local_planner` has it.

    A Twist has no field for a steering angle; a driver of a car has to know that it is one.
    """
    if isinstance(command, AckermannCommand):
        return Twist((command.speed, 0.0, 0.0), (0.0, 0.0, command.steering_angle))
    return command or Twist()
