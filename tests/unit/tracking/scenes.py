"""Scans of a planar lidar among upright things, by casting its rays against their sides."""

import math

import numpy as np

BEAMS, RANGE, NOISE = 720, 8.0, 0.01  # -, m, m


def box(x, y, yaw, length, width):
    """Sides of a box around (x, y) [m], as pairs of corners."""
    c, s = math.cos(yaw), math.sin(yaw)
    ends = ((0.5, 0.5), (-0.5, 0.5), (-0.5, -0.5), (0.5, -0.5))
    corners = [(x + c * a * length - s * b * width, y + s * a * length + c * b * width) for a, b in ends]
    return [(corners[k - 1], corners[k]) for k in range(4)]


def scan(sensor, sides, rng, height=0.0):
    """Ends (BEAMS, 3) [m] and hits (BEAMS,) of all rays from a sensor (x, y) [m]."""
    angles = 2.0 * math.pi * (np.arange(BEAMS) + rng.uniform()) / BEAMS
    ways = np.column_stack([np.cos(angles), np.sin(angles)])
    nearest = np.full(BEAMS, np.inf)
    for first, second in sides:
        a, along = np.subtract(first, sensor), np.subtract(second, first)
        across = ways[:, 0] * along[1] - ways[:, 1] * along[0]
        distances = (a[0] * along[1] - a[1] * along[0]) / across
        shares = (a[0] * ways[:, 1] - a[1] * ways[:, 0]) / across
        met = (distances > 0.0) & (shares >= 0.0) & (shares <= 1.0)
        nearest = np.where(met & (distances < nearest), distances, nearest)
    hits = nearest < RANGE
    lengths = np.where(hits, nearest + rng.normal(0.0, NOISE, BEAMS), RANGE)
    return np.column_stack([np.add(sensor, lengths[:, None] * ways), np.full(BEAMS, height)]), hits
