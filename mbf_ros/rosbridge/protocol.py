"""The frames of the rosbridge protocol (version 2): one JSON object with an operation, ``op``, and its fields."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import Any

from mbf_abstract.config.findings import describe_value
from mbf_ros.messages.json_text import json_text

Operation = Mapping[str, Any]
"""What a client has sent, by the names of the fields."""

MAX_NAME = 256  # characters of a name, a type or an id


class OperationError(Exception):
    """What a client asked for cannot be done; the text is for the client."""


def parsed(frame: str | bytes) -> Operation:
    """Return the operation in a frame; raises OperationError where it is none."""
    if isinstance(frame, bytes):
        raise OperationError("expected JSON in a text frame, got a binary frame")
    try:
        found = json.loads(frame)
    except (ValueError, RecursionError) as error:
        raise OperationError(f"not JSON: {error}") from error
    if not isinstance(found, dict) or not isinstance(found.get("op"), str):
        raise OperationError('expected an object with a text "op"')
    return found


def text_in(operation: Operation, name: str, default: str | None = None) -> str:
    """Return a text of an operation; raises OperationError where it is missing without a default, no text or long."""
    value = operation.get(name, default)
    if not isinstance(value, str) or len(value) > MAX_NAME:
        expected = f"expected a text of at most {MAX_NAME} characters, got {describe_value(value)}"
        raise OperationError(f"{operation['op']}: {name}: {expected}")
    return value


def no_such(kind: str, name: str, known: Iterable[str]) -> str:
    """Return that there is no service or action of a name, and which there are."""
    return f"there is no {kind} {name!r}; known: {', '.join(sorted(known)) or 'none'}"


def absolute(name: str) -> str:
    """Return the name of a topic, service or action with its leading slash, which roslib leaves out."""
    return f"/{name.lstrip('/')}"


def id_in(operation: Operation) -> str | None:
    """Return the id that an answer repeats, None where there is none; raises OperationError if it is no text."""
    return text_in(operation, "id") if operation.get("id") is not None else None


def number_in(operation: Operation, name: str, most: int) -> int:
    """Return a whole number from 0 to ``most``, which also stands for larger ones; 0 where it is missing."""
    value = operation.get(name) or 0
    if isinstance(value, bool) or not isinstance(value, int | float) or not value >= 0:
        expected = f"expected a number of 0 or more, got {describe_value(value)}"
        raise OperationError(f"{operation['op']}: {name}: {expected}")
    return int(min(value, most))


def frame(op: str, **fields: Any) -> str:
    """Return an operation of the server as text; an ``id`` of None is left out."""
    if fields.get("id", "") is None:
        del fields["id"]
    return json_text({"op": op, **fields})


def error_frame(text: str, operation_id: str | None = None) -> str:
    """Return a status of the level error; roslibpy logs it as an unknown operation, so errors are the only ones."""
    return frame("status", level="error", msg=text, id=operation_id)
