"""A tracker of moving objects in the points that a sensor sees.

Clusters of points are assigned to the objects that are known, the nearest pairs first, and correct a Kalman filter of
constant velocity for each. One that is off its expected place to the same side twice has turned: its filter learns the
new velocity at once. What is seen for the first time begins an object, what is not seen any more is forgotten. Where
the rays of a scan are known, motion is seen in the sides of a cluster that nothing hides.

When to use: people and robots among walls that a static map knows; take the points of that map out first, or what is
seen of a wall through a gap passes for something that moves. When not: crowds so dense that their clusters merge, and
things longer than ``max_size``, which are left to the obstacle layers.
Cost: about 0.1 ms a scan of 720 beams among 20 objects, see ``benchmarks/tracking.py``.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import FloatArray
from mbf_abstract.maps.tracking.kernels import filtering as states_of
from mbf_abstract.maps.tracking.kernels.clustering import bounding_boxes, cluster
from mbf_abstract.maps.tracking.kernels.occlusion import find_free_sides
from mbf_abstract.maps.tracking.objects import Motion, TrackedObject
from mbf_abstract.maps.tracking.rays import Rays
from mbf_abstract.maps.tracking.setting_off import seems_to_move, unnoticed_speed
from mbf_abstract.parameters import ParameterModel, parameter

MAX_POINTS = 2000
"""Of more points only every second, third and so on is looked at, to bound the work."""
NO_OBJECT = 0
"""Number that stands for no object."""
BEGINNING = 0.5
"""An object that is not confirmed yet is forgotten after this share of ``forget_time``."""
SHRINKING = 0.1
"""How fast [m/s] the remembered half size of an object falls to what is seen of it."""
SAME_MOMENT = 1e-6
"""A scan that is older than the last one by no more than this [s] is taken in."""


class TrackingParameters(ParameterModel):
    """How objects are found and followed."""

    cluster_distance: float = parameter(0.3, "Points this near belong to one object.", unit="m", gt=0.0, le=5.0)
    min_points: int = parameter(3, "Smaller clusters begin no object.", ge=1, le=1000)
    max_size: float = parameter(1.5, "Longer clusters are walls, not objects.", unit="m", gt=0.0, le=20.0)
    max_objects: int = parameter(50, "Most objects that are followed.", ge=1, le=1000, dynamic=False)
    association_distance: float = parameter(
        0.6, "Farther than this from where it was expected it is another object.", unit="m", gt=0.0, le=10.0
    )
    position_deviation: float = parameter(
        0.05, "Standard deviation of the middle of a cluster.", unit="m", gt=0.0, le=5.0
    )
    acceleration_deviation: float = parameter(
        1.5, "Standard deviation of the acceleration of objects.", unit="m/s^2", gt=0.0, le=50.0
    )
    turning_deviation: float = parameter(
        0.5,
        "Standard deviation of the change of an object's velocity where it turns; 0 = turns are noticed late.",
        unit="m/s",
        ge=0.0,
        le=10.0,
    )
    confirming_scans: int = parameter(3, "An object counts once it was seen in so many scans.", ge=1, le=100)
    forget_time: float = parameter(1.0, "An object that is unseen for longer is forgotten.", unit="s", gt=0.0, le=60.0)
    moving_distance: float = parameter(
        0.25, "An object has moved once it has come this far.", unit="m", gt=0.0, le=10.0
    )
    standing_time: float = parameter(
        1.5, "An object that does not come that far in this time stands.", unit="s", gt=0.0, le=60.0
    )
    parked_time: float = parameter(20.0, "An object that stands for longer is parked.", unit="s", gt=0.0, le=3600.0)


class Tracker:
    """Follows objects from scan to scan.

    Parameters
    ----------
    parameters : TrackingParameters
        Can be replaced at any time; ``max_objects`` stays.
    frame_id : str
        Frame of all points.
    """

    def __init__(self, parameters: TrackingParameters, frame_id: str) -> None:
        self.parameters = parameters
        self.frame_id = frame_id
        self._room = np.zeros((parameters.max_objects, states_of.STATE_COLUMNS))
        self._numbers = np.zeros(parameters.max_objects, dtype=np.int64)
        self._count, self._next_number = 0, NO_OBJECT + 1
        self._time = -math.inf

    def __len__(self) -> int:
        """Return how many objects are followed, those that are not confirmed yet included."""
        return self._count

    def insert(
        self, points: FloatArray, sensor: FloatArray, stamp: float, rays: Rays | None = None
    ) -> NDArray[np.int64]:
        """Take in the points of one scan.

        Parameters
        ----------
        points : (n, 3) float64
            What was hit and is not part of the static map [m].
        sensor : (3,) float64
            Where it was seen from [m].
        stamp : float
            When [s]; a scan older than the last one is ignored.
        rays : Rays, optional
            All of the scan; without them each cluster is taken to be seen from end to end.

        Returns
        -------
        (n,) int64
            Number of the confirmed object that each point belongs to; NO_OBJECT for the others.
        """
        found = np.full(len(points), NO_OBJECT, dtype=np.int64)
        if stamp < self._time - SAME_MOMENT:
            return found
        p = self.parameters
        stride = -(-len(points) // MAX_POINTS) or 1
        seen = np.ascontiguousarray(points[::stride], dtype=np.float64)
        labels, count = cluster(seen, np.argsort(seen[:, 0], kind="stable"), p.cluster_distance)
        boxes = bounding_boxes(seen, labels, count)
        if rays is not None:
            ends, of_points = rays.thinned(stride)
            find_free_sides(ends[of_points], labels, boxes, ends, sensor, p.max_size)
        seconds = self._advance(stamp)
        states = self._room[: self._count]
        owners = states_of.assign(states, boxes, sensor, p.max_size, p.association_distance)
        deviations = np.array([p.position_deviation, p.turning_deviation])
        states_of.correct(states, boxes, owners, sensor, stamp, seconds, deviations, SHRINKING * seconds)
        states_of.note_motion(states, stamp, p.moving_distance)
        known = (owners >= 0) & self._confirmed()[owners]
        found[::stride] = np.where(known, self._numbers[owners], NO_OBJECT)[labels]
        self._begin(boxes, owners, sensor, stamp)
        self._forget(stamp)
        return found

    def _advance(self, stamp: float) -> float:
        """Predict all objects to a time [s]; return how much [s] has passed."""
        seconds = stamp - self._time if self._count else 0.0
        states_of.predict(self._room[: self._count], seconds, self.parameters.acceleration_deviation)
        self._time = max(self._time, stamp)
        return seconds

    def _confirmed(self) -> NDArray[np.bool_]:
        """Mask of all rows that hold an object that was seen often enough."""
        confirmed = self._room[:, states_of.SCANS] >= self.parameters.confirming_scans
        confirmed[self._count :] = False
        return np.asarray(confirmed)

    def _begin(self, boxes: FloatArray, owners: NDArray[np.int64], sensor: FloatArray, stamp: float) -> None:
        """Begin objects from clusters that are none yet, as many as there is room for."""
        p = self.parameters
        deviations = np.array([p.position_deviation, p.association_distance])  # m, and m/s from one second to the next
        for j in states_of.may_begin(boxes, owners, p.min_points, p.max_size).tolist():
            if self._count == len(self._room):
                return
            states_of.born(boxes[j], sensor, stamp, self._room[self._count], deviations)
            self._numbers[self._count] = self._next_number
            self._count, self._next_number = self._count + 1, self._next_number + 1

    def _forget(self, now: float) -> None:
        """Drop the objects that are unseen for too long at ``now`` [s]; the others keep their order."""
        p, states = self.parameters, self._room[: self._count]
        limits = np.where(self._confirmed()[: self._count], p.forget_time, BEGINNING * p.forget_time)
        self._keep(now - states[:, states_of.LAST_SEEN] <= limits)

    def _keep(self, mask: NDArray[np.bool_]) -> None:
        rows = np.flatnonzero(mask)
        self._room[: len(rows)] = self._room[: self._count][rows]
        self._numbers[: len(rows)] = self._numbers[: self._count][rows]
        self._count = len(rows)

    def clear(self, within: Callable[[FloatArray], NDArray[np.bool_]] | None = None) -> None:
        """Hide all objects, or those whose middles (n, 3) [m] are ``within`` an area, until they are seen again.

        A map that is cleared must not forget who moves: before somebody is known anew the robot would have touched
        them. Those that are not seen again are forgotten as all others.
        """
        states = self._room[: self._count]
        cleared = True if within is None else within(states[:, [states_of.X, states_of.Y, states_of.Z]])
        states[:, states_of.CLEARED] = np.maximum(states[:, states_of.CLEARED], cleared)

    def are_moving(self, numbers: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Mask (n,) of the numbers of objects that were moving in the last scan."""
        states = self._room[: self._count]
        stood = self._time - states[:, states_of.ANCHOR_TIME]
        moving = (states[:, states_of.HAS_MOVED] > 0.0) & (stood <= self.parameters.standing_time)
        return np.asarray(np.isin(numbers, self._numbers[: self._count][moving]))

    def objects(self, now: float, *, guarded: bool = False) -> tuple[TrackedObject, ...]:
        """The confirmed objects, in the order in which they were first seen; none that is unseen for too long.

        Parameters
        ----------
        now : float
            For when [s] their places are given.
        guarded : bool
            For the guard that stops the robot before contact. Two things differ then: objects that ``clear`` has hidden
            are among them; and an object is moving as soon as it seems to (``setting_off.py``).
        """
        shown = self._confirmed() & (guarded | (self._room[:, states_of.CLEARED] == 0.0))
        rows = np.flatnonzero(shown).tolist()
        alike = (self._object(self._room[row].tolist(), int(self._numbers[row]), now, guarded) for row in rows)
        return tuple(known for known in alike if known.unseen <= self.parameters.forget_time)

    def _object(self, state: list[float], number: int, now: float, guarded: bool) -> TrackedObject:
        p, later = self.parameters, max(now - self._time, 0.0)
        stood = max(now - state[states_of.ANCHOR_TIME], 0.0)
        moves = bool(state[states_of.HAS_MOVED]) and stood <= p.standing_time
        moves = moves or (guarded and seems_to_move(state, now, p.moving_distance, p.standing_time))
        motion = Motion.MOVING if moves else Motion.PARKED if stood > p.parked_time else Motion.WAITING
        vx, vy = (state[states_of.VX], state[states_of.VY]) if moves else (0.0, 0.0)
        pace = unnoticed_speed(p.moving_distance, p.standing_time) if motion is Motion.WAITING else 0.0
        return TrackedObject(
            number=number,
            motion=motion,
            x=state[states_of.X] + later * vx,
            y=state[states_of.Y] + later * vy,
            z=state[states_of.Z],
            vx=vx,
            vy=vy,
            pace=state[states_of.PACE] if moves else pace,
            course=(state[states_of.COURSE_X], state[states_of.COURSE_Y]),
            radius=max(state[states_of.HALF_X], state[states_of.HALF_Y]),
            age=now - state[states_of.FIRST_SEEN],
            unseen=max(now - state[states_of.LAST_SEEN], 0.0),
            standing=0.0 if moves else stood,
            stamp=now,
            frame_id=self.frame_id,
        )
