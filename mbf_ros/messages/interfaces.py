"""Fields of the message types that are read and written here, and messages checked against them.

A message is a dictionary by field name: numbers, texts, dictionaries, lists of these, and a numpy array for a field
that is a list of numbers. The types are in ``interfaces.txt``; a type is named ``package/msg/Name``, or
``package/Name`` as ROS 1 and rosbridge have it. Parts of actions and services are ``package/action/Name_Goal``,
``_Result``, ``_Feedback`` and ``package/srv/Name_Request``, ``_Response``.
"""

from __future__ import annotations

import base64
import binascii
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbf_ros.messages.records import Records

Message = dict[str, Any]
"""A message by field name."""

FLOATS = {"float32": np.float32, "float64": np.float64}
INTEGERS = {name: np.dtype(name) for name in ("int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64")}
INTEGERS["byte"] = np.dtype("uint8")
TIMES = ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration")
HEADER = "std_msgs/msg/Header"


class MessageError(ValueError):
    """A message is not of its type, or a type is not known; the text names type and field, what is expected and got."""


@dataclass(frozen=True)
class Field:
    """One field of a type.

    Attributes
    ----------
    name, type : str
        The type without brackets.
    length : int, optional
        None = no list, 0 = a list of any length, else a list of that length.
    default : float
        Of a number that is left out.
    required : bool
        Whether a sender must not leave it out.
    """

    name: str
    type: str
    length: int | None
    default: float
    required: bool


@cache
def _interfaces() -> dict[str, tuple[Field, ...]]:
    """All types by name."""
    return types_in(files(__package__).joinpath("interfaces.txt").read_text("utf-8"))


def types_in(text: str) -> dict[str, tuple[Field, ...]]:
    """Return the types by name that a text describes: a name on a line, then its fields, indented; # is a comment."""
    types: dict[str, list[Field]] = {}
    for line in text.splitlines():
        if not line or line.startswith("#"):
            continue
        if not line.startswith(" "):
            types[line] = fields = []
            continue
        kind, name, *rest = line.split()
        element, bracket, length = kind.rstrip("]").partition("[")
        default = float(rest[1]) if rest[:1] == ["="] else 0.0
        fields.append(Field(name, element, int(length or 0) if bracket else None, default, "required" in rest))
    return {name: tuple(fields) for name, fields in types.items()}


def known_types() -> tuple[str, ...]:
    """Names of all types."""
    return tuple(_interfaces())


def full_name(type_name: str) -> str:
    """Return a type's name with its middle part: ``std_msgs/String`` is ``std_msgs/msg/String``."""
    package, _, name = type_name.partition("/")
    return f"{package}/msg/{name}" if name and "/" not in name else type_name


def fields_of(type_name: str) -> tuple[Field, ...]:
    """Return the fields of a type in order; raises MessageError if it is not known."""
    name = full_name(type_name)
    if name not in _interfaces():
        raise MessageError(f"unknown message type {type_name!r}")
    return _interfaces()[name]


def completed(type_name: str, values: object, where: str = "") -> Message:
    """Check a message against its type, and fill in the fields that were left out.

    Parameters
    ----------
    values : mapping
        As it came from JSON, in which null stands for NaN and a list of bytes may be base64, or from CBOR. Times may
        have the fields of ROS 1 (``secs``, ``nsecs``), and headers a ``seq``, which is dropped.
    where : str
        Name of the message in error texts, its type if empty.

    Raises
    ------
    MessageError
        The type is not known, a field is unknown, missing, or not of its type.
    """
    where = where or type_name
    fields = fields_of(type_name)
    if not isinstance(values, Mapping):
        raise MessageError(f"{where}: expected an object with the fields of {type_name}, got {_shown(values)}")
    given = _in_ros_2(full_name(type_name), values)
    names = [field.name for field in fields]
    if unknown := [str(name) for name in given if name not in names]:
        raise MessageError(f"{where}: {type_name} has no field {unknown[0]!r}; it has {', '.join(names) or 'none'}")
    if missing := [field.name for field in fields if field.required and field.name not in given]:
        raise MessageError(f"{where}: the field {missing[0]!r} of {type_name} is missing")
    return {
        field.name: _checked(field, given[field.name], f"{where}.{field.name}")
        if field.name in given
        else default_of(field)
        for field in fields
    }


def default_of(field: Field) -> Any:
    """Return the value of a field that was left out; a nested message with its defaults."""
    if field.length is not None:
        kind = FLOATS.get(field.type) or INTEGERS.get(field.type)
        return [] if kind is None else np.zeros(field.length, kind)
    if field.type in FLOATS:
        return field.default
    if field.type in INTEGERS:
        return int(field.default)
    if field.type in ("bool", "string"):
        return "" if field.type == "string" else False
    return {inner.name: default_of(inner) for inner in fields_of(field.type)}


def _in_ros_2(name: str, values: Mapping[Any, Any]) -> Mapping[Any, Any]:
    """Rename the fields of ROS 1 in a time, and drop the counter of a header."""
    if name in TIMES and values.keys() & {"secs", "nsecs"}:
        return {{"secs": "sec", "nsecs": "nanosec"}.get(key, key): value for key, value in values.items()}
    if name == HEADER and "seq" in values:
        return {key: value for key, value in values.items() if key != "seq"}
    return values


def _checked(field: Field, value: Any, where: str) -> Any:
    if field.length is None:
        return _checked_element(field.type, value, where)
    if field.type in FLOATS or field.type in INTEGERS:
        array = _numbers(field.type, value, where)
        if field.length and len(array) != field.length:
            raise MessageError(f"{where}: expected {field.length} numbers, got {len(array)}")
        return array
    if not isinstance(value, list | tuple | Records):
        raise MessageError(f"{where}: expected a list of {field.type}, got {_shown(value)}")
    return [_checked_element(field.type, element, f"{where}[{i}]") for i, element in enumerate(value)]


def _checked_element(kind: str, value: Any, where: str) -> Any:
    if kind in FLOATS:
        return _float(kind, value, where)
    if kind in INTEGERS:
        return _integer(kind, value, where)
    if kind in ("bool", "string"):
        if not isinstance(value, bool if kind == "bool" else str):
            raise MessageError(f"{where}: expected a {kind}, got {_shown(value)}")
        return value
    return completed(kind, value, where)


def _float(kind: str, value: Any, where: str) -> float:
    if value is None:
        return math.nan
    if isinstance(value, bool) or not isinstance(value, int | float | np.number):
        raise MessageError(f"{where}: expected a {kind}, got {_shown(value)}")
    try:
        return float(value)
    except OverflowError:
        return math.copysign(math.inf, value)


def _integer(kind: str, value: Any, where: str) -> int:
    limits = np.iinfo(INTEGERS[kind])
    whole = isinstance(value, int | np.integer) or (isinstance(value, float) and value.is_integer())
    if isinstance(value, bool) or not whole or not limits.min <= int(value) <= limits.max:
        raise MessageError(f"{where}: expected a {kind} ({limits.min} to {limits.max}), got {_shown(value)}")
    return int(value)


def _numbers(kind: str, value: Any, where: str) -> NDArray[Any]:
    if isinstance(value, str) and kind == "uint8":
        try:
            return np.frombuffer(base64.b64decode(value, validate=True), np.uint8)
        except (binascii.Error, ValueError) as error:
            raise MessageError(f"{where}: expected bytes in base64: {error}") from error
    if isinstance(value, bytes) and kind == "uint8":
        return np.frombuffer(value, np.uint8)
    if isinstance(value, np.ndarray) and value.dtype == np.dtype(kind) and value.ndim == 1:
        return value
    if not isinstance(value, list | tuple | np.ndarray):
        raise MessageError(f"{where}: expected a list of {kind}, got {_shown(value)}")
    if kind in INTEGERS and (whole := _whole_numbers(value)) is not None:
        limits = np.iinfo(INTEGERS[kind])
        if limits.min <= whole.min() and whole.max() <= limits.max:
            return whole.astype(INTEGERS[kind])
    check = _float if kind in FLOATS else _integer
    with np.errstate(over="ignore"):  # a number beyond float32 is infinite there
        return np.array([check(kind, number, f"{where}[{i}]") for i, number in enumerate(value)], np.dtype(kind))


def _whole_numbers(value: Any) -> NDArray[np.int64] | None:
    """A list of nothing but whole numbers at once: a map has millions. None where each must be looked at."""
    if set(map(type, value)) != {int}:
        return None
    try:
        return np.array(value, np.int64)
    except OverflowError:
        return None


def _shown(value: object) -> str:
    """Return a value for an error text, cut where it is long."""
    try:
        text = repr(value)
    except ValueError:  # an integer of too many digits
        text = "a number of too many digits"
    return f"{text[:80]}..." if len(text) > 80 else text
