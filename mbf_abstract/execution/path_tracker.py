"""Where on its path a robot is: the one tracker of all controllers, on grids and on meshes.

Progress is monotone. From the last progress on, the search follows the path to the point nearest to the robot and ends
where the path leads away from it, so a path that crosses itself, runs back beside itself, climbs storeys or ends where
it began is followed in order, however sparse its poses are. At a *cusp*, where the driving direction changes or the
path turns back on itself, the search waits until the robot has come to it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from copy import copy

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mbf_abstract.geometry import Path, Pose
from mbf_abstract.geometry.arithmetic import norm, scalar_products
from mbf_abstract.geometry.path_cusps import direction_past, find_cusps, points_along
from mbf_abstract.geometry.polyline import polyline_lengths, reverse_segments
from mbf_abstract.geometry.transform import Transform

FloatArray = NDArray[np.float64]

SEARCH_WINDOW = 2.0
"""How far ahead of the last progress [m] the nearest point is searched."""
CUSP_REACHED, SHARE_OF_SECTION = 0.1, 0.1
"""This near [m] to a cusp, and past all but this share of the section before it, the robot goes on to the next one."""
LEADS_AWAY = (1.5, 0.1)
"""The path leads away where it is farther from the robot than this factor times the least distance plus this [m]."""
SAME_PLACE = 0.3
"""A robot joins a path at the earliest place that is at most this much farther off [m] than the nearest one."""
SHORT_ARM = 0.1
"""The path leads to a cusp as it does over so much [m] before it, if its section is that long."""
CHUNK = 32
"""Number of segments that are checked in one step."""
_POSITION_NOISE = 1e-9  # [m]


class PathTracker:
    """One path and a robot's progress on it.

    Parameters
    ----------
    path : Path
        One without poses has no length, and must not be updated.
    dimensions : {2, 3}
        2 = seen from above, heights do not count.

    Attributes
    ----------
    points : (n, dimensions) float64
        Positions of the path [m].
    lengths : (n,) float64
        Length along the path [m] at each pose.
    reverse : (n - 1,) bool
        Segments that are driven backward: they lead against the heading of their poses.
    cusps : (k,) float64
        Lengths along the path [m] of its cusps, and of its end.
    length : float
        Of the path [m].
    next_cusp, last_cusp : float
        Length along the path [m] of the next cusp, or of the end, and of the one before it, or of the start.
    progress : float
        Length along the path [m] of the point the robot has got to.
    deviation : float
        Distance [m] of the robot from that point.
    cusp_reached : float
        This near [m] to a cusp, at most, the robot goes on to the next section.
    """

    def __init__(self, path: Path, dimensions: int = 3) -> None:
        self.path = path
        self.points: FloatArray = np.ascontiguousarray(path.positions[:, :dimensions])
        self.lengths = polyline_lengths(self.points)
        self.length = float(self.lengths[-1]) if len(self.lengths) else 0.0
        self.reverse = reverse_segments(path, self.points)
        self.cusps: FloatArray = find_cusps(self.points, self.lengths, self.reverse)
        self.deviation, self.cusp_reached, self._joined = 0.0, CUSP_REACHED, False
        self._advance(0.0)

    @property
    def goal(self) -> Pose:
        """Last pose of the path."""
        return self.path[len(self.path) - 1]

    @property
    def remaining(self) -> float:
        """Length [m] left along the path."""
        return self.length - self.progress

    @property
    def driving_backward(self) -> bool:
        """Whether the segment ahead is driven in reverse."""
        return bool(len(self.reverse)) and bool(self.reverse[min(self._segment, len(self.reverse) - 1)])

    @property
    def to_cusp(self) -> float:
        """Length [m] to the next cusp, or to the end."""
        return self.next_cusp - self.progress

    @property
    def on_last_section(self) -> bool:
        """Whether no cusp is left before the end."""
        return self.next_cusp >= self.length

    def has_arrived(self, dist_tolerance: float) -> bool:
        """Whether the robot has come along the path to within ``dist_tolerance`` [m] of its end."""
        return self.remaining <= dist_tolerance + _POSITION_NOISE

    def update(self, position: ArrayLike) -> None:
        """Move the progress on to where a robot at ``position`` (dimensions,) [m] is; it never goes back."""
        robot = np.asarray(position, dtype=np.float64)
        window = SEARCH_WINDOW
        if not self._joined:
            self._joined, window = True, math.inf
            self._advance(self._joining_place(robot))
        cusp, place = self.next_cusp, robot.tolist()
        self._advance(self._nearest_ahead(place, min(self.progress + window, cusp)))
        near = min(self.cusp_reached, SHARE_OF_SECTION * (cusp - self.last_cusp))
        if cusp < self.length and cusp - self.progress <= near:
            self._advance(cusp)
        self.deviation = _norm(c - r for c, r in zip(self._point_at(self.progress), place, strict=True))

    def begin_next_section(self) -> bool:
        """Take the next cusp for reached, unless it is the end or farther than ``CUSP_REACHED``; whether it is so."""
        is_near = not self.on_last_section and self.to_cusp <= CUSP_REACHED
        if is_near:
            self._advance(self.next_cusp)
        return is_near

    def end(self) -> None:
        """Take the path for driven to its end."""
        self._advance(self.length)

    def seen_from(self, transform: Transform) -> PathTracker:
        """Return the same path and progress in the transform's parent frame."""
        moved = copy(self)
        moved.path = transform.apply_to_path(self.path)
        moved.points = np.ascontiguousarray(moved.path.positions[:, : self.points.shape[1]])
        return moved

    def point_at(self, length: float) -> FloatArray:
        """Point (dimensions,) of the path at ``length`` [m] along it, clamped to its ends."""
        return np.array(self._point_at(length))

    def _point_at(self, length: float) -> list[float]:
        """As ``points_at``, to the bit, without the cost of array calls."""
        segment = int(self.lengths.searchsorted(length, side="right")) - 1
        if segment < 0 or segment == len(self.lengths) - 1:
            return list(self.points[max(segment, 0)].tolist())
        begin, end = self.lengths[segment : segment + 2].tolist()
        corner, following = self.points[segment : segment + 2].tolist()
        return [(f - c) / (end - begin) * (length - begin) + c for c, f in zip(corner, following, strict=True)]

    def carried_on(self, distance: float) -> FloatArray:
        """Point (dimensions,) ``distance`` [m] ahead on the path; past the next cusp, or the end, as it came there.

        A robot that steers to a cusp itself turns ever more the nearer it comes, if it is a little beside the path. One
        that steers straight on past the end of a curved stroke turns less than planned, by half of ``SHORT_ARM`` of it.
        """
        cusp = self.next_cusp
        beyond = self.progress + distance - cusp
        if beyond <= 0.0:
            return self.point_at(cusp + beyond)
        arm = max(min(SHORT_ARM, cusp - self.last_cusp), _POSITION_NOISE)
        end, before = self.point_at(cusp), self.point_at(cusp - arm)
        straight = (end - before) / arm
        heading = self._heading_at(cusp)
        direction = straight if heading is None else direction_past(straight, heading, min(beyond / arm, 1.0))
        return np.asarray(end + beyond * direction)

    def _heading_at(self, cusp: float) -> FloatArray | None:
        """Unit vector (dimensions,) of where the robot looks where it changes its gear; None at other cusps."""
        k = int(self.lengths.searchsorted(cusp))
        if not 0 < k < len(self.reverse) or self.reverse[k] == self.reverse[k - 1]:
            return None
        return np.asarray(self.path[k].rotation[: self.points.shape[1], 0])

    def points_at(self, lengths: FloatArray) -> FloatArray:
        """Points (m, dimensions) of the path at ``lengths`` (m,) [m] along it, clamped to its ends."""
        return points_along(self.points, self.lengths, lengths)

    def ahead(self, distance: float) -> FloatArray:
        """Points (m, dimensions) of the path from the progress on, over ``distance`` [m]; at least two."""
        end = min(self.progress + distance, self.length)
        last = int(np.searchsorted(self.lengths, end - _POSITION_NOISE, side="left"))
        first_point, last_point = self.points_at(np.array([self.progress, end]))
        return np.vstack([first_point, self.points[self._segment + 1 : last], last_point])

    def _advance(self, progress: float) -> None:
        self.progress = progress
        self._segment = max(int(self.lengths.searchsorted(progress + _POSITION_NOISE, side="right")) - 1, 0)
        ahead = int(self.cusps.searchsorted(progress + _POSITION_NOISE))
        self.next_cusp = float(self.cusps[min(ahead, len(self.cusps) - 1)]) if len(self.cusps) else 0.0
        self.last_cusp = float(self.cusps[ahead - 1]) if ahead > 0 else 0.0

    def _nearest_ahead(self, robot: list[float], end: float) -> float:
        """Length along the path [m], up to ``end``, of the point nearest to a robot; the earliest of equals.

        A plain loop: the path leads away from a robot that is on it within a few segments.
        """
        best, least, (factor, margin) = self.progress, math.inf, LEADS_AWAY
        for begin, length, corner, following in self._segments_from(self._segment):
            if begin >= end and least < math.inf:
                break
            scale = max(length, _POSITION_NOISE)
            side = [(f - c) / scale for c, f in zip(corner, following, strict=True)]
            along = sum((r - c) * s for r, c, s in zip(robot, corner, side, strict=True))
            along = min(max(along, self.progress - begin), end - begin, length)
            gap = _norm(r - c - along * s for r, c, s in zip(robot, corner, side, strict=True))
            if gap < least - _POSITION_NOISE:
                best, least = begin + along, gap
            if _norm(r - f for r, f in zip(robot, following, strict=True)) > factor * least + margin:
                break
        return max(best, self.progress)

    def _segments_from(self, first: int) -> Iterator[tuple[float, float, list[float], list[float]]]:
        """Segments from one on: length of the path before it [m], its own [m], its two ends."""
        for chunk in range(first, len(self.points) - 1, CHUNK):
            corners, lengths = self.points[chunk : chunk + CHUNK + 1], self.lengths[chunk : chunk + CHUNK + 1]
            ends, begins = corners.tolist(), lengths.tolist()
            for k in range(len(ends) - 1):
                yield begins[k], begins[k + 1] - begins[k], ends[k], ends[k + 1]

    def _joining_place(self, robot: FloatArray) -> float:
        """Length along the path [m] from which on a robot that comes to it looks for its place."""
        if len(self.points) < 2:
            return 0.0
        sides, offsets = np.diff(self.points, axis=0), robot - self.points[:-1]
        along, squares = scalar_products(offsets, sides), scalar_products(sides, sides)
        shares = np.clip(along / np.maximum(squares, _POSITION_NOISE), 0.0, 1.0)
        gaps = norm(offsets - shares[:, None] * sides)
        return float(self.lengths[int(np.argmax(gaps <= gaps.min() + SAME_PLACE))])


def _norm(components: Iterable[float]) -> float:
    total = 0.0
    for component in components:
        total += component * component
    return math.sqrt(total)
