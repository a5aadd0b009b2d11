"""Messages of rclpy as dictionaries by field name, and back; the classes of a type are found by its name.

Fields are read and written by name, as they differ by distribution. What a class has not is left out, and what a
dictionary has not keeps the default of the class.
"""

from __future__ import annotations

from array import array
from collections.abc import Mapping
from functools import cache
from importlib import import_module
from typing import Any

import numpy as np

from mbf_ros.messages.interfaces import Message, full_name


class MissingInterfaceError(ValueError):
    """The package of a message type is not installed; the text says what to do."""


@cache
def interface_class(type_name: str) -> Any:
    """Return the class of ``package/kind/Name`` or ``package/Name``; raises MissingInterfaceError."""
    package, kind, name = full_name(type_name).split("/")
    try:
        return getattr(import_module(f"{package}.{kind}"), name)
    except (ImportError, AttributeError) as error:
        raise MissingInterfaceError(
            f"{type_name} is not installed ({error}): install ros-$ROS_DISTRO-{package.replace('_', '-')}, or with the "
            "wheels of ROS 2 run `mbf ros2-interfaces`"
        ) from error


def to_dict(message: Any) -> Message:
    """Return the fields of a message by name; lists of numbers are numpy arrays."""
    return {name: _plain(getattr(message, name)) for name in message.get_fields_and_field_types()}


def _plain(value: Any) -> Any:
    if isinstance(value, array):
        return np.asarray(value)
    if isinstance(value, bytes):  # one byte
        return value[0]
    if isinstance(value, list):
        return [_plain(one) for one in value]
    return to_dict(value) if hasattr(value, "get_fields_and_field_types") else value


def fill(message: Any, values: Mapping[str, Any]) -> Any:
    """Write the fields of a dictionary into a message, and return the message."""
    for name, value in values.items():
        if hasattr(message, name):
            _write(message, name, value)
    return message


def _write(message: Any, name: str, value: Any) -> None:
    present = getattr(message, name)
    if isinstance(value, Mapping):
        fill(present, value)
    elif isinstance(value, np.ndarray) and isinstance(present, array):
        setattr(message, name, array(present.typecode, value.astype(present.typecode, copy=False).tobytes()))
    elif isinstance(value, list) and value and isinstance(value[0], Mapping) and isinstance(present, array):
        # Humble has numbers where later distributions have messages with an index: missed_waypoints of FollowWaypoints.
        setattr(message, name, array(present.typecode, [one["index"] for one in value]))
    elif isinstance(value, list) and value and isinstance(value[0], Mapping):
        element = _element_class(message.get_fields_and_field_types()[name])
        setattr(message, name, [fill(element(), one) for one in value])
    elif isinstance(present, bytes):  # a byte, which is a number here
        setattr(message, name, bytes([value]))
    elif isinstance(present, bool | int | float):  # rclpy reads the bits of an int as those of a float
        setattr(message, name, type(present)(value))
    else:
        setattr(message, name, value)


@cache
def _element_class(kind: str) -> Any:
    """The class of the elements of a list, whose type ROS names as ``sequence<package/Name>``."""
    return interface_class(kind.removeprefix("sequence<").partition(">")[0].partition(",")[0])
