"""What one robot announces to the others: who and where it is, and where it goes next."""

from __future__ import annotations

import json
from dataclasses import dataclass

import numpy as np

from mbf_abstract.geometry import FARTHEST_COORDINATE, FloatArray
from mbf_abstract.geometry.arithmetic import norm

DIGITS = 2
"""Of the length that remains [m], so that small differences decide nothing."""
SPACING = 0.1
"""Distance [m] of the points at which two paths are compared."""
LONGEST_PATH = 1e5
"""Longest path [m] that is taken from others: it becomes points ``SPACING`` apart."""


@dataclass(frozen=True, eq=False)
class Announcement:
    """State of one robot at one time, in the global frame that all robots share.

    Attributes
    ----------
    name : str
        Of the robot; no other robot has it.
    stamp : float
        Time [s] of all this, on the clock of this robot; others only see by it whether it has announced anew.
    path : (n, 3) float64
        Where it is, then the path that it wants to follow from there [m]; only where it is if it goes nowhere.
    remaining : float
        Length [m] of the path to its goal, of which ``path`` may be the beginning; while it meets others, that of the
        moment when it met them.
    cannot_yield : bool
        Whether it has looked for a place to let others pass and has found none, or did not get there.
    waits : int
        How often it has waited in vain for others to let it pass, since it has met them.
    radius : float
        Of a circle [m] around its place that holds all of the robot; 0 = not known.
    makes_room : bool
        Whether it has no goal and pulls out for a robot that asks; see ``server.making_room``.
    asks : bool
        Whether it wants those that make room to leave its path: it is blocked and waits, or drives up to them.
    distance : float
        From its own path to that of a robot like this one [m] at which they do not meet; 0 = not known.
    wishes : bool
        Whether it has found no path, and ``path`` is the one that there would be without the robots in its way.
    """

    name: str
    stamp: float
    path: FloatArray
    remaining: float
    cannot_yield: bool = False
    waits: int = 0
    radius: float = 0.0
    makes_room: bool = False
    asks: bool = False
    distance: float = 0.0
    wishes: bool = False

    def to_json(self) -> str:
        """Return it as a JSON object, to be sent; ``from_json`` reads it."""
        values = vars(self) | {"path": self.path.tolist()}
        return json.dumps(values, sort_keys=True, separators=(",", ":"), allow_nan=False)

    @classmethod
    def from_json(cls, text: str) -> Announcement:
        """Read what ``to_json`` has written; raises ValueError for anything else."""
        try:
            values = json.loads(text)
            path = np.array(values["path"], dtype=np.float64).reshape(-1, 3)
            read = cls(
                str(values["name"]),
                float(values["stamp"]),
                path,
                float(values["remaining"]),
                bool(values["cannot_yield"]),
                int(values["waits"]),
                float(values["radius"]),
                bool(values.get("makes_room", False)),  # robots with an older version do not send these four
                bool(values.get("asks", False)),
                float(values.get("distance", 0.0)),
                bool(values.get("wishes", False)),
            )
        except (ValueError, KeyError, TypeError, OverflowError, RecursionError) as error:
            raise ValueError(f"no announcement of a robot: {type(error).__name__}: {error}") from error
        numbers = np.array([read.stamp, read.remaining, read.radius, read.distance])
        is_near = len(path) > 0 and bool((np.abs(path) <= FARTHEST_COORDINATE).all()) and read.length <= LONGEST_PATH
        if not (read.name and is_near and np.isfinite(numbers).all() and min(read.radius, read.distance) >= 0.0):
            raise ValueError(
                "no announcement of a robot: it needs a name, a place and finite numbers, the radius and the distance "
                f"not below 0, a path within {FARTHEST_COORDINATE:g} m of zero and of at most {LONGEST_PATH:g} m"
            )
        return read

    @property
    def length(self) -> float:
        """Of ``path`` [m]."""
        return float(norm(np.diff(self.path, axis=0)).sum())

    def points_ahead(self, length: float) -> FloatArray:
        """Points (n, 3) [m] of its path from where it is up to ``length`` [m], ``SPACING`` apart."""
        driven = np.concatenate([[0.0], np.cumsum(norm(np.diff(self.path, axis=0)))])
        at = np.arange(0.0, min(length, float(driven[-1])) + 0.5 * SPACING, SPACING)
        return np.column_stack([np.interp(at, driven, column) for column in self.path.T])
