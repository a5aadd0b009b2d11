"""Messages as bytes on the wire of ROS 2 (plain CDR, little endian), without an object for each of their points.

rclpy makes a Python object of each element of a list and holds the interpreter while it serialises them, a tenth of a
second for the 40,000 triangles of a mesh; the control loop would wait. Here a list of points is one array, see
``records.Records``, and its bytes are copied at once.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from mbf_ros.messages.interfaces import FLOATS, INTEGERS, Field, Message, fields_of
from mbf_ros.messages.records import Records

HEADER = b"\x00\x01\x00\x00"
"""Representation: plain CDR, little endian, no options."""
NUMBERS = {**{name: np.dtype(kind) for name, kind in FLOATS.items()}, **INTEGERS, "bool": np.dtype("bool")}


class _Writer:
    """Bytes so far; numbers lie at multiples of their size, counted from behind the header."""

    def __init__(self) -> None:
        self.parts: list[bytes] = []
        self._size = 0

    def raw(self, data: bytes, alignment: int = 1) -> None:
        padding = -self._size % alignment
        self.parts += [bytes(padding), data]
        self._size += padding + len(data)

    def numbers(self, kind: np.dtype[Any], values: Any) -> None:
        array = np.ascontiguousarray(values, kind.newbyteorder("<"))
        if array.size:
            self.raw(array.tobytes(), kind.itemsize)

    def length(self, count: int) -> None:
        self.numbers(NUMBERS["uint32"], [count])

    def message(self, type_name: str, values: Message) -> None:
        fields = fields_of(type_name)
        for field in fields:
            self.field(field, values[field.name])
        if not fields:
            self.raw(b"\x00")  # rosidl puts a byte into a type without fields

    def field(self, field: Field, value: Any) -> None:
        if field.length is None:
            self.element(field.type, value)
            return
        if not field.length:
            self.length(len(value))
        if isinstance(value, Records):
            self.numbers(NUMBERS[value.kind], value.array)
        elif field.type in NUMBERS:
            self.numbers(NUMBERS[field.type], value)
        else:
            for one in value:
                self.element(field.type, one)

    def element(self, kind: str, value: Any) -> None:
        if kind in NUMBERS:
            self.numbers(NUMBERS[kind], [value])
        elif kind == "string":
            text = value.encode() + b"\x00"
            self.length(len(text))
            self.raw(text)
        else:
            self.message(kind, value)


def serialized(type_name: str, message: Message) -> bytes:
    """Return a complete message of a type of ``interfaces`` as bytes, as rclpy publishes them."""
    writer = _Writer()
    writer.message(type_name, message)
    return b"".join([HEADER, *writer.parts])
