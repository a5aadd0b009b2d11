"""What the fields of goals must be: a wrong one is a TypeError with its name, where the goal is made and not later."""

from __future__ import annotations

import numbers
from collections.abc import Callable, Iterable, Mapping
from dataclasses import Field, fields
from functools import cache
from typing import Any, ClassVar, Protocol

from mbf_abstract.geometry import Path, Pose
from mbf_abstract.goals.goal_area import GoalArea


class Goal(Protocol):
    """A dataclass."""

    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]


def check_fields(goal: Goal) -> None:
    """Raise TypeError for the first field that is not of its kind; sequences become tuples."""
    for name in _names_of_fields(type(goal)):
        value = getattr(goal, name)
        if value is None and name in MAY_BE_NONE:
            continue
        if name in SEQUENCES:
            object.__setattr__(goal, name, SEQUENCES[name](name, value))
        elif name in VALUES:
            VALUES[name](name, value)


@cache
def _names_of_fields(kind: type[Goal]) -> tuple[str, ...]:
    return tuple(one.name for one in fields(kind))


def _expect(kind: type | tuple[type, ...], wanted: str) -> Callable[[str, object], None]:
    """Return a check of one value; x, y and yaw alone are what people try for a pose."""

    def check(name: str, value: object) -> None:
        if not isinstance(value, kind) or isinstance(value, bool):
            raise TypeError(f"{name} must be {wanted}, got {type(value).__name__}")

    return check


def _sequence(check: Callable[[str, object], None], wanted: str) -> Callable[[str, object], tuple[Any, ...]]:
    """Return a check of all items; a text alone is no sequence of names."""

    def checked(name: str, value: object) -> tuple[Any, ...]:
        if isinstance(value, str) or not isinstance(value, Iterable):
            raise TypeError(f"{name} must be a sequence of {wanted}, got {type(value).__name__}")
        items = tuple(value)
        for index, item in enumerate(items):
            check(f"{name}[{index}]", item)
        return items

    return checked


_pose = _expect(Pose, "a Pose, such as Pose.planar(x, y, yaw)")
_name = _expect(str, "the name of a plugin")
_number = _expect((float, numbers.Real), "a number")

MAY_BE_NONE = {"start_pose", "dist_tolerance", "angle_tolerance", "goal_area", "recovery_behaviors", "max_retries"}
SEQUENCES = {
    "via": _sequence(_pose, "poses"),
    "waypoints": _sequence(_pose, "poses"),
    "recovery_behaviors": _sequence(_name, "names"),
}
VALUES = {
    "target_pose": _pose,
    "start_pose": _pose,
    "path": _expect(Path, "a Path, such as Path.from_poses(poses)"),
    "planner": _name,
    "controller": _name,
    "refiner": _name,
    "behavior": _name,
    "dist_tolerance": _number,
    "angle_tolerance": _number,
    "goal_area": _expect(GoalArea, "a GoalArea"),
    "concurrency_slot": _expect(numbers.Integral, "a whole number"),
    "parameters": _expect(Mapping, "a mapping of names to values"),
    "max_retries": _expect(numbers.Integral, "a whole number"),
    "loops": _expect(numbers.Integral, "a whole number"),
}
