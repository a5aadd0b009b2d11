"""The loops of the trajectory critics: terms over poses (steps, samples) float32 relative to the robot.

Each kernel adds to, or returns, one number a sample. Which terms count how much is decided in
``mbf_costmap_nav.critics``, one critic a file.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.compiling.decorators import kernel, plain_kernel

Float32Array = NDArray[np.float32]


@kernel
def map_costs(
    cells: NDArray[np.uint8],
    resolution: float,
    origin_x: float,
    origin_y: float,
    poses: Float32Array,
    discs: Float32Array,
    stride: int,
    value_of_cost: Float32Array,
) -> Float32Array:
    """Sum up cell values along each trajectory.

    Parameters
    ----------
    cells : (height, width) uint8
    resolution, origin_x, origin_y : float
        Grid geometry [m], origin relative to the robot.
    poses : (3, steps, samples) float32
    discs : (k,) float32
        Offsets [m] along the robot's x axis of the discs that stand for its footprint.
    stride : int
        Every how many steps to look.
    value_of_cost : (256,) float32
        What a cell's cost adds; outside the map nothing is added.

    Returns
    -------
    total : (samples,) float32
        Sum over the steps of the most expensive disc's value.
    """
    height, width = cells.shape
    flat = cells.reshape(-1)
    _, steps, samples = poses.shape
    total = np.zeros(samples, dtype=np.float32)
    worst = np.zeros(samples, dtype=np.float32)
    index = np.empty(samples, dtype=np.int32)
    scale = np.float32(1.0 / resolution)
    left, bottom = np.float32(-origin_x / resolution), np.float32(-origin_y / resolution)
    columns, rows = np.float32(width), np.float32(height)
    for t in range(stride - 1, steps, stride):
        x, y, yaw = poses[0, t], poses[1, t], poses[2, t]
        worst[:] = 0.0
        for k in range(discs.size):
            # Indices first, in a loop that vectorises; the scattered look-ups after it.
            offset = discs[k] * scale
            for n in range(samples):
                u, v = x[n] * scale + left, y[n] * scale + bottom
                if offset != 0.0:
                    u += offset * np.cos(yaw[n])
                    v += offset * np.sin(yaw[n])
                inside = (u >= 0.0) & (v >= 0.0) & (u < columns) & (v < rows)
                index[n] = np.int32(v) * np.int32(width) + np.int32(u) if inside else -1
            for n in range(samples):
                if index[n] >= 0:
                    value = value_of_cost[flat[index[n]]]
                    worst[n] = value if value > worst[n] else worst[n]
        for n in range(samples):
            total[n] += worst[n]
    return total


@kernel
def mean_distance_to_point(poses: Float32Array, x: float, y: float) -> Float32Array:
    """(samples,) mean over the steps of the distance [m] to a point."""
    _, steps, samples = poses.shape
    total = np.zeros(samples, dtype=np.float32)
    px, py = np.float32(x), np.float32(y)
    for t in range(steps):
        xs, ys = poses[0, t], poses[1, t]
        for n in range(samples):
            dx, dy = xs[n] - px, ys[n] - py
            total[n] += np.sqrt(dx * dx + dy * dy)
    return total / np.float32(steps)


@kernel
def alignment(poses: Float32Array, path: Float32Array, spacing: float, stride: int) -> Float32Array:
    """(samples,) mean distance [m] between trajectory points and the path points at the same length travelled.

    Parameters
    ----------
    path : (m, 2) float32
        Points of the path ahead, ``spacing`` [m] apart, relative to the robot.
    """
    _, steps, samples = poses.shape
    total = np.zeros(samples, dtype=np.float32)
    per_spacing = np.float32(1.0 / spacing)
    travelled = np.zeros(samples, dtype=np.float32)
    last_x, last_y = np.zeros(samples, dtype=np.float32), np.zeros(samples, dtype=np.float32)
    # As in map_costs: indices first, in a loop that vectorises, then the look-ups.
    index = np.empty(samples, dtype=np.int32)
    path_x, path_y = path[:, 0].copy(), path[:, 1].copy()
    last, half = np.float32(path.shape[0] - 1), np.float32(0.5)
    looked = 0
    for t in range(stride - 1, steps, stride):
        looked += 1
        xs, ys = poses[0, t], poses[1, t]
        for n in range(samples):
            dx, dy = xs[n] - last_x[n], ys[n] - last_y[n]
            travelled[n] += np.sqrt(dx * dx + dy * dy)
            last_x[n], last_y[n] = xs[n], ys[n]
            at = travelled[n] * per_spacing + half
            index[n] = np.int32(at if at < last else last)
        for n in range(samples):
            ex, ey = xs[n] - path_x[index[n]], ys[n] - path_y[index[n]]
            total[n] += np.sqrt(ex * ex + ey * ey)
    return total / np.float32(max(looked, 1))


@plain_kernel
def furthest_reached(poses: Float32Array, path: Float32Array, stride: int) -> int:
    """Largest index of the path point nearest to any trajectory's end, looking at every ``stride``-th sample."""
    _, steps, samples = poses.shape
    furthest = 0
    for n in range(0, samples, stride):
        x, y = poses[0, steps - 1, n], poses[1, steps - 1, n]
        best, best_index = np.float32(np.inf), 0
        for i in range(path.shape[0]):
            dx, dy = path[i, 0] - x, path[i, 1] - y
            square = dx * dx + dy * dy
            if square < best:
                best, best_index = square, i
        furthest = max(furthest, best_index)
    return furthest


@kernel
def mean_angle_to(poses: Float32Array, yaw: float) -> Float32Array:
    """(samples,) mean over the steps of the heading's distance [rad] to ``yaw``."""
    _, steps, samples = poses.shape
    total = np.zeros(samples, dtype=np.float32)
    target, turn = np.float32(yaw), np.float32(2.0 * np.pi)
    per_turn, half = np.float32(1.0 / (2.0 * np.pi)), np.float32(0.5)
    for t in range(steps):
        headings = poses[2, t]
        for n in range(samples):
            angle = headings[n] - target
            angle -= turn * np.floor(angle * per_turn + half)
            total[n] += abs(angle)
    return total / np.float32(steps)


@kernel
def mean_of(values: Float32Array, negative_part: bool) -> Float32Array:
    """(samples,) mean over the steps of abs(values) (steps, samples), or of how far they are below zero."""
    steps, samples = values.shape
    total = np.zeros(samples, dtype=np.float32)
    for t in range(steps):
        row = values[t]
        for n in range(samples):
            value = row[n]
            counted = (
                -value if value < 0.0 else (np.float32(0.0) if negative_part else value)
            )  # max() blocks vectorising
            total[n] += counted
    return total / np.float32(steps)
