"""The path that a robot leaves to let others pass: who is on it, and whether they drive on instead."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.arithmetic import norm
from mbf_abstract.maps.navigation_map import NavigationMap
from mbf_abstract.maps.tracking.objects import Motion, TrackedObject

AHEAD = 2.0
"""Length [m] of the path ahead that must be clear of others before a robot that has left it comes back early."""
DRIVEN_ON = 0.3
"""Who stood ahead and is this much [m] farther away drives on: it has waited for somebody else."""
AWAY = 0.7
"""From this cosine on between its way and the direction to it somebody drives away from where the path was left."""


class LeftPath:
    """The path straight ahead of the pose at which it was left, and back to that pose from where the robot is.

    Parameters
    ----------
    left_at : Pose
        In the frame of the map.
    near : float
        Who is this near [m] to the path is on it.
    now : float
        Time [s]; those who stand on it now are those for whom it is left.

    Attributes
    ----------
    seen : bool
        Whether somebody has been on it since it was left.
    """

    def __init__(self, navigation_map: NavigationMap, left_at: Pose, near: float, now: float) -> None:
        self._map, self._left_at, self._near = navigation_map, left_at, near
        self.seen = False
        on_it = self._on_it(left_at, now)
        self._stood = {one.number: self._distance(one) for one in on_it if one.motion is Motion.WAITING}

    def look(self, place: Pose, now: float) -> bool:
        """Whether somebody is on it, for a robot at ``place`` in the frame of the map; remembered."""
        present = any(self._on_it(place, now))
        self.seen = self.seen or present
        return present

    def is_free_again(self, place: Pose, now: float) -> bool:
        """Whether who stood on it drives on, and nobody else is on it who does not drive away as well."""
        here = list(self._on_it(place, now))
        driven_on = any(self._distance(one) > self._stood.get(one.number, math.inf) + DRIVEN_ON for one in here)
        return driven_on and all(self._drives_away(one) for one in here)

    def _on_it(self, place: Pose, now: float) -> Iterator[TrackedObject]:
        """Those who are not parked near the way from ``place`` back to the path, and ``AHEAD`` along it."""
        back = self._left_at
        share = np.linspace(0.0, 1.0, 21)[:, None]
        on = np.asarray(back.position) + share * back.rotation[:, 0] * AHEAD
        path = np.concatenate([np.asarray(place.position) + share * np.subtract(back.position, place.position), on])
        for one in self._map.tracked_objects(now):
            same_storey = abs(one.z - back.z) < self._map.same_storey
            near = float(norm(path[:, :2] - (one.x, one.y)).min()) < self._near
            if one.motion is not Motion.PARKED and same_storey and near:
                yield one

    def _distance(self, one: TrackedObject) -> float:
        return math.hypot(one.x - self._left_at.x, one.y - self._left_at.y)

    def _drives_away(self, one: TrackedObject) -> bool:
        along = (one.x - self._left_at.x) * one.vx + (one.y - self._left_at.y) * one.vy
        return one.motion is Motion.MOVING and along > AWAY * one.speed * self._distance(one)
