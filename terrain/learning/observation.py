"""What a learned controller observes: scan, heights of the ground, goal and plan in the robot's frame, velocity.

Everything comes from what a controller of the navigation has: the estimated pose, the odometry, the plan, the newest
scans and the map. The environment and ``PolicyController`` use the same class.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.execution.path_tracker import PathTracker
from mbf_abstract.geometry import FloatArray, Path, Pose, Twist, normalize_angle
from mbf_abstract.geometry.arithmetic import arctan2, norm, plane_rotation, rotated, rotated_back
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.maps.navigation_map import NavigationMap
from mbf_abstract.maps.sensing import MAX_STAMP_LEAD, RangeScan
from mbf_abstract.parameters import ParameterModel, parameter

Observation = dict[str, NDArray[np.float32]]
Bounds = dict[str, tuple[NDArray[np.float32], NDArray[np.float32]]]

FARTHEST = 100.0  # m; goals and points of the plan are clipped to it
FASTEST = 20.0  # m/s, rad/s
HEADROOM = 1.0  # m above base_link from which the ground below is looked for first: under a ceiling, above a step
SAME_STOREY = 0.5  # m off the robot's plane; a goal that far above or below the ground can be reached
LIMIT_SLACK = 1e-12  # a value exactly at its limit counts as within


class ObservationParameters(ParameterModel):
    """Parts of an observation; a part with the count 0 is left out."""

    scan_sectors: int = parameter(
        36, "Sectors around the robot, in each of which the nearest point that a scan has hit counts.", ge=0, le=720
    )
    scan_range: float = parameter(4.0, "Nothing nearer than this in a sector = this.", unit="m", gt=0.0, le=100.0)
    lowest: float = parameter(0.05, "Points of scans lower than this above base_link do not count.", unit="m")
    highest: float = parameter(1.0, "Points of scans higher than this do not count.", unit="m")
    waypoints: int = parameter(5, "Points of the plan ahead; 0 = no plan is made.", ge=0, le=100)
    waypoint_spacing: float = parameter(0.4, "Distance between them, along the plan.", unit="m", gt=0.0, le=100.0)
    patch_cells: int = parameter(
        0, "Side of a square of heights of the ground; needs a map that knows heights, such as a mesh.", ge=0, le=101
    )
    patch_spacing: float = parameter(0.25, "Distance between two heights.", unit="m", gt=0.0, le=10.0)
    patch_range: float = parameter(
        2.0, "Largest height above or below base_link; missing ground is that far below.", unit="m", gt=0.0, le=100.0
    )

    def bounds(self) -> Bounds:
        """Return the lowest and the highest values of each part, in the order of the parts."""
        found = {"goal": _bounds((-FARTHEST, -FARTHEST, -1.0, -1.0), (FARTHEST, FARTHEST, 1.0, 1.0))}
        found["velocity"] = _bounds((-FASTEST,) * 3, (FASTEST,) * 3)
        if self.scan_sectors:
            found["scan"] = _bounds(np.zeros(self.scan_sectors), np.full(self.scan_sectors, self.scan_range))
        if self.waypoints:
            farthest = np.full((self.waypoints, 2), FARTHEST)
            found["waypoints"] = _bounds(-farthest, farthest)
        if self.patch_cells:
            highest = np.full((self.patch_cells, self.patch_cells), self.patch_range)
            found["patch"] = _bounds(-highest, highest)
        return found


class Observer:
    """Computes observations on the way to one goal.

    On a map that knows no heights the ground is level: plan and goal are seen from above, whatever the pitch of the
    robot and the heights of the plan are.

    Parameters
    ----------
    navigation_map : NavigationMap
        The map the robot drives on.
    scans : mapping of str to RangeScan
        The newest scan of each sensor; it may change while other threads take scans.
    sources : collection of str
        Sensors that are observed, each of which must send scans; empty = all that have sent any.

    Attributes
    ----------
    tracker : PathTracker or None
        The plan and the progress on it; a goal without a plan is a plan of one pose.
    dimensions : {2, 3}
        2 = the ground is level.

    Raises
    ------
    ValueError
        The map knows no heights, and a patch of them is asked for.
    """

    def __init__(
        self,
        parameters: ObservationParameters,
        navigation_map: NavigationMap,
        transforms: TransformBuffer,
        scans: Mapping[str, RangeScan],
        sources: Collection[str] = (),
    ) -> None:
        self.parameters = parameters
        self.tracker: PathTracker | None = None
        self.dimensions = 2 if navigation_map.heights_below(np.zeros((1, 3))) is None else 3
        self._map, self._transforms, self._scans, self._sources = navigation_map, transforms, scans, sources
        self._bounds = parameters.bounds()
        if parameters.patch_cells and self.dimensions == 2:
            name = type(navigation_map).__name__
            raise ValueError(f"patch_cells: expected 0 on a map without heights ({name}), got {parameters.patch_cells}")

    def set_plan(self, path: Path) -> None:
        """Take over a path in the global frame, with at least one pose; its last one is the goal.

        Raises
        ------
        TransformError
            The map is in another frame, and there is no transform.
        """
        self.tracker = PathTracker(path if self.dimensions == 2 else self._ending_on_ground(path), self.dimensions)

    def has_arrived(self, pose: Pose, dist_tolerance: float, angle_tolerance: float) -> bool:
        """Whether the plan has been driven to its end, and ``pose`` is within both tolerances [m, rad] of the end.

        Distances are those in the plane of the robot, unless the goal is on another storey.
        """
        tracker = self._tracked(pose)
        x, y, z = self._in_plane(pose, np.array([tracker.goal.position]))[0].tolist()
        distance = math.hypot(x, y) if abs(z) <= SAME_STOREY else math.hypot(x, y, z)
        turn = abs(normalize_angle(tracker.goal.yaw - pose.yaw))
        near = distance <= dist_tolerance + LIMIT_SLACK and turn <= angle_tolerance + LIMIT_SLACK
        return near and tracker.has_arrived(dist_tolerance)

    def scan_problem(self, now: float, max_age: float) -> str:
        """Why scans are not as new as ``max_age`` [s] asks for; empty if they are, or if none are observed.

        A stamp from the future is no sign of a sensor that works.
        """
        if not self.parameters.scan_sectors:
            return ""
        seen = {scan.source: now - scan.stamp for scan in self._observed_scans()}
        silent = sorted(set(self._sources) - seen.keys())
        if silent or not seen:
            return f"no scan of {', '.join(map(repr, silent)) or 'any sensor'} has come"
        for source, age in sorted(seen.items()):
            if age > max_age:
                return f"the newest scan of {source!r} is {age:.2f} s old"
            if age < -MAX_STAMP_LEAD:
                return f"the newest scan of {source!r} is stamped {-age:.2f} s in the future"
        return ""

    def observe(self, pose: Pose, velocity: Twist) -> Observation:
        """Return the observation of a robot at ``pose`` in the global frame with ``velocity`` in its own.

        Raises
        ------
        TransformError
            A scan or the pose cannot be brought into the frame that is needed.
        """
        p, tracker = self.parameters, self._tracked(pose)
        turn = normalize_angle(tracker.goal.yaw - pose.yaw)
        goal = self._in_plane(pose, np.array([tracker.goal.position]))[0].tolist()
        parts: dict[str, Any] = {
            "goal": (goal[0], goal[1], math.cos(turn), math.sin(turn)),
            "velocity": (velocity.vx, velocity.vy, velocity.wz),
        }
        if p.scan_sectors:
            parts["scan"] = self._sectors(pose)
        if p.waypoints:
            lengths = tracker.progress + p.waypoint_spacing * np.arange(1.0, p.waypoints + 1.0)
            parts["waypoints"] = self._in_plane(pose, tracker.points_at(lengths))[:, :2]
        if p.patch_cells:
            parts["patch"] = self._patch(pose)
        return {name: np.clip(np.asarray(part, dtype=np.float32), *self._bounds[name]) for name, part in parts.items()}

    def _tracked(self, pose: Pose) -> PathTracker:
        """The plan, with the progress of a robot at ``pose``."""
        assert self.tracker is not None, "set_plan comes first"
        self.tracker.update(pose.position[: self.dimensions])
        return self.tracker

    def _in_plane(self, pose: Pose, points: FloatArray) -> FloatArray:
        """Points (n, 2 or 3) in the frame of the robot (n, 3); on level ground seen from above, at its height."""
        if self.dimensions == 3:
            return _seen_from(pose, points)
        flat = rotated_back(plane_rotation(pose.yaw), points[:, :2] - (pose.x, pose.y))
        return np.column_stack([flat, np.zeros(len(flat))])

    def _ending_on_ground(self, path: Path) -> Path:
        """Put the last pose of a path onto the ground below or a little above it: no robot drives up to it."""
        goal = path[len(path) - 1]
        there = self._transforms.transform_pose(goal, self._map.frame_id)
        heights = self._map.heights_below(np.array([[there.x, there.y, there.z + SAME_STOREY]]))
        assert heights is not None
        raised = there.z - float(heights[0])
        if not abs(raised) <= SAME_STOREY:  # nothing is below, or another storey
            return path
        end = np.array([[goal.x, goal.y, goal.z - raised]])
        return replace(path, positions=np.concatenate([path.positions[:-1], end]))

    def _observed_scans(self) -> tuple[RangeScan, ...]:
        """The newest scans, at once: other threads add sources."""
        scans = tuple(self._scans.values())
        return tuple(scan for scan in scans if scan.source in self._sources) if self._sources else scans

    def _sectors(self, pose: Pose) -> FloatArray:
        """Distance [m] of the nearest point in each sector, counter-clockwise from straight behind."""
        p = self.parameters
        nearest = np.full(p.scan_sectors, p.scan_range)
        for scan in self._observed_scans():
            points = _seen_from(pose, scan.in_frame(pose.frame_id, self._transforms).points)
            points = points[(points[:, 2] >= p.lowest) & (points[:, 2] <= p.highest)]
            share = (arctan2(points[:, 1], points[:, 0]) + math.pi) / (2.0 * math.pi)
            sectors = np.floor(share * p.scan_sectors).astype(np.intp) % p.scan_sectors
            np.minimum.at(nearest, sectors, norm(points[:, :2]))
        return nearest

    def _patch(self, pose: Pose) -> FloatArray:
        """Heights [m] above base_link; the first index grows ahead, the second to the left.

        Ground above ``HEADROOM``, a wall or a steep ramp, is looked for only where there is none below.
        """
        p = self.parameters
        offsets = p.patch_spacing * (np.arange(p.patch_cells) - 0.5 * (p.patch_cells - 1))
        ahead, left = np.meshgrid(offsets, offsets, indexing="ij")
        there = self._transforms.transform_pose(pose, self._map.frame_id)
        turned = rotated(plane_rotation(there.yaw), np.column_stack([ahead.ravel(), left.ravel()]))
        places = np.column_stack([turned[:, 0] + there.x, turned[:, 1] + there.y])
        near, high = (self._heights(places, there.z, above) for above in (HEADROOM, p.patch_range))
        heights = np.where(near >= -p.patch_range, near, high)
        return np.asarray(np.where(np.isfinite(heights), heights, -p.patch_range).reshape(ahead.shape))

    def _heights(self, places: FloatArray, z: float, above: float) -> FloatArray:
        """Heights (n,) [m] over ``z`` [m] of the first ground at places (n, 2) that is at most so far ``above`` it."""
        heights = self._map.heights_below(np.column_stack([places, np.full(len(places), z + above)]))
        assert heights is not None
        return heights - z


def _bounds(lowest: Any, highest: Any) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    return np.asarray(lowest, dtype=np.float32), np.asarray(highest, dtype=np.float32)


def _seen_from(pose: Pose, points: FloatArray) -> FloatArray:
    """Points (n, 3) of the frame of a pose, in that pose's own."""
    return rotated_back(pose.rotation, points - pose.position)
