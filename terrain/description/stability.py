"""Where a standing robot tips over, and which edges and ramps its body clears. Pure functions.

A robot on a slope tips over the edge of its support polygon when the vertical through its centre of mass leaves the
polygon: at tan(slope) = distance / height (static stability, McGhee and Frank, Mathematical Biosciences 3, 1968;
Gillespie, Fundamentals of Vehicle Dynamics, 1992, chapter 9). Approach, departure and ramp angles are those of ISO 612:
planes tangent to the wheels below which no part of the body lies.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from mbf_abstract.geometry import FloatArray
from terrain.description.outline import Corner, convex_outline, edge_distance, reach

RIGHT_ANGLE = 0.5 * math.pi
SAMPLES = 64  # of an edge that a crest may touch anywhere; even, so that its middle is one of them


@dataclass(frozen=True)
class Tipping:
    """Slopes [rad] at which the robot tips over: nose down, nose up, to its left, its right, and the least of any."""

    forward: float
    backward: float
    left: float
    right: float
    least: float


def tipping(contacts: FloatArray, centre: tuple[float, float, float]) -> Tipping | None:
    """Slopes at which a robot tips over.

    Parameters
    ----------
    contacts : (n, 2) float
        Where it touches the ground [m].
    centre : tuple of 3 floats
        Centre of mass above the ground [m].

    Returns
    -------
    Tipping or None
        Below 0 in a direction in which it falls on level ground; None with contacts on one line.
    """
    polygon = convex_outline(contacts)
    if len(polygon) < 3:
        return None
    x, y, height = centre
    distances = [reach(polygon, (x, y), direction) for direction in ((1, 0), (-1, 0), (0, 1), (0, -1))]
    distances.append(edge_distance(polygon, (x, y)))
    forward, backward, left, right, least = (math.atan2(distance, height) for distance in distances)
    return Tipping(forward, backward, left, right, least)


@dataclass(frozen=True)
class Edges:
    """What the body clears.

    Attributes
    ----------
    approach, departure : float
        Angles [rad] of the steepest ramps before the front and behind the rear wheels; a right angle if nothing is in
        their way.
    breakover : float
        Angle [rad] between the two sides of the sharpest crest below the robot, 0 for level ground; pi likewise.
    """

    approach: float
    departure: float
    breakover: float


def clear_angles(parts: Sequence[list[Corner]], front: tuple[float, float], rear: tuple[float, float]) -> Edges:
    """Angles that a body clears.

    Parameters
    ----------
    parts : sequence of lists of (x, z)
        Outlines [m] of the convex parts of the body seen from the side, z above the ground.
    front, rear : (x, radius)
        Of the foremost and the rearmost wheels [m].
    """
    points = [corner for part in parts for corner in part]
    ahead = [_tangent(x - front[0], z, front[1]) for x, z in points if x > front[0]]
    behind = [_tangent(rear[0] - x, z, rear[1]) for x, z in points if x < rear[0]]
    between = [
        _tangent(front[0] - x, z, front[1]) + _tangent(x - rear[0], z, rear[1])
        for part in parts
        for x, z in _between(part, rear[0], front[0])
    ]
    return Edges(min(ahead, default=RIGHT_ANGLE), min(behind, default=RIGHT_ANGLE), min(between, default=math.pi))


def _between(part: list[Corner], low: float, high: float) -> Iterator[Corner]:
    """Points on the outline of a part with ``low`` < x < ``high``: the middle of each edge, and others evenly apart."""
    for (ax, az), (bx, bz) in zip(part, [*part[1:], *part[:1]], strict=True):
        first, last = max(low, min(ax, bx)), min(high, max(ax, bx))
        if first >= last:
            continue
        for k in range(SAMPLES + 1):
            x = first + (last - first) * k / SAMPLES
            if low < x < high:
                yield x, az + (bz - az) * (x - ax) / (bx - ax)


def _tangent(distance: float, z: float, radius: float) -> float:
    """Angle [rad] of the line from a point tangent to the underside of a wheel, at most a right angle.

    The wheel of ``radius`` stands at 0 on the ground, the point at ``distance`` > 0 [m] and height ``z`` [m].
    """
    span = math.hypot(distance, z - radius)
    if span <= radius:
        return RIGHT_ANGLE
    return max(0.0, min(RIGHT_ANGLE, math.acos(-radius / span) - math.atan2(distance, z - radius)))


def seen_from_the_side(points: FloatArray) -> list[Corner]:
    """Outline x, z [m] of the hull of points (n, 3)."""
    return convex_outline(points[:, [0, 2]])
