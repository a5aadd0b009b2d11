"""Where a path has cusps: its driving direction changes there, or it turns back on itself; so it does at its end."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry.arithmetic import norm, scalar_products

FloatArray = NDArray[np.float64]

ARM, GAINED = 0.2, 0.2
"""A path turns back on itself where two of its points, ``ARM`` [m] before and behind, are nearer than ``GAINED`` [m]:
by 120 degrees, or on a smooth bend of a radius below 0.11 m."""
BENT = 0.5
"""The heading at a cusp is that of an arc that bends by at most so much [rad] from the middle of its last chord."""


def find_cusps(points: FloatArray, lengths: FloatArray, reverse: NDArray[np.bool_]) -> FloatArray:
    """Lengths (k,) [m] along a path of its cusps, in order, and of its end.

    Parameters
    ----------
    points : (n, dimensions) float64
        Positions of the path [m].
    lengths : (n,) float64
        Length along the path [m] at each of them.
    reverse : (n - 1,) bool
        Segments that are driven backward.
    """
    switches = lengths[1:-1][reverse[1:] != reverse[:-1]]
    turns = [turn for turn in _turns_back(points, lengths).tolist() if not np.any(np.abs(switches - turn) <= ARM)]
    return np.unique(np.concatenate([switches, turns, lengths[-1:]]))


def points_along(points: FloatArray, lengths: FloatArray, at: FloatArray) -> FloatArray:
    """Points (m, dimensions) of a path at lengths (m,) [m] along it, clamped to its ends."""
    return np.stack([np.interp(at, lengths, column) for column in points.T], axis=-1)


def direction_past(straight: FloatArray, heading: FloatArray, share: float) -> FloatArray:
    """Unit vector (d,) from a cusp to a point that lies past it on the arc on which a path comes to it.

    Parameters
    ----------
    straight : (d,) float64
        Unit vector along the last chord before the cusp.
    heading : (d,) float64
        Where the robot looks at the cusp, along the arc or against it. One that is more than ``BENT`` off the chord
        says nothing about the arc: then the path leads straight on.
    share : float
        How far the point lies past the cusp, in lengths of the chord; 0 to 1.
    """
    size, along = float(norm(heading)), float(scalar_products(heading, straight))
    if abs(along) <= math.cos(BENT) * size:
        return straight
    tangent = heading * math.copysign(1.0 / size, along)
    next_chord = 2.0 * abs(along) / size * tangent - straight  # the last one, seen in a mirror across the tangent
    direction = tangent + share * (next_chord - tangent)
    return np.asarray(direction / float(norm(direction)))


def _turns_back(points: FloatArray, lengths: FloatArray) -> FloatArray:
    """Lengths along the path [m] of the poses at which it turns back on itself: one, the sharpest, a turn."""
    length = float(lengths[-1]) if len(lengths) else 0.0
    inner = lengths[(lengths >= ARM) & (lengths <= length - ARM)]
    if not len(inner):
        return inner
    gained = norm(points_along(points, lengths, inner + ARM) - points_along(points, lengths, inner - ARM))
    turning, gained = inner[gained < GAINED], gained[gained < GAINED]
    turns = np.split(np.arange(len(turning)), np.flatnonzero(np.diff(turning) > ARM) + 1)
    return turning[np.array([turn[np.argmin(gained[turn])] for turn in turns if len(turn)], dtype=np.intp)]
