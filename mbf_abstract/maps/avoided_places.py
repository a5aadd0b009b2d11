"""Places where a robot was stuck, closed on its maps until its goal ends.

A map may be wrong about a place: the ground is steeper than it says, or the wheels find no hold. The plan after the
recovery then leads to the same place again. So an executive closes the place and what lies ahead of it: the next plan
leads around, whoever makes it. A place is closed only once the robot has left it, because no plan begins on closed
ground. Where no plan is left, all places are open again and stay so: a bad path is better than none.

When to use: by the ``StuckMonitor`` of an executive. When not: ground that is known to be bad; use ``keepout``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from mbf_abstract.geometry import Pose

BESIDE = 0.1
"""A robot so far [m] outside of a place has left it."""


@dataclass(frozen=True)
class AvoidedPlace:
    """A disc on the ground: its centre, and its radius [m]."""

    centre: Pose
    radius: float

    @classmethod
    def ahead_of(cls, pose: Pose, radius: float) -> AvoidedPlace:
        """Return the disc of a radius [m] that begins half of it behind a robot and ends one and a half radii ahead."""
        x, y, z = (pose.position + 0.5 * radius * pose.rotation[:, 0]).tolist()
        return cls(replace(pose, position=(x, y, z)), radius)


class AvoidedPlaces:
    """The places of one goal.

    Parameters
    ----------
    close : callable
        Closes these places, and no others, on all maps of the robot.

    Attributes
    ----------
    closed : tuple of AvoidedPlace
        Those that are closed now.
    """

    def __init__(self, close: Callable[[Sequence[AvoidedPlace]], None]) -> None:
        self._close = close
        self._noted: list[AvoidedPlace] = []
        self.closed: tuple[AvoidedPlace, ...] = ()
        self._is_open = False  # for the rest of the goal

    def note(self, pose: Pose, radius: float) -> None:
        """The robot, of a radius [m], is stuck at a pose; closes nothing yet."""
        place = AvoidedPlace.ahead_of(pose, radius)
        if not any(known.centre.distance_to(place.centre) < 0.5 * radius for known in self._noted):
            self._noted.append(place)

    def close_those_left(self, pose: Pose) -> tuple[AvoidedPlace, ...]:
        """Close the noted places that a robot at a pose does not stand on; return all that are closed."""
        left = (place for place in self._noted if place.centre.distance_to(pose) >= place.radius + BESIDE)
        self._show(() if self._is_open else tuple(left))
        return self.closed

    def open_all(self) -> bool:
        """Open all places for the rest of the goal; return whether any was closed."""
        if not self.closed:
            return False
        self._is_open = True
        self._show(())
        return True

    def forget(self) -> None:
        """Forget all places: the goal is over."""
        self._noted, self._is_open = [], False
        self._show(())

    def _show(self, places: tuple[AvoidedPlace, ...]) -> None:
        if places != self.closed:
            self.closed = places
            self._close(places)
