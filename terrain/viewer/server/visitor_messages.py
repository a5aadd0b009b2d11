"""What the script in a visitor's page may send: each message is read into a call of ``VisitorActions``."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any, Protocol, TypeAlias

from mbf_abstract.access.page_access import Role

LONGEST = 200  # characters of a message
LARGEST = 1e12  # of a number; nan and infinity are none
STEERING = ("goal", "stick")
VIEWS = ("free", "follow", "overview", "storey")
Place: TypeAlias = tuple[float, float]
"""A place in the picture of the scene: (0, 0) is its upper left corner, (1, 1) its lower right one."""


class VisitorActions(Protocol):
    """What visitors may do; called on the server's event loop, must not wait or raise."""

    def point(self, visitor: int, place: Place | None) -> None:
        """Note where the pointer of a visitor is; None when it has left the scene."""

    def place_goal(self, visitor: int, start: Place, end: Place) -> None:
        """Place a goal, or a waypoint, at the start of a drag; it faces the end of the drag."""

    def hold_stick(self, visitor: int, turn: float, forward: float, beat: float) -> None:
        """Note the position of the stick, both -1 to 1; called ten times a second while it is held.

        ``beat`` is the newest heartbeat that the page had seen, a time [s] of the channel's clock.
        """

    def release_stick(self, visitor: int) -> None:
        """Note that this visitor has released the stick."""

    def look(self, visitor: int, view: str) -> None:
        """Move the camera of a visitor to one of ``VIEWS``."""

    def leave(self, visitor: int) -> None:
        """Forget a visitor."""


Action: TypeAlias = Callable[[VisitorActions, int], None]


def parsed(message: bytes | str, role: Role) -> Action | None:
    """Return what a message asks for, None where it is wrong or not for this role.

    ``{"point": [u, v]}`` or ``{"point": null}``, ``{"goal": [[u, v], [u, v]]}``, ``{"look": "follow"}``,
    ``{"stick": [turn, forward, beat]}`` or ``{"stick": null}``.
    """
    if not isinstance(message, str) or len(message) > LONGEST:
        return None
    try:
        fields = json.loads(message)
    except (ValueError, RecursionError):
        return None
    if not isinstance(fields, dict) or len(fields) != 1:
        return None
    ((kind, value),) = fields.items()
    if kind not in READERS or (kind in STEERING and role is not Role.STEER):
        return None
    return READERS[kind](value)


def _point(value: Any) -> Action | None:
    if value is None:
        return lambda actions, visitor: actions.point(visitor, None)
    place = _pair(value, 0.0, 1.0)
    return None if place is None else lambda actions, visitor: actions.point(visitor, place)


def _goal(value: Any) -> Action | None:
    if not isinstance(value, list) or len(value) != 2:
        return None
    start, end = (_pair(one, 0.0, 1.0) for one in value)
    if start is None or end is None:
        return None
    return lambda actions, visitor: actions.place_goal(visitor, start, end)


def _stick(value: Any) -> Action | None:
    if value is None:
        return lambda actions, visitor: actions.release_stick(visitor)
    if not isinstance(value, list) or len(value) != 3 or not _is_number(value[2]):
        return None
    stick, beat = _pair(value[:2], -1.0, 1.0), float(value[2])
    return None if stick is None else lambda actions, visitor: actions.hold_stick(visitor, *stick, beat)


def _look(value: Any) -> Action | None:
    if not isinstance(value, str) or value not in VIEWS:
        return None
    return lambda actions, visitor: actions.look(visitor, value)


READERS: dict[str, Callable[[Any], Action | None]] = {"point": _point, "goal": _goal, "stick": _stick, "look": _look}


def _pair(value: Any, low: float, high: float) -> Place | None:
    """Two numbers between ``low`` and ``high``; None for anything else."""
    if not isinstance(value, list) or len(value) != 2:
        return None
    if not all(_is_number(one) and low <= one <= high for one in value):
        return None
    return float(value[0]), float(value[1])


def _is_number(value: Any) -> bool:
    """Whether it is a finite number that a float can hold."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return abs(value) <= LARGEST
