"""Poses, velocities and paths: small frozen values, finite by construction and stamped with their frame.

Units are SI (metres, radians, seconds); axes follow REP-103 (x forward, y left, z up). Quaternions are ordered
``x y z w``. A value that exists is valid: constructors refuse non-finite numbers and quaternions that are not
of unit length, so no code behind the border checks again.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeAlias, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mbf_abstract.arithmetic import norm, scalar_products

Vector3 = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
FloatArray = NDArray[np.float64]

QUATERNION_NORM_TOLERANCE = 0.01


class NonFiniteError(ValueError):
    """A number that must be finite is NaN or infinite; the text names the field or index."""


def quaternion_from_yaw(yaw: float) -> Quaternion:
    """Quaternion (x y z w) of a rotation by ``yaw`` [rad] about z."""
    return (0.0, 0.0, math.sin(yaw / 2.0), math.cos(yaw / 2.0))


def yaw_from_quaternion(q: Sequence[float]) -> float:
    """Yaw [rad] in (-pi, pi] of a quaternion (x y z w)."""
    x, y, z, w = q
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def normalize_angle(angle: float) -> float:
    """Wrap an angle [rad] into (-pi, pi]."""
    wrapped = math.fmod(angle, 2.0 * math.pi)
    if wrapped <= -math.pi:
        return wrapped + 2.0 * math.pi
    return wrapped - 2.0 * math.pi if wrapped > math.pi else wrapped


def quaternion_multiply(a: Sequence[float], b: Sequence[float]) -> Quaternion:
    """Hamilton product ``a * b`` of quaternions (x y z w): rotate by ``b`` first, then by ``a``."""
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def rotation_matrix(q: Sequence[float]) -> FloatArray:
    """(3, 3) float64 rotation matrix of a unit quaternion (x y z w)."""
    x, y, z, w = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def quaternions_from_axes(x_axes: ArrayLike, z_axes: ArrayLike) -> FloatArray:
    """Quaternions (n, 4) of frames whose z axis is ``z_axes`` and whose x axis points along ``x_axes``.

    Parameters
    ----------
    x_axes, z_axes : (n, 3) float
        Need not be unit length; ``x_axes`` is projected onto the plane normal to ``z_axes``. Where the projection
        vanishes any heading is returned.
    """
    z = np.asarray(z_axes, dtype=float)
    z = z / np.maximum(norm(z)[..., None], 1e-12)
    x = np.asarray(x_axes, dtype=float)
    x = x - np.sum(x * z, axis=-1, keepdims=True) * z
    length = norm(x)[..., None]
    fallback = np.cross(np.where(np.abs(z[..., :1]) < 0.9, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]]), z)
    x = np.where(length > 1e-9, x, fallback)
    x = x / np.maximum(norm(x)[..., None], 1e-12)
    y = np.cross(z, x)
    return _quaternions_from_matrices(np.stack([x, y, z], axis=-1))


def _quaternions_from_matrices(m: FloatArray) -> FloatArray:
    """Shepperd's method, vectorised: pick the largest of the four squared components per matrix."""
    trace = m[..., 0, 0] + m[..., 1, 1] + m[..., 2, 2]
    squares = np.stack([m[..., 0, 0], m[..., 1, 1], m[..., 2, 2], trace], axis=-1)
    choice = np.argmax(squares, axis=-1)
    q = np.empty((*choice.shape, 4))
    for axis in range(3):
        j, k = (axis + 1) % 3, (axis + 2) % 3
        pick = choice == axis
        mm = m[pick]
        q[pick, axis] = 1 - trace[pick] + 2 * mm[..., axis, axis]
        q[pick, j] = mm[..., j, axis] + mm[..., axis, j]
        q[pick, k] = mm[..., k, axis] + mm[..., axis, k]
        q[pick, 3] = mm[..., k, j] - mm[..., j, k]
    pick = choice == 3
    mm = m[pick]
    q[pick, 0] = mm[..., 2, 1] - mm[..., 1, 2]
    q[pick, 1] = mm[..., 0, 2] - mm[..., 2, 0]
    q[pick, 2] = mm[..., 1, 0] - mm[..., 0, 1]
    q[pick, 3] = 1 + trace[pick]
    return np.asarray(q / norm(q)[..., None], dtype=float)


def _finite(name: str, values: Iterable[float]) -> tuple[float, ...]:
    numbers = tuple(map(float, values))
    if not all(map(math.isfinite, numbers)):
        index = [math.isfinite(value) for value in numbers].index(False)
        raise NonFiniteError(f"{name}[{index}] must be finite, got {numbers[index]}")
    return numbers


@dataclass(frozen=True, slots=True)
class Pose:
    """A position [m] and orientation (unit quaternion x y z w) in the frame ``frame_id`` at time ``stamp`` [s].

    Raises
    ------
    ValueError
        A component is not finite, or the squared norm of the quaternion is off 1 by more than 0.01.
    """

    position: Vector3
    orientation: Quaternion = (0.0, 0.0, 0.0, 1.0)
    frame_id: str = "map"
    stamp: float = 0.0

    def __post_init__(self) -> None:
        position = _finite("position", self.position)
        orientation = _finite("orientation", self.orientation)
        if len(position) != 3 or len(orientation) != 4:
            raise ValueError("a pose has a position of 3 and an orientation of 4 components")
        norm_squared = sum(component * component for component in orientation)
        if abs(norm_squared - 1.0) > QUATERNION_NORM_TOLERANCE:
            raise ValueError(f"orientation must have unit length, its squared norm is {norm_squared:.6g}")
        object.__setattr__(self, "position", position)
        object.__setattr__(self, "orientation", orientation)

    @classmethod
    def planar(
        cls, x: float, y: float, yaw: float = 0.0, z: float = 0.0, frame_id: str = "map", stamp: float = 0.0
    ) -> Pose:
        """Pose at (x, y, z) [m] whose x axis points along ``yaw`` [rad], z up.

        On a map with heights ``Navigator.ground_pose`` finds the z.
        """
        return cls((x, y, z), quaternion_from_yaw(yaw), frame_id, stamp)

    @property
    def x(self) -> float:
        """X coordinate [m]."""
        return self.position[0]

    @property
    def y(self) -> float:
        """Y coordinate [m]."""
        return self.position[1]

    @property
    def z(self) -> float:
        """Z coordinate [m]."""
        return self.position[2]

    @property
    def yaw(self) -> float:
        """Heading about z [rad] in (-pi, pi]."""
        return yaw_from_quaternion(self.orientation)

    @property
    def rotation(self) -> FloatArray:
        """(3, 3) rotation matrix; its columns are the pose's x, y and z axes in ``frame_id``."""
        return rotation_matrix(self.orientation)

    def distance_to(self, other: Pose) -> float:
        """3D Euclidean distance [m] between the two positions; frames are not compared."""
        return math.dist(self.position, other.position)

    def angle_to(self, other: Pose) -> float:
        """Smallest rotation [rad] in [0, pi] that takes one orientation to the other."""
        dot = abs(sum(a * b for a, b in zip(self.orientation, other.orientation, strict=True)))
        return 2.0 * math.acos(min(1.0, dot))

    def stamped(self, stamp: float) -> Pose:
        """Return the same pose with another time stamp [s]."""
        return replace(self, stamp=stamp)


@dataclass(frozen=True, slots=True)
class Twist:
    """Linear [m/s] and angular [rad/s] velocity, expressed in the robot's base frame; finite.

    Raises
    ------
    ValueError
        A component is not finite.
    """

    linear: Vector3 = (0.0, 0.0, 0.0)
    angular: Vector3 = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        object.__setattr__(self, "linear", _finite("linear", self.linear))
        object.__setattr__(self, "angular", _finite("angular", self.angular))

    @classmethod
    def planar(cls, vx: float = 0.0, vy: float = 0.0, wz: float = 0.0) -> Twist:
        """Twist of a ground robot: forward and sideways speed [m/s], yaw rate [rad/s]."""
        return cls((vx, vy, 0.0), (0.0, 0.0, wz))

    @property
    def vx(self) -> float:
        """Forward speed [m/s]."""
        return self.linear[0]

    @property
    def vy(self) -> float:
        """Sideways speed, left positive [m/s]."""
        return self.linear[1]

    @property
    def wz(self) -> float:
        """Yaw rate, counter-clockwise positive [rad/s]."""
        return self.angular[2]

    @property
    def speed(self) -> float:
        """Length of the linear velocity [m/s]."""
        return math.hypot(*self.linear)

    def is_stopped(self, translation: float = 1e-3, rotation: float = 1e-3) -> bool:
        """Whether planar motion is within ``translation`` [m/s] per axis and ``rotation`` [rad/s]."""
        return abs(self.vx) <= translation and abs(self.vy) <= translation and abs(self.wz) <= rotation


@dataclass(frozen=True, slots=True)
class AckermannCommand:
    """Command of a car-like robot: ``speed`` [m/s] and front ``steering_angle`` [rad, left positive]; finite."""

    speed: float = 0.0
    steering_angle: float = 0.0

    def __post_init__(self) -> None:
        _finite("speed", (self.speed,))
        _finite("steering_angle", (self.steering_angle,))

    def is_stopped(self, translation: float = 1e-3, rotation: float = 1e-3) -> bool:
        """Whether the commanded speed is within ``translation`` [m/s]; a standing car may keep its wheels turned."""
        return abs(self.speed) <= translation


Command: TypeAlias = Twist | AckermannCommand


def _refuse_wrong_pose(positions: FloatArray, orientations: FloatArray, squared_norms: FloatArray) -> None:
    """Name the first pose of a path that is not finite, or else the first whose quaternion is not of unit length."""
    infinite = ~(np.isfinite(positions).all(axis=1) & np.isfinite(orientations).all(axis=1))
    if infinite.any():
        i = int(np.argmax(infinite))
        raise NonFiniteError(f"pose {i} of the path is not finite: {positions[i].tolist()} {orientations[i].tolist()}")
    i = int(np.argmax(np.abs(squared_norms - 1.0) > QUATERNION_NORM_TOLERANCE))
    raise ValueError(f"orientation of pose {i} has squared norm {squared_norms[i]:.6g}, expected 1")


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
        Wrong shapes, a non-finite number (named by index) or a quaternion that is not of unit length.
    """

    positions: FloatArray
    orientations: FloatArray | None = None
    frame_id: str = "map"
    stamp: float = 0.0
    guidance: Any = field(default=None, repr=False)

    def __post_init__(self) -> None:
        positions = np.array(self.positions, dtype=np.float64).reshape(-1, 3)
        if self.orientations is None:
            orientations = np.tile([0.0, 0.0, 0.0, 1.0], (len(positions), 1))
        else:
            orientations = np.array(self.orientations, dtype=np.float64).reshape(-1, 4)
        if len(positions) != len(orientations):
            raise ValueError(f"{len(positions)} positions but {len(orientations)} orientations")
        # Whole arrays first: which pose is wrong is looked for only if one may be.
        norms = scalar_products(orientations, orientations)
        is_unit = np.abs(norms - 1.0) <= QUATERNION_NORM_TOLERANCE
        if not (is_unit.all() and np.isfinite(positions).all()):
            _refuse_wrong_pose(positions, orientations, norms)
        positions.flags.writeable = False
        orientations.flags.writeable = False
        object.__setattr__(self, "positions", positions)
        object.__setattr__(self, "orientations", orientations)

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
        """
        points = np.asarray(positions, dtype=np.float64).reshape(-1, 3)
        ahead = np.tile([1.0, 0.0, 0.0], (len(points), 1))
        steps = np.diff(points, axis=0)
        moving = np.flatnonzero(steps.any(axis=1))
        if moving.size:  # a repeated point looks where the next one looks, the last one where the one before looked
            following = np.minimum(np.searchsorted(moving, np.arange(len(points))), moving.size - 1)
            ahead = steps[moving[following]]
        up = np.tile([0.0, 0.0, 1.0], (len(points), 1)) if normals is None else np.asarray(normals, dtype=float)
        orientations = quaternions_from_axes(ahead, up) if len(points) else np.zeros((0, 4))
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
    def length(self) -> float:
        """Sum of the 3D lengths of the path's segments [m]."""
        return float(norm(np.diff(self.positions, axis=0)).sum())

    @property
    def remaining_lengths(self) -> FloatArray:
        """(n,) float64, length [m] along the path from each pose to the last one."""
        segments = norm(np.diff(self.positions, axis=0))
        return np.concatenate([np.cumsum(segments[::-1])[::-1], [0.0]]) if len(self) else np.zeros(0)

    def __repr__(self) -> str:
        return f"<Path of {len(self)} poses, {self.length:.2f} m, frame {self.frame_id!r}>"
