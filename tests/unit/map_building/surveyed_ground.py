"""Points as a scanner would measure them: ground, trees, posts, grass, and a bridge."""

import numpy as np

DENSITY = 100.0  # points per square metre
NOISE = 0.02  # m


def hills(x, y):
    """Height [m] of gentle hills."""
    return 0.6 * np.sin(0.35 * x) + 0.4 * np.cos(0.5 * y) + 0.05 * x


def flat(x, y):
    """Level ground."""
    return 0.0 * x


def ground(rng, height, size=(16.0, 12.0), noise=NOISE):
    """Points on ``height(x, y)`` over a rectangle, with noise along z."""
    xy = rng.uniform((0.0, 0.0), size, (int(DENSITY * size[0] * size[1]), 2))
    z = height(xy[:, 0], xy[:, 1]) + rng.normal(0.0, noise, len(xy))
    return np.column_stack([xy, z])


def from_wrong_poses(rng, points, error=0.05, reach=4.0, drifting=20.0):
    """Points as overlapping scans a metre apart have them, whose places are wrong; half of it drifts."""
    low = points[:, :2].min(axis=0)
    columns, rows = np.ceil(np.ptp(points[:, :2], axis=0)).astype(int) + 1
    drift, kept = rng.normal(size=(columns * rows, 3)), np.exp(-1.0 / drifting)
    for scan in range(1, columns * rows):
        drift[scan] = kept * drift[scan - 1] + np.sqrt(1.0 - kept * kept) * drift[scan]
    errors = error * np.sqrt(0.5) * (drift + rng.normal(size=drift.shape))
    seen_from = points[:, :2] - low + rng.uniform(-reach, reach, (len(points), 2))
    column, row = np.clip(np.rint(seen_from), 0, (columns - 1, rows - 1)).astype(int).T
    return points + errors[row * columns + np.where(row % 2 == 0, column, columns - 1 - column)]


def post(rng, x, y, foot, diameter=0.1, height=1.0):
    """Points on the side of a post."""
    count = max(20, int(DENSITY * np.pi * diameter * height))
    angle = rng.uniform(0.0, 2.0 * np.pi, count)
    side = 0.5 * diameter * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return np.column_stack([x + side[:, 0], y + side[:, 1], foot + rng.uniform(0.0, height, count)])


def tree(rng, x, y, foot):
    """Points on a trunk of 3 m, and in a crown above it."""
    directions = rng.normal(size=(600, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    crown = [x, y, foot + 4.0] + directions * [1.5, 1.5, 1.2] * rng.uniform(0.3, 1.0, (600, 1))
    return np.vstack([post(rng, x, y, foot, diameter=0.3, height=3.0), crown])


def rectangle(rng, x, y, z, noise=NOISE):
    """Points on a plane from (x[0], y[0]) to (x[1], y[1]) whose height goes from z[0] to z[1] along x."""
    count = int(DENSITY * (x[1] - x[0]) * (y[1] - y[0]))
    xy = rng.uniform((x[0], y[0]), (x[1], y[1]), (count, 2))
    height = z[0] + (xy[:, 0] - x[0]) / (x[1] - x[0]) * (z[1] - z[0])
    return np.column_stack([xy, height + rng.normal(0.0, noise, count)])


def bridge(rng):
    """A deck 3 m above a road along y, with a ramp on both sides; the abutments are walls."""
    abutments = [
        np.column_stack([np.full(1200, x), rng.uniform(4.0, 8.0, 1200), rng.uniform(0.0, 3.0, 1200)])
        for x in (12.0, 20.0)
    ]
    parts = [
        rectangle(rng, (12.0, 20.0), (0.0, 12.0), (0.0, 0.0)),
        rectangle(rng, (0.0, 12.0), (4.0, 8.0), (0.0, 3.0)),
        rectangle(rng, (12.0, 20.0), (4.0, 8.0), (3.0, 3.0)),
        rectangle(rng, (20.0, 32.0), (4.0, 8.0), (3.0, 0.0)),
    ]
    return np.vstack([*parts, *abutments])
