"""Options that take two to four numbers, ``--start X Y [Z] [YAW]``, negative ones included; on a flat map X Y [YAW].

Command line parsers give an option a fixed number of values and take ``-1.5`` for an option of its own. So the
numbers that follow such an option are joined into one value before the parser sees them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import typer
from typer.core import TyperCommand

COORDINATE_OPTIONS = ("--start", "--goal")


@dataclass(frozen=True)
class Place:
    """Where a pose shall be; ``z`` [m] is None where the ground decides, ``yaw`` [rad] where it does not matter."""

    x: float
    y: float
    z: float | None = None
    yaw: float | None = None

    def on_flat_map(self) -> Place:
        """The same numbers for a map without heights: the third of three is the yaw."""
        return self if self.yaw is not None else Place(self.x, self.y, None, self.z)


class CoordinateCommand(TyperCommand):
    """A command whose options ``--start`` and ``--goal`` take any number of numbers."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Join the numbers, then parse as ever."""
        return super().parse_args(ctx, join_numbers(args))


def join_numbers(arguments: list[str]) -> list[str]:
    """Turn ``--start -1 2 --json`` into ``--start=-1,2 --json``, and ``--start -1,2`` likewise."""
    joined: list[str] = []
    collecting = False
    for argument in arguments:
        name, _, value = argument.partition("=")
        if name in COORDINATE_OPTIONS:
            joined.append(f"{name}={value}")
            collecting = True
        elif collecting and _is_number(argument):
            joined[-1] += argument if joined[-1].endswith("=") else f",{argument}"
        else:
            joined.append(argument)
            collecting = False
    return joined


def parse_place(text: str, option: str) -> Place:
    """Parse ``X,Y``, ``X,Y,Z`` or ``X,Y,Z,YAW``; raises typer.BadParameter."""
    parts = [part for part in text.replace(",", " ").split() if part]
    if not 2 <= len(parts) <= 4 or not all(_is_number(part) for part in parts):
        raise typer.BadParameter(f"expected X Y [Z] [YAW] in metres and radians, got {text!r}", param_hint=option)
    numbers = [float(part) for part in parts]
    if not all(math.isfinite(number) for number in numbers):
        raise typer.BadParameter(f"coordinates must be finite, got {text!r}", param_hint=option)
    from mbf_abstract.geometry import FARTHEST_COORDINATE  # with NumPy, which --help can do without

    if max(map(abs, numbers)) > FARTHEST_COORDINATE:
        raise typer.BadParameter(f"coordinates must be within {FARTHEST_COORDINATE:g}, got {text!r}", param_hint=option)
    return Place(*numbers)


def _is_number(text: str) -> bool:
    try:
        [float(part) for part in text.split(",")]
    except ValueError:
        return False
    return True
