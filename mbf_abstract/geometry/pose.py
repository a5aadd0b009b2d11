"""A pose in space: position and orientation, finite by construction and stamped with its frame."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from mbf_abstract.geometry.rotations import (
    QUATERNION_NORM_TOLERANCE,
    FloatArray,
    Quaternion,
    Vector3,
    coordinates,
    finite,
    quaternion_from_yaw,
    rotation_matrix,
    yaw_from_quaternion,
)


@dataclass(frozen=True, slots=True)
class Pose:
    """A position [m] and orientation (unit quaternion x y z w) in the frame ``frame_id`` at time ``stamp`` [s].

    Raises
    ------
    ValueError
        A component is not finite, a coordinate is beyond ``FARTHEST_COORDINATE`` (1e9 m), or the squared norm of the
        quaternion is off 1 by more than 0.01.
    """

    position: Vector3
    orientation: Quaternion = (0.0, 0.0, 0.0, 1.0)
    frame_id: str = "map"
    stamp: float = 0.0

    def __post_init__(self) -> None:
        position = coordinates("position", self.position)
        orientation = finite("orientation", self.orientation)
        if len(position) != 3 or len(orientation) != 4:
            raise ValueError("a pose has a position of 3 and an orientation of 4 components")
        x, y, z, w = orientation
        norm_squared = x * x + y * y + z * z + w * w
        if abs(norm_squared - 1.0) > QUATERNION_NORM_TOLERANCE:
            raise ValueError(f"orientation must have unit length, its squared norm is {norm_squared:.6g}")
        object.__setattr__(self, "position", position)
        object.__setattr__(self, "orientation", orientation)

    def __str__(self) -> str:
        x, y, z = self.position
        return f"({x:.2f}, {y:.2f}, {z:.2f}) m, yaw {self.yaw:.2f} rad, in {self.frame_id!r}"

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
        (ax, ay, az, aw), (bx, by, bz, bw) = self.orientation, other.orientation
        return 2.0 * math.acos(min(1.0, abs(ax * bx + ay * by + az * bz + aw * bw)))

    def stamped(self, stamp: float) -> Pose:
        """Return the same pose with another time stamp [s]."""
        return replace(self, stamp=stamp)
