"""The announcements of the robots, as one of them knows them, and the channel that carries them.

A server has an empty ``Traffic``. ``connect`` gives it the robot's name and a channel: ``SharedChannel`` for robots in
one process, or one of your own, such as a ROS topic that carries ``Announcement.to_json``. An ``Announcer`` publishes
where the robot is and where it goes.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from mbf_abstract.geometry import FloatArray, Path
from mbf_abstract.geometry.arithmetic import norm
from mbf_abstract.traffic.announcement import DIGITS, Announcement
from mbf_abstract.traffic.right_of_way import distance_between, is_rival

MAX_AGE = 3.0
"""A robot that announces nothing new for this long [s] does not count: it is switched off, or out of reach."""
PARTED_AFTER = 10.0
"""A meeting is over when nobody has been in the way for this long [s]: longer than it takes to drive past."""
ANOTHER_GOAL = 1.0
"""A path that ends farther than this [m] from where the last one ended leads to another goal."""


class Channel(Protocol):
    """Carries announcements between robots; both methods are called on any thread, and do not wait."""

    def publish(self, announcement: Announcement) -> None:
        """Send the newest announcement of one robot to all others."""

    def latest(self) -> tuple[Announcement, ...]:
        """Return the newest announcement of each robot that has sent one."""


class SharedChannel:
    """A channel for robots in one process."""

    def __init__(self) -> None:
        self._latest: dict[str, Announcement] = {}
        self._lock = threading.Lock()

    def publish(self, announcement: Announcement) -> None:
        """Keep the newest announcement of a robot."""
        with self._lock:
            self._latest[announcement.name] = announcement

    def latest(self) -> tuple[Announcement, ...]:
        """Return the newest announcement of each robot, in the order of their names."""
        with self._lock:
            return tuple(self._latest[name] for name in sorted(self._latest))


@dataclass
class Meeting:
    """What decides on the right of way of a robot while it meets others, until they have parted or its goal changes.

    Attributes
    ----------
    distance, length : float
        As for ``Traffic.rivals`` [m].
    seen : float
        Last time [s] at which anybody was in the way.
    remaining : float
        Length [m] of the path to the goal when they met.
    no_place_at : (3,) float64 or None
        Where the robot has found no place to let others pass [m], if it has looked; it still cannot yield there.
    waits : int
        As it is announced.
    """

    distance: float
    length: float
    seen: float
    remaining: float
    no_place_at: FloatArray | None = None
    waits: int = 0

    @property
    def cannot_yield(self) -> bool:
        """As it is announced."""
        return self.no_place_at is not None

    def at(self, place: FloatArray) -> None:
        """Forget that there is no place to yield where the robot, now at ``place`` (3,) [m], is somewhere else."""
        if self.no_place_at is not None and float(norm(place - self.no_place_at)) > self.distance:
            self.no_place_at = None


class Traffic:
    """What one robot wants and what it knows of the others; empty until ``connect`` is called.

    Attributes
    ----------
    own : Announcement or None
        Where the robot is and wants to go.
    yields : bool
        Whether it is letting others pass: then it announces where it is, and not where it wants to go.
    asks, held_up : bool
        Whether it waits for others, see ``ask``, or drives up to some and finds no other path: it asks in both cases.
    wished : Path or None
        What the robot would follow, see ``wish``.
    """

    def __init__(self) -> None:
        self.own: Announcement | None = None
        self.yields = False
        self.asks = self.held_up = False
        self.wished: Path | None = None
        self._name = ""
        self._channel: Channel | None = None
        self._meeting: Meeting | None = None
        self._destination: FloatArray | None = None
        self._seen: dict[str, tuple[float, float]] = {}
        """By robot: the stamp of its newest announcement, and when this robot has first seen it, on its own clock."""
        self._lock = threading.Lock()

    def connect(self, name: str, channel: Channel) -> None:
        """Announce under a name of its own, on a channel."""
        self._name, self._channel = name, channel

    @property
    def connected(self) -> bool:
        """Whether the robot announces itself."""
        return self._channel is not None

    def announce(self, announcement: Announcement, destination: FloatArray | None = None) -> None:
        """Publish where the robot is, and look who else has announced something.

        Its name, and all that only this class knows of it, are filled in. ``destination`` (3,) [m] is where the whole
        path ends, if there is one; another one ends a meeting, as what remained is that to another goal.
        """
        if self._is_another(destination):
            self._meeting = None
        now, meeting = announcement.stamp, self._meeting
        if meeting is not None:
            meeting.at(announcement.path[0])
        self._publish(announcement)
        self.others(now)  # their announcements age, also while no plugin asks for them
        if meeting is not None:
            if self.rivals(now, meeting.distance, meeting.length):
                meeting.seen = now
            elif now - meeting.seen > PARTED_AFTER:
                self._meeting = None

    def _is_another(self, destination: FloatArray | None) -> bool:
        """Whether the robot has got another goal; a replanned path may end a little beside the last one."""
        if destination is None:
            return False
        last, self._destination = self._destination, destination
        return last is not None and float(norm(destination - last)) > ANOTHER_GOAL

    def _publish(self, announcement: Announcement) -> None:
        if self._channel is None:
            return
        asks, wishes = self.asks or self.held_up, self.wished is not None
        own = replace(announcement, name=self._name, asks=asks, wishes=wishes)
        meeting = self._meeting
        if meeting is not None and own.remaining > 0.0:  # one that has arrived has nothing left
            own = replace(own, remaining=meeting.remaining, cannot_yield=meeting.cannot_yield, waits=meeting.waits)
        self.own = own
        self._channel.publish(replace(own, path=own.path[:1]) if self.yields else own)

    def wish(self, path: Path | None) -> None:
        """Announce at once the path that a robot without one would follow if the others left; None = none any more.

        It counts as a path for everybody, until the robot follows another one or its goal is over.
        """
        before, self.wished, own = self.wished, path, self.own
        if own is None or path is before:
            return
        place = own.path[:1]
        if path is None:
            self._publish(replace(own, path=place, remaining=0.0))
            return
        if self._is_another(path.positions[-1]):
            self._meeting = None
        own = replace(own, path=np.concatenate([place, path.positions]), makes_room=False, cannot_yield=False)
        self._publish(replace(own, remaining=round(own.length, DIGITS)))

    # ----------------------------------------------------------------------------------------------- a meeting
    def meet(self, now: float, distance: float, length: float) -> tuple[Announcement, ...]:
        """Return the ``rivals``; from the first of them on the robot keeps its rank until they have parted."""
        rivals, own = self.rivals(now, distance, length), self.own
        if rivals and self._meeting is None and own is not None:
            self._meeting = Meeting(distance, length, now, own.remaining)
        return rivals

    def set_cannot_yield(self, cannot_yield: bool) -> None:
        """Announce for the present meeting whether there is a place to let the others pass."""
        meeting, own = self._meeting, self.own  # the announcing thread may end the meeting
        if meeting is not None and own is not None:
            meeting.no_place_at = own.path[0] if cannot_yield else None
            self._publish(own)

    def wait_was_in_vain(self, rivals: Sequence[Announcement]) -> None:
        """Let the rivals go first from now on, because waiting for them does not help."""
        meeting, own = self._meeting, self.own
        if meeting is not None and own is not None:
            meeting.no_place_at = None
            meeting.waits = 1 + max((rival.waits for rival in rivals), default=0)
            self._publish(own)

    def ask(self, asks: bool) -> None:
        """Announce whether this robot waits for those that stand in its way without a goal, while it does not drive."""
        self.asks, own = asks, self.own
        if own is not None:
            self._publish(own)

    def others(self, now: float) -> tuple[Announcement, ...]:
        """Return what the other robots have announced lately, in the order of their names; ``now`` [s] is own time.

        Their stamps are of other clocks: an announcement is as old as the time for which this robot has known it.
        """
        with self._lock:
            latest = () if self._channel is None else self._channel.latest()
            self._seen = {one.name: self._first_seen(one, now) for one in latest}
            heard = {name for name, (_, first_seen) in self._seen.items() if now - first_seen <= MAX_AGE}
        return tuple(one for one in latest if one.name in heard - {self._name})

    def _first_seen(self, announcement: Announcement, now: float) -> tuple[float, float]:
        seen = self._seen.get(announcement.name)
        return seen if seen is not None and seen[0] == announcement.stamp else (announcement.stamp, now)

    def rivals(self, now: float, distance: float, length: float) -> tuple[Announcement, ...]:
        """Robots that go somewhere, whose path conflicts with this robot's, and that face it; those that make room.

        One that follows this robot, or drives on before it, is no rival. Of those without a goal the ones that stand
        in the way and can make room are; those of a robot that makes room itself are the ones that ask it to.

        Parameters
        ----------
        now : float
            [s]
        distance, length : float
            Their paths come nearer than ``distance`` [m] over the next ``length`` [m] of both; for a robot that
            announces another distance, nearer than ``distance_between`` says. Where one of two wishes, it is over all
            that they announce: it has seen the other one from afar, and does not come nearer.
        """
        own = self.own
        if own is None:
            return ()
        others = self.others(now)
        return tuple(other for other in others if is_rival(own, other, distance_between(distance, other), length))
