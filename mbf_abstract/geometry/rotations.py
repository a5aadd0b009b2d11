"""Rotations as unit quaternions (x y z w): yaw, products, matrices; the bounds of numbers. Pure functions."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mbf_abstract.geometry.arithmetic import norm

Vector3 = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
FloatArray = NDArray[np.float64]

QUATERNION_NORM_TOLERANCE = 0.01
FARTHEST_COORDINATE = 1e9
"""Largest coordinate [m], which doubles resolve to 0.1 µm; squares of what is far beyond would overflow."""


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


def level_quaternions(x_axes: FloatArray) -> FloatArray:
    """Quaternions (n, 4) of frames whose z axis is up and whose x axis points along ``x_axes`` (n, 3), seen from above.

    The bytes are those of ``quaternions_from_axes`` with z axes (0, 0, 1), signs of zeros included, in a sixth of the
    time: most paths are level.
    """
    upward = (x_axes[:, 2] + 0.0) * 0.0
    x, y = x_axes[:, 0] - upward, x_axes[:, 1] - upward
    length = np.sqrt(x * x + y * y)
    nowhere = length <= 1e-9
    if nowhere.any():
        x, y, length = np.where(nowhere, 0.0, x), np.where(nowhere, -1.0, y), np.where(nowhere, 1.0, length)
    cosine, sine = x / length, y / length
    trace, twice = cosine + cosine + 1.0, sine + sine
    forward = trace > 1.0
    q = np.zeros((len(x_axes), 4))
    q[:, 0] = np.where(forward, 0.0 * sine - 0.0 * cosine, 0.0)
    q[:, 2] = np.where(forward, twice, 1.0 - trace + 2.0)
    q[:, 3] = np.where(forward, 1.0 + trace, twice)
    q /= np.sqrt(q[:, 2] * q[:, 2] + q[:, 3] * q[:, 3])[:, None]
    return q


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


def finite(name: str, values: Iterable[float]) -> tuple[float, ...]:
    """Return the values as floats; raise ``NonFiniteError`` naming the first that is NaN or infinite."""
    numbers = tuple(map(float, values))
    if not all(map(math.isfinite, numbers)):
        index = [math.isfinite(value) for value in numbers].index(False)
        raise NonFiniteError(f"{name}[{index}] must be finite, got {numbers[index]}")
    return numbers


def coordinates(name: str, values: Iterable[float]) -> tuple[float, ...]:
    """Return coordinates [m] as floats; raise ValueError naming the first that is not finite, or too far away."""
    numbers = tuple(map(float, values))
    if not sum(map(abs, numbers)) <= FARTHEST_COORDINATE:  # one sum for what is nearly always so
        for index, number in enumerate(finite(name, numbers)):
            if abs(number) > FARTHEST_COORDINATE:
                raise ValueError(f"{name}[{index}] must be within {FARTHEST_COORDINATE:g} m of zero, got {number:g}")
    return numbers
