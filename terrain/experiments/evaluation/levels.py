"""Difficulty curves of an evaluation: success over the levels of its worlds, a curve for each entry."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

from terrain.sweeps.difficulty import Curve, curve_of

LEVEL = re.compile(r"level (\d+)")


def curves_of_levels(rows: Sequence[dict[str, Any]], entries: Sequence[str]) -> dict[str, list[Curve]]:
    """Return the curves of entries that drove worlds of several levels, counted as rates are: with a route.

    Worlds from surveys have no level and do not count. Empty where there is one level only.
    """
    levels = {row["world"]: int(found[1]) for row in rows if (found := LEVEL.match(row["world"]))}
    leveled = [row for row in rows if row["world"] in levels and row["route"]]
    curves = []
    for entry in entries:
        own = [row for row in leveled if row["entry"] == entry]
        if own:
            curves.append(curve_of(entry, own, [float(levels[row["world"]]) for row in own]))
    several = len({point.value for curve in curves for point in curve.points}) > 1
    return {"level": curves} if several else {}
