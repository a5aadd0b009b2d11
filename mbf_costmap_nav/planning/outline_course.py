"""The poses a robot takes on a path over cells, and where its outline does not fit on them.

When to use: by planners that know the robot's inscribed radius only. When not: ``costmap.hybrid_astar``, whose search
knows the outline.

A robot that follows such a path looks along it, and turns on the spot where it starts with another heading or has to
end with one. All these poses are checked as the controllers check theirs: no lethal cell under the padded outline.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import normalize_angle
from mbf_abstract.geometry.polyline import polyline_lengths
from mbf_costmap_nav.grid.costmap import Costmap
from mbf_costmap_nav.grid.footprint_check import FootprintCheck
from mbf_costmap_nav.kernels.map.path_poses import course_along

FloatArray = NDArray[np.float64]

ARM = 0.2
"""The heading at a place is that of the line between the points so far [m] before and behind it on the path."""
BETWEEN, BETWEEN_OF_A_CAR = 3, 9
"""Poses between two of a manoeuvre, or of the path of a car, that are checked, too: a corner of the outline goes
farther than the middle."""


@dataclass(frozen=True)
class Course:
    """Poses along a path, a cell apart.

    Attributes
    ----------
    poses : (n, 3) float64
        x, y [m] and yaw [rad]; the first and the last have the headings of the path, not those that are asked for.
    lengths : (n,) float64
        Length along the path [m] at each.
    start_yaw, end_yaw : float or None
        Headings [rad] from which, and to which, the robot turns where it stands; None = it does not.
    """

    poses: FloatArray
    lengths: FloatArray
    start_yaw: float | None
    end_yaw: float | None

    @classmethod
    def along(cls, points: FloatArray, spacing: float, start_yaw: float | None, end_yaw: float | None) -> Course:
        """Course on a path of points (k, 2), with poses at most ``spacing`` [m] apart."""
        poses, lengths = course_along(np.ascontiguousarray(points), spacing, ARM)
        if lengths[-1] == 0.0:  # the robot stays where it is: it only turns
            poses[:, 2] = start_yaw if start_yaw is not None else end_yaw or 0.0
        return cls(poses, lengths, start_yaw, end_yaw)

    def misfits(self, check: FootprintCheck, costmap: Costmap) -> NDArray[np.bool_]:
        """(n,) bool: where the outline touches a lethal cell; at the ends also while the robot turns."""
        wrong = check.collisions(costmap, self.poses)
        for index in (0, -1):
            wrong[index] |= check.first_collision(costmap, self._turn(index, check, costmap)) >= 0
        return wrong

    def colliding_pose(self, index: int, check: FootprintCheck, costmap: Costmap) -> tuple[float, float, float]:
        """The pose (x, y, yaw) that touches something at a place of which ``misfits`` is true."""
        poses = np.concatenate([self.poses[index][None], self._turn(index, check, costmap)])
        x, y, yaw = poses[max(check.first_collision(costmap, poses), 0)].tolist()
        return x, y, yaw

    def before_misfit(self, points: FloatArray, spare: float, check: FootprintCheck, costmap: Costmap) -> FloatArray:
        """Points (m, 2) up to the last place, within ``spare`` [m] of the end, where the robot fits and can turn.

        Without one all ``points`` (k, 2) of the path are returned.
        """
        for index in range(len(self.poses) - 1, 0, -1):
            if self.lengths[-1] - self.lengths[index] > spare:
                break
            there = Course(self.poses[: index + 1], self.lengths[: index + 1], None, self.end_yaw)
            turn = np.concatenate([self.poses[index][None], there._turn(-1, check, costmap)])
            if check.first_collision(costmap, turn) < 0:
                kept = points[polyline_lengths(points) < self.lengths[index]]
                return np.concatenate([kept, self.poses[index, :2][None]])
        return points

    def _turn(self, index: int, check: FootprintCheck, costmap: Costmap) -> FloatArray:
        """Poses (k, 3) on the turn at a place of the course; none between its ends."""
        yaw = self.start_yaw if index == 0 else self.end_yaw if index in (-1, len(self.poses) - 1) else None
        if yaw is None:
            return np.zeros((0, 3))
        return turn_poses(self.poses[index], yaw, turn_step(check, costmap))


def dense(poses: FloatArray, count: int = BETWEEN) -> FloatArray:
    """Poses (n, 3) a cell apart with ``count`` more between any two, as the controllers look at them."""
    shares = np.arange(count + 1)[:, None] / (count + 1)
    between = poses[:-1, None] + shares * (poses[1:] - poses[:-1])[:, None]
    return np.concatenate([between.reshape(-1, 3), poses[-1:]])


def turn_step(check: FootprintCheck, costmap: Costmap) -> float:
    """Angle [rad] by which no corner of the outline goes farther than half a cell."""
    return 0.5 * costmap.resolution / max(check.footprint.circumscribed_radius, costmap.resolution)


def turn_poses(pose: FloatArray, yaw: float, step: float) -> FloatArray:
    """Poses (n, 3) on the shorter turn on the spot from a pose (3,) to ``yaw`` [rad], at most ``step`` [rad] apart."""
    x, y, begin = pose.tolist()
    turn = normalize_angle(yaw - begin)
    shares = np.arange(1, math.ceil(abs(turn) / step) + 1) / max(1, math.ceil(abs(turn) / step))
    return np.column_stack([np.full_like(shares, x), np.full_like(shares, y), begin + turn * shares])


def stretches(wrong: NDArray[np.bool_], lengths: FloatArray, reach: float) -> list[tuple[int, int]]:
    """First and last index of the parts of a course within ``reach`` [m] of poses that do not fit, joined."""
    parts: list[tuple[int, int]] = []
    for index in np.flatnonzero(wrong).tolist():
        first = int(np.searchsorted(lengths, lengths[index] - reach))
        last = min(int(np.searchsorted(lengths, lengths[index] + reach)), len(lengths) - 1)
        if parts and first <= parts[-1][1]:
            parts[-1] = parts[-1][0], last
        else:
            parts.append((first, last))
    return parts
