"""One rigid transform between two named frames, and its arithmetic.

Notation: ``T_target_source`` maps coordinates in ``source`` to coordinates in ``target``; its translation is where the
origin of ``source`` lies in ``target``. Neighbouring names cancel: ``T_map_base = T_map_odom @ T_odom_base``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import reduce

import numpy as np
from numpy.typing import ArrayLike

from mbf_abstract.geometry import (
    FARTHEST_COORDINATE,
    QUATERNION_NORM_TOLERANCE,
    FloatArray,
    Path,
    Pose,
    Quaternion,
    Vector3,
    quaternion_multiply,
    rotation_matrix,
)
from mbf_abstract.geometry.arithmetic import rotated

IDENTITY_ROTATION: Quaternion = (0.0, 0.0, 0.0, 1.0)


class TransformError(Exception):
    """A transform is not available; the text names both frames, what exists, and ages."""


class InvalidTransformError(TransformError):
    """A transform or a frame name that can never be right: not finite, no rotation, empty name."""


@dataclass(frozen=True, slots=True)
class Transform:
    """The frame ``child`` as seen from the frame ``parent``: ``T_parent_child``.

    Attributes
    ----------
    translation : (3,) float
        Origin of the child [m] in the parent.
    rotation : (4,) float
        Unit quaternion x y z w; normalised here.
    parent, child : str
        Frame names.
    stamp : float
        Time [s] of validity; without meaning if static.
    static : bool
        Whether it holds at all times.

    Raises
    ------
    InvalidTransformError
        A number is not finite, the translation is beyond ``FARTHEST_COORDINATE`` (1e9 m), the squared norm of the
        rotation is off 1 by 0.01 or more, or a frame name is empty or starts with ``/``.
    """

    translation: Vector3
    rotation: Quaternion = IDENTITY_ROTATION
    parent: str = "map"
    child: str = "base_link"
    stamp: float = 0.0
    static: bool = False

    def __post_init__(self) -> None:
        if problem := frame_name_problem(self.parent) or frame_name_problem(self.child):
            raise self._invalid(problem)
        translation, rotation = tuple(map(float, self.translation)), tuple(map(float, self.rotation))
        if len(translation) != 3 or len(rotation) != 4:
            raise self._invalid(f"needs 3 and 4 numbers, got {translation} and {rotation}")
        if not all(map(math.isfinite, (*translation, *rotation, self.stamp))):
            raise self._invalid(f"not finite: {translation} {rotation} at {self.stamp}")
        if max(map(abs, translation)) > FARTHEST_COORDINATE:
            raise self._invalid(f"expected a translation within {FARTHEST_COORDINATE:g} m of zero, got {translation}")
        x, y, z, w = rotation
        norm_squared = x * x + y * y + z * z + w * w
        if abs(norm_squared - 1.0) >= QUATERNION_NORM_TOLERANCE:
            raise self._invalid(f"squared norm of the rotation is {norm_squared:.6g}, expected 1")
        norm = math.sqrt(norm_squared)
        object.__setattr__(self, "translation", translation)
        object.__setattr__(self, "rotation", (x / norm, y / norm, z / norm, w / norm))

    def _invalid(self, problem: str) -> InvalidTransformError:
        return InvalidTransformError(f"transform {self.parent!r} -> {self.child!r}: {problem}")

    @classmethod
    def from_pose(cls, pose: Pose, child: str) -> Transform:
        """Return the transform of a frame ``child`` that stands at ``pose``."""
        return cls(pose.position, pose.orientation, pose.frame_id, child, pose.stamp)

    def __matmul__(self, other: Transform) -> Transform:
        """``T_a_b @ T_b_c = T_a_c``, at the older of the two stamps; raises ValueError if the frames do not meet."""
        if self.child != other.parent:
            raise ValueError(f"{self.parent}->{self.child} cannot be followed by {other.parent}->{other.child}")
        translation = _add(self.translation, rotate(self.rotation, other.translation))
        rotation = quaternion_multiply(self.rotation, other.rotation)
        stamps = [transform.stamp for transform in (self, other) if not transform.static]
        stamp = min(stamps) if stamps else self.stamp
        return Transform(translation, rotation, self.parent, other.child, stamp, not stamps)

    def inverse(self) -> Transform:
        """Return ``T_child_parent``."""
        x, y, z, w = self.rotation
        rotation = (-x, -y, -z, w)
        tx, ty, tz = rotate(rotation, self.translation)
        return Transform((-tx, -ty, -tz), rotation, self.child, self.parent, self.stamp, self.static)

    def apply(self, points: ArrayLike) -> FloatArray:
        """Map (n, 3) points [m] from the child frame to the parent frame."""
        return rotated(rotation_matrix(self.rotation), points) + self.translation

    def apply_to_pose(self, pose: Pose) -> Pose:
        """Map a pose from the child frame to the parent frame; it keeps its stamp.

        Raises
        ------
        InvalidTransformError
            There it is beyond ``FARTHEST_COORDINATE``.
        """
        position = _add(self.translation, rotate(self.rotation, pose.position))
        try:
            return Pose(position, quaternion_multiply(self.rotation, pose.orientation), self.parent, pose.stamp)
        except ValueError as error:
            raise self._invalid(str(error)) from error

    def apply_to_path(self, path: Path) -> Path:
        """Map a path from the child frame to the parent frame; its guidance, which cannot be mapped, is dropped.

        Raises InvalidTransformError as ``apply_to_pose`` does.
        """
        orientations = _multiply_many(self.rotation, np.asarray(path.orientations))
        try:
            return Path(self.apply(path.positions), orientations, self.parent, path.stamp)
        except ValueError as error:
            raise self._invalid(str(error)) from error

    def interpolate(self, later: Transform, stamp: float) -> Transform:
        """Return the transform at ``stamp`` between this one and a later one: linear, and slerp for the rotation."""
        ratio = (stamp - self.stamp) / (later.stamp - self.stamp)
        start, end = self.translation, later.translation
        translation = (
            start[0] + ratio * (end[0] - start[0]),
            start[1] + ratio * (end[1] - start[1]),
            start[2] + ratio * (end[2] - start[2]),
        )
        rotation = slerp(self.rotation, later.rotation, ratio)
        return Transform(translation, rotation, self.parent, self.child, stamp, self.static)

    def at(self, stamp: float) -> Transform:
        """Return the same transform with another stamp [s]."""
        return Transform(self.translation, self.rotation, self.parent, self.child, stamp, self.static)


def frame_name_problem(name: str) -> str:
    """Return what is wrong with a frame name, or an empty text."""
    if not name:
        return "a frame name must not be empty"
    return f"frame name {name!r} must not start with '/'" if name.startswith("/") else ""


def rotate(q: Quaternion, v: Vector3) -> Vector3:
    """Rotate a vector by a unit quaternion: ``v + 2 u x (u x v + w v)`` with ``q = (u, w)``."""
    x, y, z, w = q
    cx, cy, cz = y * v[2] - z * v[1] + w * v[0], z * v[0] - x * v[2] + w * v[1], x * v[1] - y * v[0] + w * v[2]
    return (v[0] + 2.0 * (y * cz - z * cy), v[1] + 2.0 * (z * cx - x * cz), v[2] + 2.0 * (x * cy - y * cx))


def slerp(a: Quaternion, b: Quaternion, ratio: float) -> Quaternion:
    """Rotate from ``a`` (ratio 0) to ``b`` (ratio 1) at constant speed along the shorter arc (Shoemake, 1985)."""
    dot = sum(p * q for p, q in zip(a, b, strict=True))
    sign = -1.0 if dot < 0.0 else 1.0
    angle = math.acos(min(1.0, abs(dot)))
    if angle < 1e-6:  # the two are so close that the straight line is exact to rounding
        weight_a, weight_b = 1.0 - ratio, sign * ratio
    else:
        weight_a = math.sin((1.0 - ratio) * angle) / math.sin(angle)
        weight_b = sign * math.sin(ratio * angle) / math.sin(angle)
    x, y, z, w = (weight_a * p + weight_b * q for p, q in zip(a, b, strict=True))
    return (x, y, z, w)


def _add(a: Vector3, b: Vector3) -> Vector3:
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def _multiply_many(a: Quaternion, b: FloatArray) -> FloatArray:
    """Hamilton products ``a * b[i]`` of one quaternion with (n, 4) others."""
    return np.stack(quaternion_multiply(a, tuple(b.T)), axis=-1)


def composed(target_steps: list[Transform], source_steps: list[Transform], time: float) -> Transform:
    """``T_target_source`` of the steps from both frames up to where they meet; at least one list has steps."""
    T_common_target, T_common_source = _product(target_steps), _product(source_steps)
    if T_common_target is None:
        assert T_common_source is not None
        return T_common_source.at(time)
    T_target_common = T_common_target.inverse()
    T_target_source = T_target_common if T_common_source is None else T_target_common @ T_common_source
    return T_target_source.at(time)


def _product(steps: list[Transform]) -> Transform | None:
    """``T_top_bottom`` of steps that lead up from the bottom; None for no steps."""
    return reduce(lambda product, T_parent_child: T_parent_child @ product, steps) if steps else None
