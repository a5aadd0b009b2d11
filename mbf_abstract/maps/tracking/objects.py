"""Tracked objects: what a map knows of the things that move on it, and what changes from update to update."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from typing import TypeVar

import numpy as np

from mbf_abstract.geometry import FloatArray
from mbf_abstract.geometry.transform import Transform

Seconds = TypeVar("Seconds", float, FloatArray)
GONE = "gone"
MOST_REPORTS = 20
"""Most changes that one update reports; the next one reports those that are left."""


class Motion(str, Enum):
    """What an executive should make of an object: wait for it, yield to it, or plan around it."""

    MOVING = "moving"
    WAITING = "waiting"  # stands, but not for long: it may move on
    PARKED = "parked"


@dataclass(frozen=True)
class TrackedObject:
    """One object at one time.

    Attributes
    ----------
    number : int
        Identifies it for as long as it is tracked; never used again.
    x, y, z : float
        Estimated middle [m], in the frame ``frame_id``; z is that of its points, or of the ground below them.
    vx, vy : float
        Estimated velocity [m/s] along the axes of that frame; 0 unless it is moving.
    radius : float
        Half of its length [m] along the longer axis, as far as it has been seen.
    age : float
        Time since it was first seen [s].
    unseen : float
        Time since it was last seen [s].
    standing : float
        How long it has been standing [s]; 0 while it moves.
    stamp : float
        Time of all this [s].
    pace : float
        Greatest estimated speed of late [m/s]. Where an object turns round, the estimate of its velocity falls on its
        way to the other side, and its speed does not. Of one who waits the speed at which it would not be noticed to
        set off; 0 once it is parked.
    course : tuple of float
        Which way it was seen to come last [m], along the axes of that frame, also while it stands; (0, 0) = it was
        never seen to move.
    """

    number: int
    motion: Motion
    x: float
    y: float
    z: float
    vx: float
    vy: float
    radius: float
    age: float
    unseen: float
    standing: float
    stamp: float
    frame_id: str
    pace: float = 0.0
    course: tuple[float, float] = (0.0, 0.0)

    @property
    def speed(self) -> float:
        """Speed [m/s]."""
        return math.hypot(self.vx, self.vy)

    def position_in(self, seconds: Seconds) -> tuple[Seconds, Seconds]:
        """Where it will be in some time [s], or in several, if it keeps its velocity, as x and y [m]."""
        return self.x + seconds * self.vx, self.y + seconds * self.vy

    def seen_from(self, transform: Transform) -> TrackedObject:
        """Express it in the parent frame of a transform from its own one."""
        x, y, z = transform.apply(np.array([[self.x, self.y, self.z]]))[0].tolist()
        ahead = np.array([(self.vx, self.vy, 0.0), (*self.course, 0.0)])
        ahead += (self.x, self.y, self.z)
        (vx, vy), (course_x, course_y) = (transform.apply(ahead)[:, :2] - (x, y)).tolist()
        frame, course = transform.parent, (course_x, course_y)
        return replace(self, x=x, y=y, z=z, vx=vx, vy=vy, frame_id=frame, course=course)

    def to_data(self) -> dict[str, object]:
        """Plain JSON values, for events."""
        return {
            "number": self.number,
            "motion": self.motion.value,
            "position": [self.x, self.y, self.z],
            "velocity": [self.vx, self.vy],
            "radius": self.radius,
        }


class MotionChanges:
    """Remembers what was last reported of each object; those that only ever stood are not reported."""

    def __init__(self) -> None:
        self._reported: dict[int, TrackedObject] = {}

    def changes(self, objects: Sequence[TrackedObject]) -> Iterator[dict[str, object]]:
        """Yield the data of an event for each object that has begun to move, has stopped, is parked or is gone."""
        left = MOST_REPORTS
        numbers = {known.number for known in objects}
        for known in objects:
            last = self._reported.get(known.number)
            changed = known.motion is Motion.MOVING if last is None else known.motion is not last.motion
            if changed and left > 0:
                self._reported[known.number] = known
                left -= 1
                yield known.to_data()
        for number in [number for number in self._reported if number not in numbers][:left]:
            yield self._reported.pop(number).to_data() | {"motion": GONE}
