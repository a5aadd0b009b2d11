"""Difficulty curves: success and SPL over a number that makes the runs harder, a curve for each of those compared.

In a sweep the numbers are the values of a setting, such as ``world.spacing=0.25,0.5``; in an evaluation they are the
levels of its worlds. A curve shows where a planner begins to fail, which a rate over all runs hides.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from terrain.sweeps.statistics import Rate, Row, rate_of
from terrain.sweeps.variants import settings_of, short_names


@dataclass(frozen=True)
class Point:
    """The runs at one difficulty.

    Attributes
    ----------
    value : float
        The difficulty.
    success : Rate
        Share of successes with Wilson's interval.
    spl : float or None
        Mean of the SPL, in which a failure is 0 (Anderson et al. 2018); None where no run has one.
    """

    value: float
    success: Rate
    spl: float | None


@dataclass(frozen=True)
class Curve:
    """The points of one variant or entry, by rising difficulty."""

    name: str
    points: tuple[Point, ...]


def curve_of(name: str, rows: Sequence[Row], values: Sequence[float]) -> Curve:
    """Return the curve of runs, ``values`` being the difficulty of each."""
    runs: dict[float, list[Row]] = {}
    for row, value in zip(rows, values, strict=True):
        runs.setdefault(value, []).append(row)
    return Curve(name, tuple(_point(value, runs[value]) for value in sorted(runs)))


def _point(value: float, rows: Sequence[Row]) -> Point:
    spl = [float(row["spl"]) for row in rows if row.get("spl") is not None]
    return Point(value, rate_of(rows), math.fsum(spl) / len(spl) if spl else None)


def curves_of_settings(rows: Sequence[Row]) -> dict[str, list[Curve]]:
    """Return the curves over every setting of a sweep that has several values, all of them numbers.

    A curve has the settings that are no such numbers in its name; over the values of the other numbers it counts all
    runs together.
    """
    variants = {row["variant"]: dict(one.partition("=")[::2] for one in settings_of(row["variant"])) for row in rows}
    keys = sorted({key for settings in variants.values() for key in settings})
    numbers = {key: found for key in keys if len(set((found := _numbers(key, variants)).values())) > 1}
    named = {
        variant: " ".join(f"{key}={value}" for key, value in settings.items() if key not in numbers)
        for variant, settings in variants.items()
    }
    names = short_names(sorted(set(named.values())))
    curves: dict[str, list[Curve]] = {}
    for key, values in numbers.items():
        for name, shown in names.items():
            own = [row for row in rows if named[row["variant"]] == name]
            curves.setdefault(key, []).append(curve_of(shown, own, [values[row["variant"]] for row in own]))
    return curves


def _numbers(key: str, variants: Mapping[str, Mapping[str, str]]) -> dict[str, float]:
    """The value of a setting in every variant; empty if one of them has none, or one that is no finite number."""
    try:
        found = {variant: float(settings[key]) for variant, settings in variants.items()}
    except (KeyError, ValueError):
        return {}
    return found if all(map(math.isfinite, found.values())) else {}
