"""Poses, velocities and paths: small frozen values, finite by construction and stamped with their frame.

Units are SI (metres, radians, seconds); axes follow REP-103 (x forward, y left, z up). Quaternions are ordered
``x y z w``. A value that exists is valid: constructors refuse non-finite numbers, coordinates beyond 1e9 m, and
quaternions that are not of unit length, so no code behind the border checks again.
"""

from mbf_abstract.geometry.path import Path
from mbf_abstract.geometry.pose import Pose
from mbf_abstract.geometry.rotations import (
    FARTHEST_COORDINATE,
    QUATERNION_NORM_TOLERANCE,
    FloatArray,
    NonFiniteError,
    Quaternion,
    Vector3,
    normalize_angle,
    quaternion_from_yaw,
    quaternion_multiply,
    quaternions_from_axes,
    rotation_matrix,
    yaw_from_quaternion,
)
from mbf_abstract.geometry.twist import AckermannCommand, Command, Twist

__all__ = [
    "FARTHEST_COORDINATE",
    "QUATERNION_NORM_TOLERANCE",
    "AckermannCommand",
    "Command",
    "FloatArray",
    "NonFiniteError",
    "Path",
    "Pose",
    "Quaternion",
    "Twist",
    "Vector3",
    "normalize_angle",
    "quaternion_from_yaw",
    "quaternion_multiply",
    "quaternions_from_axes",
    "rotation_matrix",
    "yaw_from_quaternion",
]
