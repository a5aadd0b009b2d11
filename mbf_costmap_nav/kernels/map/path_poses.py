"""Poses along a path over cells, in the arithmetic of the numpy formulas that the tests compare them with, bit for bit.

One call each, without the interpreter lock: as numpy code these are dozens of short steps, each of which hands the lock
over to the next thread, so that a second thread did not pay.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.compiling.decorators import Count, brief_kernel, inner_kernel, kernel, plain_kernel

FloatArray = NDArray[np.float64]


@kernel
def course_along(points: FloatArray, spacing: float, arm: float) -> tuple[FloatArray, FloatArray]:
    """Poses on a path of points (k, 2) [m], at most ``spacing`` [m] apart, and the lengths (n,) [m] up to them.

    The headings of the poses (n, 3: x, y, yaw) are those of the lines between the places ``arm`` [m] before and behind
    them on the path.
    """
    given = _lengths(points)
    lengths = _filled(given, spacing)
    poses = np.empty((len(lengths), 3))
    before, here, behind = Count(0), Count(0), Count(0)
    for i in range(len(lengths)):
        before = _piece(given, lengths[i] - arm, before)
        here = _piece(given, lengths[i], here)
        behind = _piece(given, lengths[i] + arm, behind)
        x0, y0 = _place(points, given, lengths[i] - arm, before)
        x1, y1 = _place(points, given, lengths[i] + arm, behind)
        poses[i, 0], poses[i, 1] = _place(points, given, lengths[i], here)
        poses[i, 2] = math.atan2(y1 - y0, x1 - x0)
    return poses, lengths


@kernel
def headed_poses(points: FloatArray) -> FloatArray:
    """Poses (n, 3: x, y, yaw) at points (n, 2) [m] that look to the next one; the last one looks along x."""
    poses = np.zeros((len(points), 3))
    for i in range(len(points)):
        poses[i, 0], poses[i, 1] = points[i, 0], points[i, 1]
        if i + 1 < len(points):
            poses[i, 2] = math.atan2(points[i + 1, 1] - points[i, 1], points[i + 1, 0] - points[i, 0])
    return poses


@brief_kernel
def level_path(points: FloatArray, start_height: float, goal_height: float) -> tuple[FloatArray, FloatArray, float]:
    """Positions (n, 3) [m] over finite points (n, 2), rising evenly from one height to another; headings; the length.

    The headings (n, 4) are level unit quaternions. Each pose looks to the next point, one that is repeated where the
    next one looks, the last one as the one before. Where the length [m] is finite, so are all numbers.
    """
    lengths, count = _lengths(points), len(points)
    positions, quaternions = np.empty((count, 3)), np.zeros((count, 4))
    for i in range(count):
        share = lengths[i] / lengths[count - 1] if lengths[count - 1] > 0.0 else lengths[i]
        positions[i, 0], positions[i, 1] = points[i, 0], points[i, 1]
        positions[i, 2] = start_height + share * (goal_height - start_height)
    length = 0.0
    for i in range(count - 1):
        dx, dy, dz, _ = _step(positions, i)
        length += math.sqrt(dx * dx + dy * dy + dz * dz)
    x, y, z, known = 1.0, 0.0, 0.0, False
    for i in range(count - 2, -1, -1):  # the last point that moves on
        if not known and _moves(positions, i):
            x, y, z, known = _step(positions, i)
    for i in range(count - 1, -1, -1):
        if i + 1 < count and _moves(positions, i):
            x, y, z, known = _step(positions, i)
        _set_level(quaternions, i, x, y, z)
    return positions, quaternions, length


@kernel
def yaw_quaternions(yaws: FloatArray) -> FloatArray:
    """Quaternions (n, 4: x y z w) of rotations by yaws (n,) [rad] about z."""
    quaternions = np.zeros((len(yaws), 4))
    for i in range(len(yaws)):
        quaternions[i, 2], quaternions[i, 3] = math.sin(yaws[i] / 2.0), math.cos(yaws[i] / 2.0)
    return quaternions


@brief_kernel
def first_off_grid(
    points: FloatArray, width: int, height: int, resolution: float, origin_x: float, origin_y: float
) -> int:
    """Index of the first of the points (n, 2 or 3) [m] off a grid; -1 without one."""
    for i in range(len(points)):
        x, y = np.floor((points[i, 0] - origin_x) / resolution), np.floor((points[i, 1] - origin_y) / resolution)
        if not (0.0 <= x < width and 0.0 <= y < height):
            return i
    return -1


@plain_kernel
def _moves(positions: FloatArray, i: int) -> bool:
    return bool(
        positions[i + 1, 0] != positions[i, 0]
        or positions[i + 1, 1] != positions[i, 1]
        or positions[i + 1, 2] != positions[i, 2]
    )


@plain_kernel
def _step(positions: FloatArray, i: int) -> tuple[float, float, float, bool]:
    return (
        positions[i + 1, 0] - positions[i, 0],
        positions[i + 1, 1] - positions[i, 1],
        positions[i + 1, 2] - positions[i, 2],
        True,
    )


@inner_kernel
def _set_level(quaternions: FloatArray, i: int, x: float, y: float, z: float) -> None:
    """The quaternion of a frame whose z axis is up and whose x axis points along (x, y, z), seen from above."""
    upward = (z + 0.0) * 0.0
    x, y = x - upward, y - upward
    length = math.sqrt(x * x + y * y)
    if length <= 1e-9:
        x, y, length = 0.0, -1.0, 1.0
    cosine, sine = x / length, y / length
    trace, twice = cosine + cosine + 1.0, sine + sine
    q0, q2, q3 = 0.0, 1.0 - trace + 2.0, twice
    if trace > 1.0:
        q0, q2, q3 = 0.0 * sine - 0.0 * cosine, twice, 1.0 + trace
    size = math.sqrt(q2 * q2 + q3 * q3)
    quaternions[i, 0], quaternions[i, 2], quaternions[i, 3] = q0 / size, q2 / size, q3 / size


@kernel
def _lengths(points: FloatArray) -> FloatArray:
    """Lengths (k,) [m] along the path up to each point."""
    lengths = np.zeros(len(points))
    for i in range(1, len(points)):
        dx, dy = points[i, 0] - points[i - 1, 0], points[i, 1] - points[i - 1, 1]
        lengths[i] = lengths[i - 1] + math.sqrt(dx * dx + dy * dy)
    return lengths


@kernel
def _filled(given: FloatArray, spacing: float) -> FloatArray:
    """The given lengths (k,) [m], and between them more, at most ``spacing`` [m] apart."""
    total = Count(1)
    for i in range(len(given) - 1):
        total += max(Count(1), Count(math.ceil((given[i + 1] - given[i]) / spacing - 1e-9)))
    lengths, size = np.empty(total), Count(0)
    for i in range(len(given) - 1):
        step = given[i + 1] - given[i]
        count = max(Count(1), Count(math.ceil(step / spacing - 1e-9)))
        for number in range(count):
            lengths[size] = given[i] + step / count * number
            size += 1
    lengths[size] = given[len(given) - 1]
    return lengths


@plain_kernel
def _piece(given: FloatArray, length: float, first: int) -> int:
    """Index of the last point, from ``first`` on, that is no farther along the path than ``length`` [m]."""
    while first + 1 < len(given) and given[first + 1] <= length:
        first += 1
    return first


@plain_kernel
def _place(points: FloatArray, given: FloatArray, length: float, piece: int) -> tuple[float, float]:
    """The place at a length [m] along the path, on the line that begins at the point ``piece``, as ``numpy.interp``."""
    if length <= given[piece] or piece + 1 == len(given):
        return points[piece, 0], points[piece, 1]
    extent, along = given[piece + 1] - given[piece], length - given[piece]
    x = (points[piece + 1, 0] - points[piece, 0]) / extent * along + points[piece, 0]
    y = (points[piece + 1, 1] - points[piece, 1]) / extent * along + points[piece, 1]
    return x, y
