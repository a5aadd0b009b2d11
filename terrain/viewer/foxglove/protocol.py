"""The frames of Foxglove's WebSocket protocol: JSON objects with an operation ``op``, and binary ones with an opcode.

The subprotocols ``foxglove.sdk.v1`` and ``foxglove.websocket.v1`` have the same frames; the specification is
docs/spec.md of github.com/foxglove/ws-protocol. Numbers in binary frames are little-endian.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping, Sequence
from enum import IntEnum
from typing import Any, NamedTuple

from mbf_abstract.config.findings import describe_value

SUBPROTOCOLS = ("foxglove.sdk.v1", "foxglove.websocket.v1")
MESSAGE, TIME, RESPONSE = 1, 2, 3  # opcodes of the server
PUBLISHED, CALL = 1, 2  # opcodes of clients
MAX_TEXT = 256  # characters of a name
MAX_NUMBER = 2**32 - 1


class Level(IntEnum):
    """How serious a status is."""

    INFO = 0
    WARNING = 1
    ERROR = 2


class ProtocolError(Exception):
    """What a client has sent means nothing, or cannot be done; the text is for the client."""


class Published(NamedTuple):
    """A message of a client on one of its channels."""

    channel: int
    payload: bytes


class Call(NamedTuple):
    """A client's call of a service."""

    service: int
    number: int
    encoding: str
    payload: bytes


# ------------------------------------------------------------------------------------------------ from clients
def parsed(frame: str) -> dict[str, Any]:
    """Return the operation in a text frame; raises ProtocolError where it is none."""
    found = json_in(frame)
    if not isinstance(found, dict) or not isinstance(found.get("op"), str):
        raise ProtocolError('expected an object with a text "op"')
    return found


def parsed_binary(frame: bytes) -> Published | Call:
    """Return what is in a binary frame; raises ProtocolError where it is neither a message nor a call."""
    try:
        if frame[0] == PUBLISHED:
            return Published(struct.unpack_from("<I", frame, 1)[0], frame[5:])
        if frame[0] == CALL:
            service, number, length = struct.unpack_from("<III", frame, 1)
            encoding = frame[13 : 13 + min(length, MAX_TEXT)].decode()
            return Call(service, number, encoding, frame[13 + length :])
    except (IndexError, struct.error, UnicodeDecodeError) as error:
        raise ProtocolError(f"a binary frame that is cut short or damaged: {error}") from error
    raise ProtocolError(f"a binary frame with the unknown opcode {frame[0]}")


def json_in(text: str | bytes) -> Any:
    """Return the value of a JSON text; raises ProtocolError where it is none, or one with NaN or infinity."""

    def refuse(name: str) -> Any:
        raise ValueError(f"JSON has no number {name}")

    try:
        return json.loads(text, parse_constant=refuse)
    except (ValueError, RecursionError) as error:
        raise ProtocolError(f"not JSON: {error}") from error


def list_in(operation: Mapping[str, Any], name: str) -> list[Any]:
    """Return a list of an operation; raises ProtocolError where it is none."""
    value = operation.get(name)
    if not isinstance(value, list):
        raise ProtocolError(f"{operation['op']}: {name}: expected a list, got {describe_value(value)}")
    return value


def number_in(item: Any, name: str) -> int:
    """Return a number of 32 bits in an object; raises ProtocolError where it is none."""
    value = item.get(name) if isinstance(item, dict) else None
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= MAX_NUMBER:
        raise ProtocolError(f"{name}: expected a whole number from 0 to {MAX_NUMBER}, got {describe_value(value)}")
    return value


def text_in(item: Any, name: str) -> str:
    """Return a text in an object; raises ProtocolError where it is missing, no text or long."""
    value = item.get(name) if isinstance(item, dict) else None
    if not isinstance(value, str) or len(value) > MAX_TEXT:
        raise ProtocolError(f"{name}: expected a text of at most {MAX_TEXT} characters, got {describe_value(value)}")
    return value


# ------------------------------------------------------------------------------------------------ to clients
def server_info(name: str, session_id: str, capabilities: Sequence[str]) -> str:
    """Return the first frame that a client gets."""
    return json.dumps(
        {
            "op": "serverInfo",
            "name": name,
            "capabilities": list(capabilities),
            "supportedEncodings": ["json"],
            "metadata": {},
            "sessionId": session_id,
        }
    )


def advertise(channels: Sequence[Mapping[str, Any]]) -> str:
    """Return the channels that can be subscribed to."""
    return json.dumps({"op": "advertise", "channels": list(channels)})


def advertise_services(services: Sequence[Mapping[str, Any]]) -> str:
    """Return the services that can be called."""
    return json.dumps({"op": "advertiseServices", "services": list(services)})


def parameter_values(values: Mapping[str, Any], request: str | None = None) -> str:
    """Return parameters by name, as an answer to a request if that had an id; those that are None have no value."""
    parameters = [{"name": name} if value is None else {"name": name, "value": value} for name, value in values.items()]
    answer: dict[str, Any] = {"op": "parameterValues", "parameters": parameters}
    return json.dumps(answer if request is None else answer | {"id": request}, allow_nan=False)


def status(level: Level, message: str) -> str:
    """Return a text for the user of a client."""
    return json.dumps({"op": "status", "level": int(level), "message": message})


def message_data(subscription: int, nanoseconds: int, payload: bytes) -> bytes:
    """Return a message of a subscription."""
    return struct.pack("<BIQ", MESSAGE, subscription, nanoseconds) + payload


def server_time(nanoseconds: int) -> bytes:
    """Return the time that the messages are stamped with."""
    return struct.pack("<BQ", TIME, nanoseconds)


def service_response(call: Call, payload: bytes) -> bytes:
    """Return the answer to a call."""
    encoding = call.encoding.encode()
    return struct.pack("<BIII", RESPONSE, call.service, call.number, len(encoding)) + encoding + payload


def service_failure(call: Call, message: str) -> str:
    """Return why a call has failed."""
    failure = {"serviceId": call.service, "callId": call.number, "message": message}
    return json.dumps({"op": "serviceCallFailure", **failure})
