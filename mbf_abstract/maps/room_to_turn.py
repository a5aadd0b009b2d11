"""Making room to turn: what a controller drives where its own motion would swing the outline into something.

When to use: in controllers that look ahead with the robot's whole outline, on paths of planners that know its inscribed
radius only. A long robot beside a wall can drive, but not turn; it has to drive on until its corners pass. When not:
round robots, which can always turn, and turning to what lies behind: the map's recoveries (``back_up``, ``move_away``)
make room for that. What stands on the path itself blocks going straight on, too.

Rule: where the wanted motion is blocked, wider and wider curves to the same side are tried, then going straight on;
instead of a turn on the spot to what lies ahead, creeping along such curves. In this the robot may drive ``distance``
[m] until it gets ahead on its path again.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from mbf_abstract.geometry import Pose, Twist

AHEAD = 0.05  # m of progress on the path that give back the whole distance
CREEPING = 0.1  # m/s
WIDER = (0.5, 0.25, 0.0)
"""Shares of the wanted turn, tried in this order."""
CURVES = (2.0, 1.0, 0.5, 0.0)
"""Curvatures [1/m] tried instead of a turn on the spot, in this order."""


class RoomToTurn:
    """The choice of a controller, and how far it has driven to make room."""

    def __init__(self) -> None:
        self._driven = 0.0
        self._furthest = -math.inf
        self._made_room_at: Pose | None = None

    def choose(
        self, pose: Pose, progress: float, motions: list[Twist], distance: float, blocked: Callable[[Twist], str]
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
        """
        self._count_distance(pose, progress)
        wanted, *others = motions
        reason = blocked(wanted)
        if not reason:
            return wanted, ""
        if others and self._driven >= distance > 0.0:
            return None, f"{reason}; {self._driven:.2f} m of driving on made no room to turn"
        motion = next((motion for motion in others if not blocked(motion)), None) if distance > 0.0 else None
        if motion is None:
            return None, reason
        self._made_room_at = pose
        return motion, ""

    def _count_distance(self, pose: Pose, progress: float) -> None:
        if self._made_room_at is not None:
            self._driven += self._made_room_at.distance_to(pose)
            self._made_room_at = None
        if progress > self._furthest + AHEAD:
            self._furthest, self._driven = progress, 0.0


def wider_curves(wanted: Twist) -> list[Twist]:
    """A motion that drives, then along wider curves, and straight on; a straight one alone."""
    if wanted.wz == 0.0:
        return [wanted]
    return [wanted, *(Twist.planar(wanted.vx, wanted.vy, share * wanted.wz) for share in WIDER)]


def curves_ahead(turn: Twist, bearing: float, backward: bool = False) -> list[Twist]:
    """A turn on the spot to ``bearing`` [rad] of the driving direction; then creeping to that side, if it is ahead."""
    if abs(bearing) >= 0.5 * math.pi:
        return [turn]
    speed = -CREEPING if backward else CREEPING
    return [turn, *(Twist.planar(speed, wz=math.copysign(CREEPING * curve, turn.wz)) for curve in CURVES)]
