"""Curves of a car between two poses: Dubins (forward only) and Reeds-Shepp (with reversing).

Lengths are in turning radii. A word has five rows of (steering, length): steering 1 left, 0 straight, -1 right;
negative length = backward; rows that a word does not need have length 0.

Dubins: all six words of Dubins 1957. Reeds-Shepp: all families of Reeds and Shepp 1990 (CSC and CCC, equations 8.1 to
8.4; CCCC, 8.7 and 8.8; CCSC, 8.9 and 8.10; CCSCC, 8.11) with time-flip, reflection and reversal of the order. Every
solution of an equation drives to the pose whatever its signs, so the paper's conditions on the signs are not asked.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.compiling.decorators import inner_kernel, kernel, plain_kernel

TWO_PI = 2.0 * np.pi


@plain_kernel
def _turn(angle: float, forward: bool) -> float:
    """Angle in [0, 2 pi) for a curve that may only be driven forward, else in (-pi, pi]."""
    if forward:
        wrapped = angle - TWO_PI * np.floor(angle / TWO_PI)
        # An angle that rounding left just below 0 is 0, not a whole turn, nor backward by the least of numbers.
        return 0.0 if wrapped > TWO_PI - 1e-9 else max(0.0, wrapped)
    return float(angle - TWO_PI * np.ceil((angle - np.pi) / TWO_PI))


STEERING = np.array(
    [
        [1.0, 0.0, 1.0, 0.0, 0.0],  # LSL
        [1.0, 0.0, -1.0, 0.0, 0.0],  # LSR
        [1.0, -1.0, 1.0, 0.0, 0.0],  # LRL
        [1.0, -1.0, 1.0, -1.0, 0.0],  # LRLR, the middle arcs driven in opposite directions
        [1.0, -1.0, 1.0, -1.0, 0.0],  # LRLR, both in the same direction
        [1.0, -1.0, 0.0, 1.0, 0.0],  # LRSL
        [1.0, -1.0, 0.0, -1.0, 0.0],  # LRSR
        [1.0, -1.0, 0.0, 1.0, -1.0],  # LRSLR
    ]
)
"""Steering of the words that begin with a curve to the left; the others mirror or reverse them."""


@inner_kernel
def _three_segments(x: float, y: float, yaw: float, forward: bool, words: NDArray[np.float64]) -> None:
    """Write the lengths of LSL, LSR and LRL from the origin to a pose into the first rows of ``words``."""
    # 1. Centres of the two left circles: LSL and LRL run between them.
    cx, cy = x - np.sin(yaw), y - 1.0 + np.cos(yaw)
    distance, direction = np.hypot(cx, cy), np.arctan2(cy, cx)
    first = _turn(direction, forward)
    words[0, 0], words[0, 1], words[0, 2] = first, distance, _turn(yaw - first, forward)
    if distance <= 4.0:
        arc = 2.0 * np.arcsin(0.25 * distance)
        first = _turn(direction - 0.5 * arc + np.pi, forward)
        middle = TWO_PI - arc if forward else -arc
        words[2, 0], words[2, 1], words[2, 2] = first, middle, _turn(yaw - first - arc, forward)
    # 2. From the left circle to the right one: LSR.
    cx, cy = x + np.sin(yaw), y - 1.0 - np.cos(yaw)
    square = cx * cx + cy * cy
    if square >= 4.0:
        straight = np.sqrt(square - 4.0)
        first = _turn(np.arctan2(cy, cx) + np.arctan2(2.0, straight), forward)
        words[1, 0], words[1, 1], words[1, 2] = first, straight, _turn(first - yaw, forward)


@inner_kernel
def _outer_arcs(u: float, v: float, cx: float, cy: float, yaw: float) -> tuple[float, float]:
    """First and last arc of a CCCC word with the middle arcs ``u`` and ``v`` (tau and omega, equation 8.6)."""
    delta = u - v
    a, b = np.sin(u) - np.sin(delta), np.cos(u) - np.cos(delta) - 1.0
    direction = np.arctan2(cy * a - cx * b, cx * a + cy * b)
    if 2.0 * (np.cos(delta) - np.cos(v) - np.cos(u)) + 3.0 < 0.0:
        direction += np.pi
    first = _turn(direction, False)
    return first, _turn(first - u + v - yaw, False)


@inner_kernel
def _more_segments(x: float, y: float, yaw: float, words: NDArray[np.float64]) -> None:
    """Write the lengths of the two LRLR, LRSL, LRSR and LRSLR into the last rows of ``words``."""
    quarter = 0.5 * np.pi
    # 1. Words that end on a right circle, seen from the centre of the left one.
    cx, cy = x + np.sin(yaw), y - 1.0 - np.cos(yaw)
    distance = np.hypot(cx, cy)
    if distance <= 2.0:
        u = np.arccos(0.25 * (2.0 + distance))
        first, last = _outer_arcs(u, -u, cx, cy, yaw)
        words[3, 0], words[3, 1], words[3, 2], words[3, 3] = first, u, -u, last
    cosine = (20.0 - distance * distance) / 16.0
    if 0.0 <= cosine <= 1.0:
        u = -np.arccos(cosine)
        first, last = _outer_arcs(u, u, cx, cy, yaw)
        words[4, 0], words[4, 1], words[4, 2], words[4, 3] = first, u, u, last
    if distance >= 2.0:
        first = _turn(np.arctan2(cx, -cy), False)
        words[6, 0], words[6, 1], words[6, 2] = first, -quarter, 2.0 - distance
        words[6, 3] = _turn(first + quarter - yaw, False)
        straight = 4.0 - np.sqrt(distance * distance - 4.0)
        if straight <= 0.0:
            first = _turn(np.arctan2((4.0 - straight) * cx - 2.0 * cy, -2.0 * cx + (straight - 4.0) * cy), False)
            words[7, 0], words[7, 1], words[7, 2], words[7, 3] = first, -quarter, straight, -quarter
            words[7, 4] = _turn(first - yaw, False)
    # 2. LRSL ends on a left circle.
    cx, cy = x - np.sin(yaw), y - 1.0 + np.cos(yaw)
    distance = np.hypot(cx, cy)
    if distance >= 2.0:
        straight = np.sqrt(distance * distance - 4.0)
        first = _turn(np.arctan2(cy, cx) + np.arctan2(straight, -2.0), False)
        words[5, 0], words[5, 1], words[5, 2] = first, -quarter, 2.0 - straight
        words[5, 3] = _turn(yaw - quarter - first, False)


@kernel
def car_curve(x: float, y: float, yaw: float, reversing: bool) -> NDArray[np.float64]:
    """Shortest of the words from the origin (heading 0) to the pose (x, y [radii], yaw [rad]).

    Returns
    -------
    word : (5, 2) float64
        Rows of (steering, signed length).
    """
    best = np.inf
    word = np.zeros((5, 2))
    words = np.empty((8, 5))
    back_x, back_y = x * np.cos(yaw) + y * np.sin(yaw), x * np.sin(yaw) - y * np.cos(yaw)
    for variant in range(8 if reversing else 2):
        mirrored, flipped, backward = variant & 1, variant & 2, variant & 4
        px, py, pyaw = (back_x, back_y, yaw) if backward else (x, y, yaw)
        if flipped:
            px, pyaw = -px, -pyaw
        if mirrored:
            py, pyaw = -py, -pyaw
        words[:, :3], words[:, 3:] = np.inf, 0.0  # inf: the word does not exist
        _three_segments(px, py, pyaw, not reversing, words)
        if reversing:
            _more_segments(px, py, pyaw, words)
        for k in range(8):
            length = np.abs(words[k]).sum()
            if not length < best - 1e-12:
                continue
            best = length
            for segment in range(5):
                source = 4 - segment if backward else segment
                word[segment, 0] = -STEERING[k, source] if mirrored else STEERING[k, source]
                word[segment, 1] = -words[k, source] if flipped else words[k, source]
    return word


@kernel
def curve_between(
    start: NDArray[np.float64], end: NDArray[np.float64], radius: float, reversing: bool
) -> NDArray[np.float64]:
    """Shortest word (5, 2) of a car with the turning circle ``radius`` [m] between two poses (x, y, yaw)."""
    c, s = np.cos(start[2]), np.sin(start[2])
    dx, dy = end[0] - start[0], end[1] - start[1]
    return car_curve((c * dx + s * dy) / radius, (c * dy - s * dx) / radius, end[2] - start[2], reversing)


@plain_kernel
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
    for segment in range(word.shape[0]):
        count += int(np.ceil(abs(word[segment, 1]) * radius / step - 1e-9))
    poses = np.empty((count, 3))
    filled = 0
    for segment in range(word.shape[0]):
        length = word[segment, 1] * radius
        pieces = int(np.ceil(abs(length) / step - 1e-9))
        for piece in range(pieces):
            px, py, pyaw = drive(x, y, yaw, word[segment, 0], length * (piece + 1) / pieces, radius)
            poses[filled, 0], poses[filled, 1], poses[filled, 2] = px, py, pyaw
            filled += 1
        x, y, yaw = drive(x, y, yaw, word[segment, 0], length, radius)
    return poses
