"""Making room to turn: what a controller drives where its own motion would swing the outline into something.

When to use: in controllers that look ahead with the robot's whole outline. A long robot beside a wall can drive, but
not turn; it has to drive on until its corners pass. When not: round robots, which can always turn, and turning to what
lies ``BEHIND``: the planner's manoeuvres or the map's recoveries (``back_up``, ``move_away``) make room for that. What
stands on the path itself blocks all of it.

Rule: where the wanted motion is blocked but the outline fits on the path ahead, the robot creeps close along the path,
or turns on the spot to a point close ahead on it. Else wider and wider curves to the same side are tried, then going
straight on; instead of a turn on the spot to what lies ahead or abeam, creeping along such curves. In all this the
robot may drive ``distance`` [m], and turn once round, until it gets ahead on its path again.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from copy import copy

import numpy as np

from mbf_abstract.execution.path_tracker import PathTracker
from mbf_abstract.geometry import FloatArray, Pose, Twist, normalize_angle
from mbf_abstract.geometry.arcs import arc_to
from mbf_abstract.geometry.arithmetic import arctan2

AHEAD = 0.05  # m of progress on the path that give back the whole distance, and all turns
ROUND = 2.0 * math.pi  # rad; who has turned so far has faced every direction
CREEPING = 0.1  # m/s
NEAR = (0.2, 0.1)
"""How far [m] ahead on the path the points lie that a robot creeps to where its usual look-ahead is blocked."""
CLOSE = (0.1, 0.05, 0.2)
"""How far [m] ahead they lie in a tight place; a manoeuvre may have millimetres to spare, which 0.1 m ahead cuts."""
LOOKS_ALONG = 0.25 * math.pi
"""At most so far [rad] off the path's direction a robot creeps along it."""
SMALL_TURN = 0.05
"""By less than this [rad] no robot turns on the spot to clear its path."""
SPACING, ARM = 0.05, 0.2
"""Distance [m] of the poses on a path; each looks along the line between the points ``ARM`` before and behind it."""
WIDER = (0.5, 0.25, 0.0)
"""Shares of the wanted turn, tried in this order."""
BEHIND = 0.75 * math.pi
"""What lies farther off the driving direction [rad] is behind: no room is made for a turn to it.

A robot that creeps past the point it wants to turn to would otherwise stand where that lies exactly abeam.
"""
CURVES = (2.0, 1.0, 0.5, 0.0)
"""Curvatures [1/m] tried instead of a turn on the spot, in this order."""


TurnRate = Callable[[float, float], float]
"""The yaw rate [rad/s] at which a robot begins a turn by an angle [rad], of the one that is wanted."""


def at_once(rate: float, angle: float) -> float:
    """That of a robot that stops turning at once: the wanted one."""
    return rate


class RoomToTurn:
    """The choice of a controller, and how far it has driven and turned to make room."""

    def __init__(self) -> None:
        self._driven = self._turned = 0.0
        self._furthest = -math.inf
        self._made_room_at: Pose | None = None

    def shifted(self, shift: float) -> RoomToTurn:
        """Return the same where lengths [m] along the path have grown by ``shift``."""
        moved = copy(self)
        moved._furthest += shift
        return moved

    def choose(
        self,
        pose: Pose,
        progress: float,
        motions: list[Twist],
        distance: float,
        blocked: Callable[[Twist], str],
        along: Callable[[], list[Twist]] = list,
    ) -> tuple[Twist | None, str]:
        """Return the first motion that is free, or None and what blocks the first of all.

        Parameters
        ----------
        pose : Pose
            Of the robot now.
        progress : float
            How far [m] it is along its path.
        motions : list of Twist
            The wanted one, then those that make room for it, see ``wider_curves`` and ``curves_ahead``.
        distance : float
            How far [m] it may drive to make room; 0 = never.
        blocked : callable
            What the robot would touch along a motion, as a text; empty if nothing.
        along : callable
            Motions that keep to the path, tried before the others; see ``along_path``.
        """
        self._count_distance(pose, progress)
        wanted, *others = motions
        reason = blocked(wanted)
        if not reason:
            return wanted, ""
        if distance == 0.0:
            return None, reason
        others = [*along(), *others]
        if others and self._driven >= distance:
            return None, f"{reason}; after {self._driven:.2f} m of driving on there is still no room to turn"
        if others and self._turned >= ROUND:
            return None, f"{reason}; after turning by {self._turned:.1f} rad in all nothing is free"
        motion = next((motion for motion in others if not blocked(motion)), None)
        if motion is None:
            return None, reason
        self._made_room_at = pose
        return motion, ""

    def _count_distance(self, pose: Pose, progress: float) -> None:
        if self._made_room_at is not None:
            self._driven += self._made_room_at.distance_to(pose)
            self._turned += abs(normalize_angle(pose.yaw - self._made_room_at.yaw))
            self._made_room_at = None
        if progress > self._furthest + AHEAD:
            self._furthest, self._driven, self._turned = progress, 0.0, 0.0


def wider_curves(wanted: Twist) -> list[Twist]:
    """A motion that drives, then along wider curves, and straight on; a straight one alone."""
    if wanted.wz == 0.0:
        return [wanted]
    return [wanted, *(Twist.planar(wanted.vx, wanted.vy, share * wanted.wz) for share in WIDER)]


def curves_ahead(turn: Twist, bearing: float, backward: bool = False) -> list[Twist]:
    """A turn on the spot to ``bearing`` [rad] of the driving direction; then, unless to behind, creeping."""
    if abs(bearing) >= BEHIND:
        return [turn]
    speed = -CREEPING if backward else CREEPING
    return [turn, *(Twist.planar(speed, wz=math.copysign(CREEPING * curve, turn.wz)) for curve in CURVES)]


def along_path(
    tracker: PathTracker,
    pose: Pose,
    backward: bool = False,
    distances: Sequence[float] = NEAR,
    *,
    rolls_on: float = 0.0,
    turn_rate: TurnRate = at_once,
) -> list[Twist]:
    """Creeping along arcs to points close ahead on a path seen from above, forward or backward as it is to be driven.

    Where the outline fits on the path (``poses_ahead``) these arcs are free although the one to a point farther ahead,
    which cuts the path's corners, is not. None where the robot does not look along the path.

    Parameters
    ----------
    rolls_on : float
        Length [m] that the robot rolls before it creeps; the points lie so much farther ahead.
    turn_rate : callable
        The yaw rate [rad/s] from which it can stop when it has turned so far [rad], if that is less than a wanted one;
        it creeps more slowly along an arc that turns faster.
    """
    motions = []
    for distance in distances:
        x, y = tracker.carried_on(distance + rolls_on).tolist()
        bearing, curvature = arc_to(pose, np.array([x, y, pose.z]))
        off = off_course(bearing, backward)
        if abs(off) <= LOOKS_ALONG:
            speed = -CREEPING if backward else CREEPING
            turn = turn_rate(speed * curvature, 2.0 * off)
            motions.append(Twist.planar(speed if turn == speed * curvature else turn / curvature, wz=turn))
    return motions


def angle_to_path(tracker: PathTracker, pose: Pose, backward: bool = False, rolls_on: float = 0.0) -> float:
    """Angle [rad] to the nearest of those points; one farther ahead may lie behind a corner."""
    x, y = tracker.carried_on(NEAR[-1] + rolls_on).tolist()
    return off_course(arc_to(pose, np.array([x, y, pose.z]))[0], backward)


def closely_along_path(
    tracker: PathTracker, pose: Pose, backward: bool = False, rolls_on: float = 0.0, turn_rate: TurnRate = at_once
) -> list[Twist]:
    """The same to points of ``CLOSE``, then wider curves than to the first of them."""
    motions = along_path(tracker, pose, backward, CLOSE, rolls_on=rolls_on, turn_rate=turn_rate)
    return [*motions, *wider_curves(motions[0])[1:]] if motions else []


def no_tighter(motion: Twist, radius: float) -> Twist:
    """The same speed on an arc of at least ``radius`` [m]; 0 = any."""
    most = abs(motion.vx) / radius if radius > 0.0 else math.inf
    return Twist.planar(motion.vx, motion.vy, min(max(motion.wz, -most), most))


def off_course(bearing: float, backward: bool) -> float:
    """Angle [rad] from the direction of driving to a bearing in the robot's frame."""
    return normalize_angle(bearing + math.pi) if backward else bearing


def poses_ahead(tracker: PathTracker, distance: float, backward: bool) -> FloatArray:
    """Poses (n, 3: x, y [m], yaw [rad]) of a robot that keeps to its path, up to ``distance`` [m] or the next cusp."""
    last = float(max(tracker.cusps[tracker.cusps <= tracker.progress], default=0.0))
    end = min(tracker.progress + distance, tracker.next_cusp)
    lengths = np.append(np.arange(tracker.progress, end, SPACING), end)
    steps = tracker.points_at(np.minimum(lengths + ARM, tracker.next_cusp)) - tracker.points_at(
        np.maximum(lengths - ARM, last)
    )
    yaws = arctan2(steps[:, 1], steps[:, 0]) + (math.pi if backward else 0.0)
    return np.column_stack([tracker.points_at(lengths)[:, :2], yaws])
