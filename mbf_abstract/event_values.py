"""What an event may carry: plain JSON values of bounded size, made from anything at all, without ever raising.

A plugin's text, outcome or exception ends up in events. None of them may end the record of the run: not a number of
5000 digits, not a text of a gigabyte, not a list that holds itself, not an object whose ``__str__`` raises.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from enum import Enum
from typing import Any, TypeAlias

import numpy as np

JsonValue: TypeAlias = "bool | int | float | str | list[JsonValue] | dict[str, JsonValue] | None"

FLOAT_DIGITS = 9
MAX_TEXT = 10_000
"""Characters of one text; the rest is cut off and counted."""
MAX_VALUES = 20_000
"""Values in one field of an event, a text counting as one for each ``CHARACTERS_PER_VALUE``."""
CHARACTERS_PER_VALUE = 10
MAX_DEPTH = 30
MAX_INTEGER_BITS = 63
"""Readers of JSON lines take integers of 64 bits, one of them the sign."""


def error_text(error: BaseException) -> str:
    """Return the text of an exception, cut to ``MAX_TEXT``; its ``__str__`` may raise or be endless."""
    return well_formed(shortened(_text_of(error)))


def shortened(text: str) -> str:
    """Return ``text``, cut off after ``MAX_TEXT`` characters with the number of missing ones."""
    missing = len(text) - MAX_TEXT
    return text if missing <= 0 else f"{text[:MAX_TEXT]} ... ({missing} more characters)"


def well_formed(text: str) -> str:
    """Return a text that every encoding of Unicode can hold: half of a surrogate pair is spelled out as its escape."""
    return text if text.isascii() else text.encode("utf-8", "backslashreplace").decode("utf-8")


def to_json_value(value: Any) -> JsonValue:
    """Turn ``value`` into plain JSON: numbers rounded to 9 decimals, arrays to lists, inf and nan to text.

    A type that JSON does not know becomes its ``str``; an enum becomes its name. What is too long, too deep or too
    many is replaced by a text that gives the reason.
    """
    if value is None or type(value) is bool:
        return value
    # Most fields are plain text and plain numbers; the others need a converter.
    if type(value) is str and len(value) <= MAX_TEXT and value.isascii():
        return value
    if type(value) is float:
        return _plain_float(value)
    if type(value) is int and value.bit_length() <= MAX_INTEGER_BITS:
        return value
    try:
        return _Converter().convert(value, 0)
    except Exception as error:  # e.g. a mapping whose items raise
        return f"{type(value).__name__} that cannot be described: {type(error).__name__}"


class _Converter:
    """Converts one value of an event until its budget is used up."""

    def __init__(self) -> None:
        self._left = MAX_VALUES

    def convert(self, value: Any, depth: int) -> JsonValue:
        """Convert a value that is nested ``depth`` deep."""
        self._left -= 1
        if type(value) is float:  # coordinates, most of what is nested
            return _plain_float(value)
        if type(value) is list or type(value) is tuple:  # of coordinates
            return self._convert_sequence(value, depth)
        if isinstance(value, Enum):
            return value.name
        if isinstance(value, np.generic):
            value = float(value) if isinstance(value, np.longdouble) else value.item()
        if value is None or isinstance(value, bool):
            return value
        if isinstance(value, int):
            return value if value.bit_length() <= MAX_INTEGER_BITS else f"integer of {value.bit_length()} bits"
        if isinstance(value, float):
            return _plain_float(value)
        if isinstance(value, (Mapping, np.ndarray, list, tuple)):
            return self._convert_collection(value, depth)
        text = well_formed(shortened(_text_of(value)))
        self._left -= len(text) // CHARACTERS_PER_VALUE
        return text

    def _convert_collection(self, value: Any, depth: int) -> JsonValue:
        if depth >= MAX_DEPTH:
            return _nested_too_deep(value)
        if isinstance(value, np.ndarray):
            too_large = value.size > self._left
            return f"array of shape {value.shape}" if too_large else self.convert(value.tolist(), depth + 1)
        if isinstance(value, Mapping):
            return self._convert_mapping(value, depth)
        return self._convert_sequence(value, depth)

    def _convert_sequence(self, value: list[Any] | tuple[Any, ...], depth: int) -> JsonValue:
        if depth >= MAX_DEPTH:
            return _nested_too_deep(value)
        converted: list[JsonValue] = []
        for item in value:
            if self._left <= 0:
                return [*converted, f"{len(value) - len(converted)} more values left out"]
            converted.append(self.convert(item, depth + 1))
        return converted

    def _convert_mapping(self, value: Mapping[Any, Any], depth: int) -> JsonValue:
        converted: dict[str, JsonValue] = {}
        for key, item in value.items():
            if self._left <= 0:
                return {**converted, "...": f"{len(value) - len(converted)} more values left out"}
            converted[shortened(_text_of(key))] = self.convert(item, depth + 1)
        return converted


def _nested_too_deep(value: object) -> str:
    return f"{type(value).__name__} nested deeper than {MAX_DEPTH}"


def _plain_float(value: float) -> JsonValue:
    return round(value, FLOAT_DIGITS) + 0.0 if math.isfinite(value) else str(value)  # + 0.0: no "-0.0"


def _text_of(value: object) -> str:
    try:
        return str(value)
    except BaseException as error:
        return f"{type(value).__name__} whose text raises {type(error).__name__}"
