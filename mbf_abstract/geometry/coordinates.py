"""The numbers that poses, paths, transforms and velocities take: finite, and coordinates within a bound."""

from __future__ import annotations

import math
from collections.abc import Iterable

FARTHEST_COORDINATE = 1e9
"""Largest coordinate [m], which doubles resolve to 0.1 µm; squares of what is far beyond would overflow."""


class NonFiniteError(ValueError):
    """A number that must be finite is NaN or infinite; the text names the field or index."""


def finite(name: str, values: Iterable[float]) -> tuple[float, ...]:
    """Return the values as floats; raise ``NonFiniteError`` naming the first that is NaN or infinite."""
    numbers = tuple(map(float, values))
    if not all(map(math.isfinite, numbers)):
        index = [math.isfinite(value) for value in numbers].index(False)
        raise NonFiniteError(f"{name}[{index}] must be finite, got {numbers[index]}")
    return numbers


def coordinates(name: str, values: Iterable[float]) -> tuple[float, ...]:
    """Return coordinates [m] as floats; raise ValueError naming the first that is not finite, or too far away."""
    numbers = tuple(map(float, values))
    if not sum(map(abs, numbers)) <= FARTHEST_COORDINATE:  # one sum for what is nearly always so
        for index, number in enumerate(finite(name, numbers)):
            if abs(number) > FARTHEST_COORDINATE:
                raise ValueError(f"{name}[{index}] must be within {FARTHEST_COORDINATE:g} m of zero, got {number:g}")
    return numbers
