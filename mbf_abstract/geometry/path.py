"""A path: poses in one frame as arrays, with the same promises as single poses."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike

from mbf_abstract.geometry.arithmetic import arctan2, norm, scalar_products
from mbf_abstract.geometry.pose import Pose
from mbf_abstract.geometry.rotations import (
    FARTHEST_COORDINATE,
    QUATERNION_NORM_TOLERANCE,
    FloatArray,
    NonFiniteError,
    Quaternion,
    coordinates,
    level_quaternions,
    quaternions_from_axes,
)


def _refuse_wrong_pose(positions: FloatArray, orientations: FloatArray, squared_norms: FloatArray) -> None:
    """Name the first pose of a path that is not finite, too far away, or whose quaternion is not of unit length."""
    infinite = ~np.isfinite(positions).all(axis=1)
    if not infinite.any():  # else it has made the headings of its neighbours what they are
        infinite = ~np.isfinite(orientations).all(axis=1)
    if infinite.any():
        i = int(np.argmax(infinite))
        raise NonFiniteError(f"pose {i} of the path is not finite: {positions[i].tolist()} {orientations[i].tolist()}")
    _refuse_far(positions)
    i = int(np.argmax(np.abs(squared_norms - 1.0) > QUATERNION_NORM_TOLERANCE))
    raise ValueError(f"orientation of pose {i} has squared norm {squared_norms[i]:.6g}, expected 1")


def _refuse_infinite(points: FloatArray, what: str) -> None:
    """Name the first of the points or normals (n, 3) of a path that is not finite, before anything is computed."""
    if not np.isfinite(points).all():
        i = int(np.argmax(~np.isfinite(points).all(axis=1)))
        raise NonFiniteError(f"{what} {i} of the path is not finite: {points[i].tolist()}")


def _refuse_far(positions: FloatArray) -> None:
    """Name the first of finite positions (n, 3) whose coordinates are beyond the bound."""
    far = (np.abs(positions) > FARTHEST_COORDINATE).any(axis=1)
    if far.any():
        i = int(np.argmax(far))
        coordinates(f"position of pose {i} of the path", positions[i].tolist())


def _rows(values: ArrayLike, columns: int, what: str) -> FloatArray:
    """Copy of an array (n, columns); points of two numbers would be read as fewer of three."""
    rows = np.array(values, dtype=np.float64)
    if rows.size == 0:
        return rows.reshape(0, columns)
    if rows.ndim != 2 or rows.shape[1] != columns:
        raise ValueError(f"the {what} of a path have the shape {rows.shape}, expected (n, {columns})")
    return rows


@dataclass(frozen=True, eq=False)
class Path:
    """A sequence of poses in one frame, stored as two read-only arrays.

    Parameters
    ----------
    positions : (n, 3) float64
        Positions [m]; copied.
    orientations : (n, 4) float64
        Unit quaternions x y z w; copied. Without them every pose looks along +x.
    frame_id : str
        Frame of all poses.
    stamp : float
        Time of planning [s].
    guidance : object
        What a planner hands on to a controller that can use more than poses, e.g. a vector field. The core never
        looks at it.

    Raises
    ------
    ValueError
        Wrong shapes, a non-finite number or a coordinate beyond ``FARTHEST_COORDINATE`` (named by index), or a
        quaternion that is not of unit length.
    """

    positions: FloatArray
    orientations: FloatArray | None = None
    frame_id: str = "map"
    stamp: float = 0.0
    guidance: Any = field(default=None, repr=False)

    def __post_init__(self) -> None:
        positions = _rows(self.positions, 3, "positions")
        if self.orientations is None:
            orientations = np.tile([0.0, 0.0, 0.0, 1.0], (len(positions), 1))
        else:
            orientations = _rows(self.orientations, 4, "orientations")
        if len(positions) != len(orientations):
            raise ValueError(f"{len(positions)} positions but {len(orientations)} orientations")
        # Whole arrays first: which pose is wrong is looked for only if one may be.
        norms = scalar_products(orientations, orientations)
        is_unit = np.abs(norms - 1.0) <= QUATERNION_NORM_TOLERANCE
        if not (is_unit.all() and np.abs(positions).max(initial=0.0) <= FARTHEST_COORDINATE):
            _refuse_wrong_pose(positions, orientations, norms)
        positions.flags.writeable = False
        orientations.flags.writeable = False
        object.__setattr__(self, "positions", positions)
        object.__setattr__(self, "orientations", orientations)

    @classmethod
    def of_checked_arrays(
        cls, positions: FloatArray, orientations: FloatArray, frame_id: str, stamp: float, guidance: Any = None
    ) -> Path:
        """Take over arrays (n, 3) and (n, 4) float64 that a kernel has made for this path alone.

        They are neither copied nor checked: they must be finite, and the quaternions of unit length.
        """
        path = cls.__new__(cls)
        positions.flags.writeable = orientations.flags.writeable = False
        vars(path).update(
            positions=positions, orientations=orientations, frame_id=frame_id, stamp=stamp, guidance=guidance
        )
        return path

    @classmethod
    def from_poses(cls, poses: Sequence[Pose], stamp: float = 0.0) -> Path:
        """Build a path of poses that share one frame; raises ValueError where they do not."""
        frames = {pose.frame_id for pose in poses}
        if len(frames) > 1:
            raise ValueError(f"the poses of a path must share one frame, got {sorted(frames)}")
        return cls(
            np.array([pose.position for pose in poses], dtype=np.float64).reshape(-1, 3),
            np.array([pose.orientation for pose in poses], dtype=np.float64).reshape(-1, 4),
            frames.pop() if frames else "map",
            stamp,
        )

    @classmethod
    def from_points(
        cls,
        positions: ArrayLike,
        final_orientation: Quaternion | None = None,
        normals: ArrayLike | None = None,
        frame_id: str = "map",
        stamp: float = 0.0,
        guidance: Any = None,
    ) -> Path:
        """Build a path through ``positions`` (n, 3) whose poses head to the next point.

        Parameters
        ----------
        final_orientation : quaternion, optional
            Orientation of the last pose; without it the last pose keeps the heading of the one before.
        normals : (n, 3) float, optional
            Surface normals, the poses' z axes; without them z is up.

        Raises ValueError as the class does.
        """
        points = _rows(positions, 3, "positions")
        _refuse_infinite(points, "pose")
        _refuse_far(points)
        if normals is not None:
            if np.shape(normals) != points.shape:
                raise ValueError(f"the normals of a path have the shape {np.shape(normals)}, expected {points.shape}")
            _refuse_infinite(np.asarray(normals, dtype=np.float64), "normal")
        ahead = np.tile([1.0, 0.0, 0.0], (len(points), 1))
        steps = np.diff(points, axis=0)
        moving = np.flatnonzero(steps.any(axis=1))
        if moving.size:  # a repeated point looks where the next one looks, the last one where the one before looked
            following = np.minimum(np.searchsorted(moving, np.arange(len(points))), moving.size - 1)
            ahead = steps[moving[following]]
        if normals is None:
            orientations = level_quaternions(ahead)
        else:
            orientations = quaternions_from_axes(ahead, normals) if len(points) else np.zeros((0, 4))
        if final_orientation is not None and len(points):
            orientations[-1] = final_orientation
        return cls(points, orientations, frame_id, stamp, guidance)

    def __len__(self) -> int:
        return len(self.positions)

    @overload
    def __getitem__(self, index: int) -> Pose: ...
    @overload
    def __getitem__(self, index: slice) -> Path: ...
    def __getitem__(self, index: int | slice) -> Pose | Path:
        assert self.orientations is not None
        if isinstance(index, slice):
            return replace(self, positions=self.positions[index], orientations=self.orientations[index])
        x, y, z = self.positions[index].tolist()
        qx, qy, qz, qw = self.orientations[index].tolist()
        return Pose((x, y, z), (qx, qy, qz, qw), self.frame_id, self.stamp)

    def __iter__(self) -> Iterator[Pose]:
        return (self[i] for i in range(len(self)))

    @property
    def planar_poses(self) -> FloatArray:
        """(n, 3) float64, x, y [m] and yaw [rad] of each pose."""
        assert self.orientations is not None
        x, y, z, w = self.orientations.T
        yaws = arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
        return np.column_stack([self.positions[:, :2], yaws])

    @property
    def length(self) -> float:
        """Sum of the 3D lengths of the path's segments [m]."""
        return float(self._segment_lengths.sum())

    @property
    def remaining_lengths(self) -> FloatArray:
        """(n,) float64, length [m] along the path from each pose to the last one."""
        segments = self._segment_lengths
        return np.concatenate([np.cumsum(segments[::-1])[::-1], [0.0]]) if len(self) else np.zeros(0)

    @property
    def _segment_lengths(self) -> FloatArray:
        return norm(self.positions[1:] - self.positions[:-1])  # np.diff takes three times as long for a short path

    def __repr__(self) -> str:
        return f"<Path of {len(self)} poses, {self.length:.2f} m, frame {self.frame_id!r}>"
