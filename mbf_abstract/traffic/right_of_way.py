"""Which of two robots goes first where only one can pass, by a rule that both compute from their announcements.

First goes the one that cannot yield; of two that can, or two that cannot, the one that has waited in vain less often;
of two that have waited equally often, the one with the shorter path to its goal; of two equally long paths, that of the
robot whose name comes first. One that stands without a goal and makes room comes after all of these. The ranks of all
robots are in one order, so of any number of robots whose paths conflict exactly one may go before all others, and they
never wait for each other in a circle. The rule of the road, right before left, would let four robots at a crossing wait
for ever.

While robots meet, each announces the length that was left when they met. So the decision lasts, also where the one that
yields drives forward, or the other one plans a detour. Only a wait in vain, or a robot that cannot yield, changes it.
"""

from __future__ import annotations

import math

import numpy as np

from mbf_abstract.geometry.arithmetic import norm
from mbf_abstract.traffic.announcement import Announcement

MEETING_LENGTH = 5.0
"""How far along its path [m] a robot is blocked by others: about as far as it sees them."""
STOREY = 1.0
"""Paths that are farther [m] than this above each other lead over different storeys."""


def right_of_way(mine: Announcement, other: Announcement) -> bool:
    """Whether the robot of ``mine`` goes before the other one.

    Of ``right_of_way(a, b)`` and ``right_of_way(b, a)`` exactly one is true. Raises ValueError for one name.
    """
    if mine.name == other.name:
        raise ValueError(f"two robots announce the name {mine.name!r}")
    return _rank(mine) < _rank(other)


def _rank(robot: Announcement) -> tuple[bool, bool, int, float, str]:
    return robot.makes_room, not robot.cannot_yield, robot.waits, robot.remaining, robot.name


def distance_between(own: float, other: Announcement) -> float:
    """How near the paths of two robots come that meet [m]: the mean of what both keep among robots like themselves.

    So both compute the same, whatever their sizes. ``own`` [m] is that of one of them; it counts alone where the other
    one announces none.
    """
    return 0.5 * (own + other.distance) if other.distance > 0.0 else own


def paths_conflict(mine: Announcement, other: Announcement, distance: float, length: float) -> bool:
    """Whether the paths of two robots over the next ``length`` [m] come nearer than ``distance`` [m]; symmetric.

    Where one is more than ``STOREY`` above the other they do not conflict, whatever the distance: a robot on a bridge
    blocks nobody below it.
    """
    offsets = mine.points_ahead(length)[:, None] - other.points_ahead(length)
    return bool(((norm(offsets) < distance) & (np.abs(offsets[..., 2]) <= STOREY)).any())


def face_each_other(mine: Announcement, other: Announcement, length: float) -> bool:
    """Whether each of two robots is ahead on the next ``length`` [m] of the other's path.

    So neither follows the other, and they have not passed each other. Of one that announces no path, because it lets
    others pass, only its place counts.
    """
    return _is_ahead(other, mine, length) and (len(other.path) == 1 or _is_ahead(mine, other, length))


def stands_in_the_way(standing: Announcement, traveller: Announcement, distance: float) -> bool:
    """Whether a robot without a goal stands ahead of another, nearer to its path than ``distance`` [m].

    Both compute it: the traveller, to know whom it may wait for, and the one that stands, to know that it is asked.
    How far the traveller looks is ``MEETING_LENGTH`` for both; one without a path does not come nearer, and looks as
    far as it announces.
    """
    length = math.inf if traveller.wishes else MEETING_LENGTH
    return paths_conflict(standing, traveller, distance, length) and _is_ahead(standing, traveller, length)


def _is_ahead(robot: Announcement, traveller: Announcement, length: float) -> bool:
    """Whether a robot is nearer to a later point of the traveller's path than to where the traveller is."""
    return int(np.argmin(norm(traveller.points_ahead(length) - robot.path[0]))) > 0


def is_rival(own: Announcement, other: Announcement, distance: float, length: float) -> bool:
    """Whether another robot is one of ``Traffic.rivals``, where they meet nearer than ``distance`` [m]."""
    if own.makes_room:
        return other.asks and stands_in_the_way(own, other, distance)
    if other.makes_room:
        return not other.cannot_yield and stands_in_the_way(other, own, distance)
    ahead = math.inf if own.wishes or other.wishes else length
    meets = other.remaining > 0.0 and paths_conflict(own, other, distance, ahead)
    return meets and face_each_other(own, other, ahead)
