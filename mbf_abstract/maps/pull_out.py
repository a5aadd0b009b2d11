"""Where a robot can leave its path and let others pass, and the shortest manoeuvre there; for any map.

When to use: in a recovery that makes room, such as ``give_way``. When not: obstacles that stay where they are.

Paths are given in the plane of the robot at its pose ``begin``: on a slope their distances are those along the ground.
Places of a manoeuvre lie on the ground near that plane, so another robot's path farther than ``STOREY`` above or below
it leads over another storey and need not be kept free.

A manoeuvre is driven with small errors, and may end a little before its place. So the search first asks for ``ROOM``
around the outline and for a place ``AT_EASE`` farther from the paths than it must be; if there is none, for no room and
``SHORT``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import FloatArray, Pose
from mbf_abstract.geometry.arithmetic import norm, rotated_back
from mbf_abstract.geometry.transform import Transform
from mbf_abstract.maps.kernels.steps import distances_from_points
from mbf_abstract.maps.manoeuvres import CHECKED_EVERY, Step, find_manoeuvre
from mbf_abstract.maps.navigation_map import NavigationMap
from mbf_abstract.maps.queries import PADDED, CellState, Fit, PlaceQuery, on_map
from mbf_abstract.maps.tracking.objects import Motion, TrackedObject
from mbf_abstract.traffic.right_of_way import STOREY

BoolArray = NDArray[np.bool_]

TOUCHES, OFF_PATHS, FREE = map(int, Fit)  # numpy compares plain numbers in a tenth of the time

PATH_SPACING = 0.1  # m
ROOM = 0.05  # m
AT_EASE, SHORT = 0.1, 0.05  # m
LEAVING = 0.3  # m around a robot that touches something, or nearly does
BETWEEN = 0.5 * CHECKED_EVERY  # m before and behind a pose at the edge of free ground
NEAREST_WITHIN = 2.0  # m
MEETING = 3.0  # m; who is farther away is not whom the robot makes room for


def find_pull_out(
    navigation_map: NavigationMap,
    start: Pose,
    keep_free: FloatArray,
    distance: float,
    reach: float,
    turning_radius: float = 0.0,
    is_canceled: Callable[[], bool] = lambda: False,
) -> list[Step] | None:
    """Find the shortest manoeuvre from ``start`` to a place beside the paths that must stay free.

    Parameters
    ----------
    navigation_map : NavigationMap
        The robot's outline with its padding touches nothing of it.
    start : Pose
        Of the robot, in the frame of the map.
    keep_free : (n, 2) float64
        Points [m] of those paths in the plane of the robot, x ahead, y to the left; see ``paths_to_keep_free``.
    distance : float
        How far [m] the robot's base stands from all of it, at least.
    reach, turning_radius, is_canceled
        As of ``find_manoeuvre``.

    Returns
    -------
    list of Step or None
        None if there is no such place, or it was canceled.
    """
    for room, farther in ((ROOM, AT_EASE), (0.0, SHORT)):
        are_free = _Freedom(navigation_map, start, room).are_free

        def left(poses: FloatArray, wanted: float = distance + farther) -> FloatArray:
            return np.asarray(np.maximum(wanted - distances_from_points(keep_free, poses), 0.0))

        steps = find_manoeuvre(are_free, left, reach, turning_radius, is_canceled)
        if steps is not None:
            return steps
    return None


class _Freedom:
    """Where the robot, with ``room`` [m] around it, may stand in its own plane at ``start``.

    Where it touches something it is let out, to where it is no nearer to what it touches. Where something is only
    within the room, it is let out through poses at which it touches nothing: the distance of its base from a wall does
    not say whether its outline fits with another heading. Ground on which ``obstacle_on_path`` stops it is no way, so
    that what is found can be driven; a robot that stands on such ground is let out over what costs no more.
    """

    def __init__(self, navigation_map: NavigationMap, start: Pose, room: float) -> None:
        self._map, self._room = navigation_map, room
        self._frame = Transform(start.position, start.orientation, start.frame_id, "begin")
        roomy = PlaceQuery(use_padded_footprint=True, safety_dist=room)
        self._outline, self._way = navigation_map.pose_check(PADDED), navigation_map.path_check(PADDED)
        self._fit = navigation_map.plane_check(roomy, self._frame)
        self._roomy_way = navigation_map.path_check(roomy)
        self._stands_on = self._roomy_way(start)
        self._plans_by_outline = type(navigation_map).path_check is NavigationMap.path_check
        self._is_near = navigation_map.pose_check(roomy)(start).state > CellState.INSCRIBED
        self._least_gap = _gap(navigation_map, start) if self._is_near else math.inf

    def are_free(self, poses: FloatArray) -> BoolArray:
        """Whether it may stand (n,) at poses (n, 3)."""
        fit = self._fit(poses)
        free: BoolArray = fit == FREE
        if self._is_near:
            for index in np.flatnonzero(fit == TOUCHES).tolist():
                free[index] = self._may_leave(poses[index])
        if self._stands_on.state > CellState.INSCRIBED:
            for index in np.flatnonzero(fit == OFF_PATHS).tolist():
                free[index] = self._may_cross(poses[index])
        return free

    def _may_leave(self, pose: FloatArray) -> bool:
        """Whether it may stand where something is within its room, as it leaves."""
        there = self._at(pose)
        if math.hypot(*pose[:2].tolist()) > LEAVING or _gap(self._map, there) < self._least_gap:
            return False
        if self._room == 0.0 or self._outline(there).state > CellState.INSCRIBED:
            return self._room == 0.0
        is_way = self._plans_by_outline or self._roomy_way(there).state <= CellState.INSCRIBED
        return is_way or self._may_cross(pose)

    def _may_cross(self, pose: FloatArray) -> bool:
        """Whether it may drive over ground without room, as it leaves such ground: if only nothing stops it there."""
        if self._stands_on.state <= CellState.INSCRIBED or math.hypot(*pose[:2].tolist()) > LEAVING:
            return False
        if self._room == 0.0:
            return self._roomy_way(self._at(pose)).cost <= self._stands_on.cost
        ahead = BETWEEN * np.array([math.cos(pose[2]), math.sin(pose[2]), 0.0])
        return all(self._way(self._at(one)).state <= CellState.INSCRIBED for one in (pose, pose + ahead, pose - ahead))

    def _at(self, pose: FloatArray) -> Pose:
        x, y, yaw = pose.tolist()
        return on_map(self._frame, (x, y, yaw))


def _gap(navigation_map: NavigationMap, pose: Pose) -> float:
    """Distance [m] of the nearest obstacle; inf if it is far away."""
    offset = navigation_map.nearest_obstacle(pose, NEAREST_WITHIN)
    return math.inf if offset is None else math.hypot(*offset)


def paths_to_keep_free(begin: Pose, track: FloatArray, paths: Sequence[FloatArray], length: float) -> FloatArray:
    """Return what a robot must leave free, in its plane: its own path, and those of others on its storey.

    Parameters
    ----------
    begin : Pose
        Of the robot.
    track : (n, 3) float64
        Where it has driven [m], oldest first. Its own path is this, straight on behind it, and straight ahead.
    paths : sequence of (n, 3) float64
        Where others go [m], in the frame of ``begin``.
    length : float
        How far [m] to go back and straight on.

    Returns
    -------
    (n, 2) float64
        Points [m], x ahead, y to the left.
    """
    on = np.arange(0.0, length, PATH_SPACING)[:, None]
    behind = np.concatenate([np.zeros((1, 2)), _on_storey(begin, track[::-1])])
    driven = np.concatenate([[0.0], np.cumsum(norm(np.diff(behind, axis=0)))])
    behind = behind[driven <= length]
    older = behind[norm(behind - behind[-1]) > PATH_SPACING]
    back = behind[-1] - older[-1] if len(older) else np.array([-1.0, 0.0])
    others = paths_on_storey(begin, paths)
    return np.concatenate([on * (1.0, 0.0), behind, behind[-1] + on * back / norm(back), others])


def paths_on_storey(begin: Pose, paths: Sequence[FloatArray]) -> FloatArray:
    """Points (n, 2) [m] in the plane of a robot at ``begin``, of those of paths (m, 3) that are on its storey."""
    return np.concatenate([np.zeros((0, 2)), *(_on_storey(begin, path) for path in paths)])


def in_plane_of(begin: Pose, other: Pose, points: FloatArray) -> FloatArray:
    """Points (n, 2) [m] in the plane of ``other`` as seen from ``begin``: x ahead, y to the left."""
    if begin == other:
        return points
    frame = Transform(other.position, other.orientation, other.frame_id, "other")
    on_map = frame.apply(np.column_stack([points, np.zeros(len(points))]))
    return _on_storey(begin, on_map)


def paths_beside(
    start: Pose, own: FloatArray, known: Iterable[TrackedObject], distance: float, same_storey: float
) -> Iterator[FloatArray]:
    """Yield what to keep free, the best first: with the paths of those who are tracked near the own one, then without.

    Who blocks the robot is taken to go parallel to the robot's path, through where it is now; on the path alone the
    robot would stand beside its own path and in front of the other one.

    Parameters
    ----------
    start : Pose
        Of the robot, in the frame of the objects.
    own : (n, 2) float64
        Of ``paths_to_keep_free`` [m].
    known : iterable of TrackedObject
    distance : float
        Who is nearer to the own path than twice this [m], and less than ``MEETING`` ahead, counts; who is parked does
        not.
    same_storey : float
        Who is farther above or below [m] does not count.
    """
    beside = []
    for one in known:
        x, y, z = rotated_back(start.rotation, np.subtract((one.x, one.y, one.z), start.position)).tolist()
        near = math.hypot(x, y) < MEETING and float(norm(own - (x, y)).min()) < 2.0 * distance
        if near and abs(z) < same_storey and one.motion is not Motion.PARKED:
            beside.append(own + np.array([0.0, y]))
    if beside:
        yield np.concatenate([own, *beside])
    yield own


def _on_storey(begin: Pose, points: FloatArray) -> FloatArray:
    """Those of points (n, 3) [m] that are near the plane of the robot, as points (m, 2) in it."""
    seen = rotated_back(begin.rotation, points - np.asarray(begin.position))
    return np.asarray(seen[np.abs(seen[:, 2]) <= STOREY, :2])
