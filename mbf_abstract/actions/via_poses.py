"""Which via poses of a ``move_base`` goal are left, while the robot drives through them without a stop.

A pose is passed once the robot has come along its path to within the arrival tolerance of the place where the path
passes it, in order. So a path that crosses itself, or comes by a later pose first, drops none too early, and a
controller that cuts a corner misses none. Passed poses stay passed: replanning and recovering lead on to those left.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mbf_abstract.execution.path_tracker import SAME_PLACE
from mbf_abstract.geometry import FloatArray, Path, Pose
from mbf_abstract.geometry.arithmetic import norm, scalar_products
from mbf_abstract.geometry.polyline import polyline_lengths

_SHORTEST = 1e-18  # m^2, for the squared length of a segment without one


class ViaPoses:
    """The via poses of one goal, in the global frame.

    Attributes
    ----------
    left : tuple of Pose
        Those that the robot has not passed yet, in order.
    """

    def __init__(self, poses: Sequence[Pose]) -> None:
        self._count = len(poses)
        self.left = tuple(poses)
        self._planned = self.left
        self._rests: list[float] = []  # m of the path from each pose that is left to the path's end

    def plan(self) -> tuple[Pose, ...]:
        """Return the poses that the next path is to pass."""
        self._planned = self.left
        return self.left

    def follow(self, path: Path) -> None:
        """Take over the path that was planned last; poses that were passed meanwhile stay passed."""
        rests = rests_along(path, self._planned)
        self._rests = rests[len(rests) - len(self.left) :]

    def note_progress(self, to_go: float, tolerance: float) -> None:
        """Drop what a robot has passed that has ``to_go`` [m] left of its path."""
        while self._rests and to_go <= self._rests[0] + tolerance:
            self._rests.pop(0)
            self.left = self.left[1:]

    def described(self, message: str) -> str:
        """Return the message of a failed plan; planners count from the first pose that is left."""
        passed = self._count - len(self._planned)
        return f"with {passed} of {self._count} via poses passed: {message}" if passed else message


def rests_along(path: Path, poses: Sequence[Pose]) -> list[float]:
    """Return the length [m] of a path from where it passes each of ``poses``, in their order, to its end.

    It passes a pose where it is nearest on its first visit: the first part of it, behind the place of the pose before,
    that is at most ``SAME_PLACE`` farther off than the nearest point.
    """
    points = path.positions
    if len(points) < 2:
        return [0.0] * len(poses)
    lengths = polyline_lengths(points)
    place, rests = 0.0, []
    for pose in poses:
        place = _next_visit(points, lengths, pose, place)
        rests.append(float(lengths[-1]) - place)
    return rests


def _next_visit(points: FloatArray, lengths: FloatArray, pose: Pose, begin: float) -> float:
    """Length along a path [m], not less than ``begin``, of its next visit of a pose."""
    sides, offsets = np.diff(points, axis=0), np.asarray(pose.position) - points[:-1]
    steps = np.diff(lengths)
    shares = scalar_products(offsets, sides) / np.maximum(scalar_products(sides, sides), _SHORTEST)
    earliest = np.clip((begin - lengths[:-1]) / np.maximum(steps, _SHORTEST), 0.0, 1.0)
    shares = np.clip(shares, earliest, 1.0)
    gaps = norm(offsets - shares[:, None] * sides)
    gaps[lengths[1:] < begin] = np.inf
    visited = gaps <= gaps.min() + SAME_PLACE
    first = int(np.argmax(visited))
    left_again = np.flatnonzero(~visited[first:])
    end = first + int(left_again[0]) if len(left_again) else len(visited)
    nearest = first + int(np.argmin(gaps[first:end]))
    return float(lengths[nearest] + shares[nearest] * steps[nearest])
