"""Curves of a car between two poses: Dubins (forward only) and Reeds-Shepp (with reversing), three segments each.

Lengths are in turning radii. A word has three rows of (steering, length): steering 1 left, 0 straight, -1 right;
negative length = backward.

Dubins: all six words of Dubins 1957. Reeds-Shepp: the families CSC and CCC of Reeds and Shepp 1990 (equations 8.1 to
8.4) with time-flip, reflection and reversal of the order; the families with four and five segments are left out, so in
rare cases (parking) the curve is some per cent longer than the shortest one. It is always drivable.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_costmap_nav.kernels.compiled import kernel

TWO_PI = 2.0 * np.pi


@kernel
def _turn(angle: float, forward: bool) -> float:
    """Angle in [0, 2 pi) for a curve that may only be driven forward, else in (-pi, pi]."""
    if forward:
        wrapped = angle - TWO_PI * np.floor(angle / TWO_PI)
        return 0.0 if wrapped > TWO_PI - 1e-9 else wrapped
    return float(angle - TWO_PI * np.ceil((angle - np.pi) / TWO_PI))


@kernel
def _left_words(x: float, y: float, yaw: float, forward: bool) -> NDArray[np.float64]:
    """Segments (3 words, 3) of LSL, LSR and LRL from the origin to a pose; nan where a word does not exist."""
    words = np.full((3, 3), np.nan)
    # 1. Centres of the two left circles: LSL and LRL run between them.
    cx, cy = x - np.sin(yaw), y - 1.0 + np.cos(yaw)
    distance, direction = np.hypot(cx, cy), np.arctan2(cy, cx)
    first = _turn(direction, forward)
    words[0] = np.array([first, distance, _turn(yaw - first, forward)])
    if distance <= 4.0:
        arc = 2.0 * np.arcsin(0.25 * distance)
        first = _turn(direction - 0.5 * arc + np.pi, forward)
        middle = TWO_PI - arc if forward else -arc
        words[2] = np.array([first, middle, _turn(yaw - first - arc, forward)])
    # 2. From the left circle to the right one: LSR.
    cx, cy = x + np.sin(yaw), y - 1.0 - np.cos(yaw)
    square = cx * cx + cy * cy
    if square >= 4.0:
        straight = np.sqrt(square - 4.0)
        first = _turn(np.arctan2(cy, cx) + np.arctan2(2.0, straight), forward)
        words[1] = np.array([first, straight, _turn(first - yaw, forward)])
    return words


@kernel
def car_curve(x: float, y: float, yaw: float, reversing: bool) -> NDArray[np.float64]:
    """Shortest of the words from the origin (heading 0) to the pose (x, y [radii], yaw [rad]).

    Returns
    -------
    word : (3, 2) float64
        Rows of (steering, signed length).
    """
    steering = np.array([[1.0, 0.0, 1.0], [1.0, 0.0, -1.0], [1.0, -1.0, 1.0]])
    best = np.inf
    word = np.zeros((3, 2))
    back_x, back_y = x * np.cos(yaw) + y * np.sin(yaw), x * np.sin(yaw) - y * np.cos(yaw)
    for variant in range(8 if reversing else 2):
        mirrored, flipped, backward = variant & 1, variant & 2, variant & 4
        px, py, pyaw = (back_x, back_y, yaw) if backward else (x, y, yaw)
        if flipped:
            px, pyaw = -px, -pyaw
        if mirrored:
            py, pyaw = -py, -pyaw
        words = _left_words(px, py, pyaw, not reversing)
        for k in range(3):
            length = np.abs(words[k]).sum()
            if not length < best - 1e-12:
                continue
            best = length
            for segment in range(3):
                source = 2 - segment if backward else segment
                word[segment, 0] = -steering[k, source] if mirrored else steering[k, source]
                word[segment, 1] = -words[k, source] if flipped else words[k, source]
    return word


@kernel
def drive(x: float, y: float, yaw: float, steering: float, length: float, radius: float) -> tuple[float, float, float]:
    """Pose after a segment of ``length`` [m, negative = backward] at a steering of 1, 0 or -1 on ``radius`` [m]."""
    if steering == 0.0:
        return x + length * np.cos(yaw), y + length * np.sin(yaw), yaw
    turned = yaw + steering * length / radius
    side = steering * radius
    return x + side * (np.sin(turned) - np.sin(yaw)), y - side * (np.cos(turned) - np.cos(yaw)), turned


@kernel
def sample_word(
    x: float, y: float, yaw: float, word: NDArray[np.float64], radius: float, step: float
) -> NDArray[np.float64]:
    """Poses (n, 3) every ``step`` [m] along a word driven from a pose, the start left out, the end included."""
    count = 0
    for segment in range(3):
        count += int(np.ceil(abs(word[segment, 1]) * radius / step - 1e-9))
    poses = np.empty((count, 3))
    filled = 0
    for segment in range(3):
        length = word[segment, 1] * radius
        pieces = int(np.ceil(abs(length) / step - 1e-9))
        for piece in range(pieces):
            px, py, pyaw = drive(x, y, yaw, word[segment, 0], length * (piece + 1) / pieces, radius)
            poses[filled, 0], poses[filled, 1], poses[filled, 2] = px, py, pyaw
            filled += 1
        x, y, yaw = drive(x, y, yaw, word[segment, 0], length, radius)
    return poses
