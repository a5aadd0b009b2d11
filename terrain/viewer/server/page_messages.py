"""What a visitor's browser may send to a page: three kinds of messages, every value checked, and nothing else.

viser takes whatever a client sends: it sets any property of a control to any value, takes uploads, and asks for a
public tunnel. So messages are checked before they reach viser, and all others are dropped.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from mbf_abstract.access.page_access import Role

MAX_NUMBER = 1e9
MAX_PIXELS = 100_000

CAMERA: dict[str, Callable[[Any], bool]] = {
    "wxyz": lambda value: _is_vector(value, 4),
    "position": lambda value: _is_vector(value, 3),
    "look_at": lambda value: _is_vector(value, 3),
    "up_direction": lambda value: _is_vector(value, 3),
    "fov": lambda value: _is_number(value) and 0.0 < value < math.pi,
    "near": lambda value: _is_number(value) and value > 0.0,
    "far": lambda value: _is_number(value) and value > 0.0,
    "image_height": lambda value: _is_number(value) and 0 <= value <= MAX_PIXELS,
    "image_width": lambda value: _is_number(value) and 0 <= value <= MAX_PIXELS,
}
CLICK: dict[str, Callable[[Any], bool]] = {
    "event_type": lambda value: value == "click",
    "ray_origin": lambda value: _is_vector(value, 3),
    "ray_direction": lambda value: _is_vector(value, 3) and math.hypot(*value) > 1e-6,
    "screen_pos": lambda value: isinstance(value, list) and len(value) == 1 and _is_vector(value[0], 2),
    "modifier": lambda value: value is None or (isinstance(value, str) and len(value) < 40),
}


def is_allowed(message: bytes | str, role: Role, controls: Mapping[str, Any]) -> bool:
    """Whether a message from a browser may go on to viser.

    Parameters
    ----------
    message : bytes or str
        As it came through the WebSocket: msgpack, or text, which is never right.
    role : Role
        Of the sender; a visitor who only watches may send the position of the camera and nothing else.
    controls : mapping of str to viser.GuiInputHandle
        The page's controls by their identifiers.
    """
    fields = _decoded(message)
    kind = fields.pop("type", None)
    if kind == "ViewerCameraMessage":
        return _is_right(fields, CAMERA)
    if role is not Role.STEER:
        return False
    if kind == "ScenePointerMessage":
        return _is_right(fields, CLICK)
    return kind == "GuiUpdateMessage" and _is_control_update(fields, controls)


def _decoded(message: bytes | str) -> dict[Any, Any]:
    """The fields of a message; none where it is not a msgpack mapping."""
    import msgspec

    if not isinstance(message, bytes):
        return {}
    try:
        fields = msgspec.msgpack.decode(message)
    except (ValueError, RecursionError):  # what msgspec raises for bad input is a ValueError
        return {}
    return fields if isinstance(fields, dict) else {}


def _is_right(fields: Mapping[Any, Any], checks: Mapping[str, Callable[[Any], bool]]) -> bool:
    return set(fields) == set(checks) and all(check(fields[name]) for name, check in checks.items())


def _is_control_update(fields: Mapping[Any, Any], controls: Mapping[str, Any]) -> bool:
    identifier, updates = fields.get("uuid"), fields.get("updates")
    if set(fields) != {"uuid", "updates"} or not isinstance(identifier, str) or not isinstance(updates, dict):
        return False
    control = controls.get(identifier)
    return control is not None and set(updates) == {"value"} and _is_value_of(control, updates["value"])


def _is_value_of(control: Any, value: Any) -> bool:
    """Whether a control can have a value: one of its options, a number within its bounds, or of its present kind."""
    present = control.value
    if isinstance(present, bool):
        return isinstance(value, bool)
    if isinstance(present, str):
        return isinstance(value, str) and value in getattr(control, "options", ())
    if isinstance(present, tuple):
        return _is_vector(value, len(present))
    if not isinstance(present, int | float) or not _is_number(value):
        return False
    low, high = getattr(control, "min", None), getattr(control, "max", None)
    return (low is None or value >= low) and (high is None or value <= high)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= MAX_NUMBER


def _is_vector(value: Any, length: int) -> bool:
    return isinstance(value, list) and len(value) == length and all(map(_is_number, value))
