"""Where on its path a robot has hardly any room to either side: there it must be driven closely along the path.

When to use: in controllers that steer to a point ahead, or sample motions. Both cut the curve before a gap, and a robot
that stands in the mouth of a gap beside its path can neither turn nor go on. When not: along one wall; a robot has room
to the other side there. Nor where something stands on the path; samples lead around it.

Rule: a place is tight where the outline fits on the path, but has less than twice ``ROOM`` to move sideways in all; so
is a cusp where the robot cannot turn, as a manoeuvre fits only as it was planned. Controllers keep to the path from
``REACH`` before such a place on, and closely from ``CLOSE_FROM`` on, so that the robot has come onto its path where the
gap begins; ``speed_before`` says how fast it may be before that. The end of a path is no tight place, as many a goal
lies beside a wall; but it is one once the way to the point ahead was blocked so near before it.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from mbf_abstract.execution.path_tracker import PathTracker
from mbf_abstract.geometry import Command, FloatArray, Pose, Twist
from mbf_abstract.geometry.arithmetic import arctan2
from mbf_abstract.maps.controllers.room_to_turn import CREEPING, SMALL_TURN
from mbf_abstract.maps.map_plugin import MapPlugin
from mbf_abstract.maps.queries import CellState, PlaceQuery

ROOM = 0.05
"""Room [m] to either side that a controller needs which does not drive closely."""
REACH = 1.5
"""So far [m] ahead on the path it is looked at."""
CLOSE_FROM = 1.0
"""So far [m] before a tight place the robot is driven closely."""
SPACING, ARM = 0.1, 0.2
"""Distance [m] of the poses looked at; each looks along the line between the points ``ARM`` before and behind it."""
HEADINGS = np.arange(16) * (math.pi / 8.0)
"""Where the outline fits with all of these [rad], the robot can turn."""
CLOSELY = 0.005
"""So near [m] a robot that is driven closely comes to a cusp: a curve that ends too early cannot be made up for."""
SLIGHT_TURN = 0.005
"""By less than this [rad] a robot that is driven closely does not turn on the spot."""
KEPT = 0.05
"""An answer holds until the robot has come so far [m] on its path, or nearer to it."""
BESIDE = 0.2
"""What a robot is farther off its path [m] it has to drive before it comes to a tight place."""

Fits = Callable[[float, float, float], bool]
"""Whether the outline touches nothing at a pose (x, y [m], yaw [rad])."""


class TightPlaces:
    """What lies ahead on one path."""

    def __init__(self) -> None:
        self._asked_at = (-math.inf, 0.0)  # progress and deviation [m]
        self._next = math.inf
        self._close_until = -math.inf
        self._close_beside = 0.0  # deviation [m] with which that was noted

    def shifted(self, shift: float, tracker: PathTracker) -> TightPlaces:
        """Return those of a path on which lengths [m] have grown by ``shift``; what lies ahead is looked at anew.

        That the rest of the path is driven closely holds for a path that ends as near.
        """
        moved = TightPlaces()
        if self._close_until < math.inf or _ends_near(tracker):
            moved._close_until, moved._close_beside = self._close_until + shift, self._close_beside
        return moved

    def distance(self, tracker: PathTracker, reverses: bool, fits: Fits, reach: float = REACH) -> float:
        """Length [m] to drive to the next tight place, whatever cusps lie between; inf = none within ``reach``.

        A robot that comes back to its path, from where it let somebody pass, need not creep from there.

        Parameters
        ----------
        reverses : bool
            Whether the robot drives backward where the poses of the path look against its direction.
        reach : float
            [m] More than ``REACH`` for a robot that needs more to brake before it is driven closely.
        """
        if self.is_close(tracker):
            return 0.0
        progress, deviation = self._asked_at
        if tracker.progress - progress >= KEPT or abs(tracker.deviation - deviation) >= KEPT:
            self._asked_at = tracker.progress, tracker.deviation
            lengths = np.arange(tracker.progress, min(tracker.progress + reach, tracker.length), SPACING)
            poses = _poses_at(tracker, lengths, reverses).tolist()
            first = next((k for k, (x, y, yaw) in enumerate(poses) if not has_room(x, y, yaw, fits)), None)
            is_tight = first is not None and (fits(*poses[first]) or _fits_as_planned(tracker, lengths[first], fits))
            gap = float(lengths[first]) if is_tight else math.inf
            self._next = min(gap, _next_cusp(tracker, fits, reach))
        return max(self._next - tracker.progress, 0.0) + max(tracker.deviation - BESIDE, 0.0)

    def drives_otherwise(self, tracker: PathTracker, wanted: Twist, command: Command | None) -> bool:
        """Take note of what is driven instead of a wanted motion; whether the motions are to be chosen anew, closely.

        Near its end a path that is not free to be cut may be free with its own headings only. And a robot that turns
        to its path on the spot must not turn back to a point farther ahead, before it has come on.
        """
        if not isinstance(command, Twist) or command == wanted:
            return False
        if command.vx == 0.0:
            if command.wz != 0.0:
                self._drive_closely_until(tracker, max(self._close_until, tracker.progress + KEPT))
            return False
        near_end = wanted.vx != 0.0 and _ends_near(tracker)
        is_new = near_end and self._close_until < math.inf
        if is_new:
            self._drive_closely_until(tracker, math.inf)
        return is_new

    def _drive_closely_until(self, tracker: PathTracker, length: float) -> None:
        self._close_until, self._close_beside = length, tracker.deviation

    def is_close(self, tracker: PathTracker) -> bool:
        """Whether a robot on the path, or beside it, keeps to it closely for what it drove before, near there."""
        return tracker.progress < self._close_until and abs(tracker.deviation - self._close_beside) < BESIDE

    @staticmethod
    def begin_next_stroke(tracker: PathTracker) -> bool:
        """Where the way is blocked, go on to the next stroke of a manoeuvre; whether the robot is near enough to it.

        A stroke that is driven closely may end a few millimetres before a wall, too near for a robot that is a little
        beside its path. The last millimetres of the stroke are not needed.
        """
        return is_driven_closely(tracker) and tracker.begin_next_section()


def is_driven_closely(tracker: PathTracker) -> bool:
    """Whether the robot is driven closely along its path in this cycle."""
    return tracker.cusp_reached <= CLOSELY


def least_turn(tracker: PathTracker) -> float:
    """Angle [rad] by which it has to be off a point ahead to turn to it on the spot, where that clears its path.

    Between two walls a corner of a long outline touches one of them with a heading that is a hundredth off.
    """
    return SLIGHT_TURN if is_driven_closely(tracker) else SMALL_TURN


def speed_before(distance: float, deceleration: float) -> float:
    """Speed [m/s] of a robot ``distance`` [m] before a tight place that creeps where it is to be driven closely."""
    return math.sqrt(CREEPING**2 + 2.0 * deceleration * max(distance - CLOSE_FROM, 0.0))


def _poses_at(tracker: PathTracker, lengths: FloatArray, reverses: bool) -> FloatArray:
    """Poses (n, 3: x, y [m], yaw [rad]) at lengths (n,) [m] along a path, each with the heading of its stroke."""
    strokes = np.searchsorted(tracker.cusps, lengths, side="right")
    begins, ends = np.append(0.0, tracker.cusps)[strokes], np.append(tracker.cusps, tracker.length)[strokes]
    steps = tracker.points_at(np.minimum(lengths + ARM, ends)) - tracker.points_at(np.maximum(lengths - ARM, begins))
    yaws = arctan2(steps[:, 1], steps[:, 0])
    if reverses and len(tracker.reverse):
        segments = np.searchsorted(tracker.lengths, lengths, side="right") - 1
        yaws += np.where(tracker.reverse[np.minimum(segments, len(tracker.reverse) - 1)], math.pi, 0.0)
    return np.column_stack([tracker.points_at(lengths)[:, :2], yaws])


def _ends_near(tracker: PathTracker) -> bool:
    """Whether a path has no cusp any more, and ends so near that it may be driven closely to its end."""
    return tracker.on_last_section and tracker.remaining <= CLOSE_FROM


def _next_cusp(tracker: PathTracker, fits: Fits, reach: float) -> float:
    """Length [m] of the next cusp within ``reach`` [m] at which the robot cannot turn, but for the end; inf = none."""
    cusps: list[float] = tracker.cusps[:-1].tolist()
    for cusp in cusps:
        if tracker.progress <= cusp <= tracker.progress + reach:
            x, y = tracker.point_at(cusp)[:2].tolist()
            if not all(fits(x, y, yaw) for yaw in HEADINGS.tolist()):
                return cusp
    return math.inf


def _fits_as_planned(tracker: PathTracker, length: float, fits: Fits) -> bool:
    """Whether the outline fits with the heading of the pose at ``length`` [m]; near a bend the chord has another."""
    nearest = int(np.argmin(np.abs(tracker.lengths - length)))
    if abs(tracker.lengths[nearest] - length) > SPACING:
        return False
    pose = tracker.path[nearest]
    return fits(pose.x, pose.y, pose.yaw)


def has_room(x: float, y: float, yaw: float, fits: Fits) -> bool:
    """Whether a robot at a pose (x, y [m], yaw [rad]) could as well stand up to twice ``ROOM`` to the left or right.

    That is, from ``ROOM`` on one side to ``ROOM`` on the other, or all of it on one side.
    """
    side_x, side_y = -ROOM * math.sin(yaw), ROOM * math.cos(yaw)

    def fits_beside(rooms: float) -> bool:
        return fits(x + rooms * side_x, y + rooms * side_y, yaw)

    left, right = fits_beside(1.0), fits_beside(-1.0)
    return (left and right) or (left and fits_beside(2.0)) or (right and fits_beside(-2.0))


def cannot_turn_ahead(tracker: PathTracker, reach: float, fits: Callable[[FloatArray], bool]) -> bool:
    """Whether the robot stops or reverses within ``reach`` [m] where it cannot turn.

    Parameters
    ----------
    fits : callable
        Whether the outline touches nothing at poses (n, 3: x, y [m], yaw [rad]).
    """
    near = (tracker.cusps >= tracker.progress) & (tracker.cusps <= tracker.progress + reach)
    if not near.any():
        return False
    for x, y in tracker.points_at(tracker.cusps[near])[:, :2].tolist():
        if not fits(np.column_stack([np.full(len(HEADINGS), x), np.full(len(HEADINGS), y), HEADINGS])):
            return True
    return False


def outline_fits(plugin: MapPlugin, near: Pose, query: PlaceQuery) -> Fits:
    """The question to a plugin's map, for poses at the height and in the frame of the pose ``near``."""
    check = plugin.navigation_map.path_check(query)

    def fits(x: float, y: float, yaw: float) -> bool:
        place = Pose.planar(x, y, yaw, near.z, near.frame_id, near.stamp)
        return check(plugin.on_map(place)).state is not CellState.LETHAL

    return fits
