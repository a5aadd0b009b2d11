"""Whether a robot goes on with a manoeuvre although a newer plan has come.

A planner that knows the robot's outline finds manoeuvres, and a few centimetres farther on another one may cost less. A
robot that took over each of them would drive to and fro between two places, for ever. So it goes on where the way
that is left is no longer than the new one. What is left grows shorter as it drives; it takes over another manoeuvre as
long as that makes it shorter still, and arrives. Elsewhere, and where the old path is blocked, the newest plan holds.
"""

from __future__ import annotations

import numpy as np

from mbf_abstract.geometry import Path
from mbf_abstract.geometry.polyline import polyline_lengths, reverse_segments

NEAR = 1.5
"""A robot is in a manoeuvre where its path, or the new one, changes gear within so much [m]."""


def goes_on(followed: Path, to_go: float, new: Path) -> bool:
    """Whether to keep to a path with ``to_go`` [m] left rather than take one from where the robot is."""
    if to_go > new.length:
        return False
    near = np.concatenate([_gears(followed, followed.length - to_go), _gears(new, 0.0)])
    return bool(near.any() and not near.all())


def _gears(path: Path, done: float) -> np.ndarray:
    """Whether a path is driven in reverse, for each segment within ``NEAR`` of ``done`` [m] along it."""
    lengths = polyline_lengths(path.positions)
    here = max(int(np.searchsorted(lengths, done, side="right")) - 1, 0)
    return reverse_segments(path, path.positions)[here:][lengths[here:-1] <= done + NEAR]


def rest_of(path: Path, to_go: float) -> Path:
    """The last ``to_go`` [m] of a path, from one of its poses on."""
    return path[int(np.searchsorted(polyline_lengths(path.positions), path.length - to_go)) :]
