"""Recorded objects: what the robot knew of the things that move around it, at several times of a run."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from mbf_abstract.geometry import FloatArray
from mbf_abstract.maps.tracking.objects import Motion, TrackedObject

COLUMNS = 9
NUMBER, X, Y, Z, VX, VY, RADIUS, AGE, IS_MOVING = range(COLUMNS)
"""Columns of an object: its number, place [m], velocity [m/s], radius [m], age [s]; 1 if it moves, 0 if it stands."""


@dataclass(frozen=True, eq=False)
class RecordedObjects:
    """The tracked objects at one time; none, where the last of them have just been forgotten.

    Attributes
    ----------
    time : float
        [s] of the run.
    rows : (k, COLUMNS) float64
        In the map.
    """

    time: float
    rows: FloatArray

    @classmethod
    def of(cls, time: float, known: Iterable[TrackedObject]) -> RecordedObjects:
        """Keep what a map knows."""
        rows = [
            (one.number, one.x, one.y, one.z, one.vx, one.vy, one.radius, one.age, one.motion is Motion.MOVING)
            for one in known
        ]
        return cls(time, np.array(rows, dtype=np.float64).reshape(-1, COLUMNS))


def object_arrays(objects: list[RecordedObjects]) -> dict[str, Any]:
    """All objects as three arrays for a file: rows of all times, how many of each, and the times (n,)."""
    return {
        "object_rows": np.concatenate([np.zeros((0, COLUMNS)), *(one.rows for one in objects)]),
        "object_counts": np.array([len(one.rows) for one in objects], np.int64),
        "object_times": np.array([one.time for one in objects], np.float64),
    }


def objects_from(arrays: dict[str, Any]) -> list[RecordedObjects]:
    """Read what ``object_arrays`` made; older recordings may have none."""
    if not len(arrays.get("object_counts", ())):
        return []
    parts = np.split(arrays["object_rows"], np.cumsum(arrays["object_counts"])[:-1])
    return [RecordedObjects(time, rows) for time, rows in zip(arrays["object_times"].tolist(), parts, strict=True)]
