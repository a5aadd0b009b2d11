"""What a learned controller observes: scan, heights of the ground, goal and plan in the robot's frame, velocity.

Everything comes from what a controller of the navigation has: the estimated pose, the odometry, the plan, the newest
scans and the map. The environment and ``PolicyController`` use the same class.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.execution.path_tracker import PathTracker
from mbf_abstract.geometry import FloatArray, Path, Pose, Twist, normalize_angle
from mbf_abstract.geometry.arithmetic import arctan2, norm, plane_rotation, rotated, rotated_back
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.maps.navigation_map import MapPlugin, NavigationMap
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.parameters import ParameterModel, parameter

Observation = dict[str, NDArray[np.float32]]
Bounds = dict[str, tuple[NDArray[np.float32], NDArray[np.float32]]]

FARTHEST = 100.0  # m; goals and points of the plan are clipped to it
FASTEST = 20.0  # m/s, rad/s
HEADROOM = 1.0  # m above base_link from which the ground below is looked for: under a ceiling, above a step


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

    Parameters
    ----------
    parameters : ObservationParameters
    navigation_map : NavigationMap
        The map the robot drives on.
    transforms : TransformBuffer
    scans : mapping of str to RangeScan
        The newest scan of each sensor.

    Attributes
    ----------
    tracker : PathTracker or None
        The plan and the progress on it; a goal without a plan is a plan of one pose.

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
    ) -> None:
        self.parameters = parameters
        self.tracker: PathTracker | None = None
        self._map, self._transforms, self._scans = navigation_map, transforms, scans
        self._bounds = parameters.bounds()
        if parameters.patch_cells and navigation_map.heights_below(np.zeros((1, 3))) is None:
            name = type(navigation_map).__name__
            raise ValueError(f"patch_cells: expected 0 on a map without heights ({name}), got {parameters.patch_cells}")

    @classmethod
    def of_plugin(cls, parameters: ObservationParameters, plugin: MapPlugin) -> Observer:
        """Observe what a plugin has."""
        return cls(parameters, plugin.navigation_map, plugin.transforms, plugin.scans)

    def set_plan(self, path: Path) -> None:
        """Take over a path in the global frame, with at least one pose; its last one is the goal."""
        self.tracker = PathTracker(path)

    def scan_age(self, now: float) -> float:
        """Age [s] of the oldest of the newest scans of all sensors; 0 if none are observed, inf without any scan."""
        if not self.parameters.scan_sectors:
            return 0.0
        return max((now - scan.stamp for scan in self._scans.values()), default=math.inf)

    def observe(self, pose: Pose, velocity: Twist) -> Observation:
        """Return the observation of a robot at ``pose`` in the global frame with ``velocity`` in its own.

        Raises
        ------
        TransformError
            A scan or the pose cannot be brought into the frame that is needed.
        """
        p, tracker = self.parameters, self.tracker
        assert tracker is not None, "set_plan comes first"
        tracker.update(pose.position)
        turn = normalize_angle(tracker.goal.yaw - pose.yaw)
        goal = _seen_from(pose, np.array([tracker.goal.position]))[0].tolist()
        parts: dict[str, Any] = {
            "goal": (goal[0], goal[1], math.cos(turn), math.sin(turn)),
            "velocity": (velocity.vx, velocity.vy, velocity.wz),
        }
        if p.scan_sectors:
            parts["scan"] = self._sectors(pose)
        if p.waypoints:
            lengths = tracker.progress + p.waypoint_spacing * np.arange(1.0, p.waypoints + 1.0)
            parts["waypoints"] = _seen_from(pose, tracker.points_at(lengths))[:, :2]
        if p.patch_cells:
            parts["patch"] = self._patch(pose)
        return {name: np.clip(np.asarray(part, dtype=np.float32), *self._bounds[name]) for name, part in parts.items()}

    def _sectors(self, pose: Pose) -> FloatArray:
        """Distance [m] of the nearest point in each sector, counter-clockwise from straight behind."""
        p = self.parameters
        nearest = np.full(p.scan_sectors, p.scan_range)
        for scan in self._scans.values():
            points = _seen_from(pose, scan.in_frame(pose.frame_id, self._transforms).points)
            points = points[(points[:, 2] >= p.lowest) & (points[:, 2] <= p.highest)]
            share = (arctan2(points[:, 1], points[:, 0]) + math.pi) / (2.0 * math.pi)
            sectors = np.floor(share * p.scan_sectors).astype(np.intp) % p.scan_sectors
            np.minimum.at(nearest, sectors, norm(points[:, :2]))
        return nearest

    def _patch(self, pose: Pose) -> FloatArray:
        """Heights [m] above base_link; the first index grows ahead, the second to the left."""
        p = self.parameters
        offsets = p.patch_spacing * (np.arange(p.patch_cells) - 0.5 * (p.patch_cells - 1))
        ahead, left = np.meshgrid(offsets, offsets, indexing="ij")
        there = self._transforms.transform_pose(pose, self._map.frame_id)
        turned = rotated(plane_rotation(there.yaw), np.column_stack([ahead.ravel(), left.ravel()]))
        above = np.full(len(turned), there.z + HEADROOM)
        points = np.column_stack([turned[:, 0] + there.x, turned[:, 1] + there.y, above])
        heights = self._map.heights_below(points)
        assert heights is not None
        offsets_up = np.where(np.isfinite(heights), heights - there.z, -p.patch_range)
        return np.asarray(offsets_up.reshape(ahead.shape))


def _bounds(lowest: Any, highest: Any) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    return np.asarray(lowest, dtype=np.float32), np.asarray(highest, dtype=np.float32)


def _seen_from(pose: Pose, points: FloatArray) -> FloatArray:
    """Points (n, 3) of the frame of a pose, in that pose's own."""
    return rotated_back(pose.rotation, points - pose.position)
