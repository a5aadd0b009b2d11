"""One step of the tracker: predict, assign clusters to objects, correct.

The state of an object along x and along y is position and velocity; both axes share one covariance, as noise is the
same in all directions. The model is constant velocity with white noise of acceleration (Bar-Shalom, Li, Kirubarajan
2001, section 6.3.2); the arithmetic is written out, so it is the same on every CPU.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.compiling.decorators import kernel
from mbf_abstract.maps.tracking.kernels.clustering import (
    FREE_X,
    FREE_Y,
    GREATEST_X,
    GREATEST_Y,
    LEAST_X,
    LEAST_Y,
    MEAN_Z,
    POINTS,
)
from mbf_abstract.maps.tracking.kernels.measuring import measure, middle_of

FloatArray = NDArray[np.float64]
Indices = NDArray[np.int64]

STATE_COLUMNS = 25
X, Y, Z, VX, VY, VAR_POSITION, COVARIANCE, VAR_VELOCITY, HALF_X, HALF_Y = range(10)
FIRST_SEEN, LAST_SEEN, SCANS, ANCHOR_X, ANCHOR_Y, ANCHOR_TIME, HAS_MOVED, CLEARED, OFF_X, OFF_Y = range(10, 20)
PACE, COURSE_X, COURSE_Y, FROM_X, FROM_Y = range(20, STATE_COLUMNS)
"""Columns of the state of an object. It stood at its anchor at ``ANCHOR_TIME`` [s], and came there by ``COURSE`` [m];
``HAS_MOVED`` is 0 or 1, and so is ``CLEARED``: whether it was cleared and not seen since. In its last scan it was
``OFF`` [m] away from where it was expected. ``PACE`` [m/s] is its greatest speed of late. Its middle was measured
``FROM`` the only free side of its box, if there was one."""
NOBODY = -1
TURNED = 0.5
"""An object has turned if it is off to the same side in two scans, by this many standard deviations: the geometric mean
of both scans."""


@kernel
def predict(states: FloatArray, seconds: float, acceleration_deviation: float) -> None:
    """Move the ``states`` (n, STATE_COLUMNS) on by some time [s]; the deviation [m/s^2] is that of the noise.

    The pace falls by the deviation: what slows down as usual is not taken to be faster than it is.
    """
    square = seconds * seconds
    q = acceleration_deviation * acceleration_deviation
    for i in range(len(states)):
        state = states[i]
        state[X] += seconds * state[VX]
        state[Y] += seconds * state[VY]
        state[VAR_POSITION] += 2.0 * seconds * state[COVARIANCE] + square * state[VAR_VELOCITY] + 0.25 * q * square**2
        state[COVARIANCE] += seconds * state[VAR_VELOCITY] + 0.5 * q * square * seconds
        state[VAR_VELOCITY] += q * square
        state[PACE] = max(state[PACE] - acceleration_deviation * seconds, 0.0)


@kernel
def assign(states: FloatArray, boxes: FloatArray, sensor: FloatArray, max_size: float, distance: float) -> Indices:
    """Number of the object that each cluster is, or NOBODY: the nearest pairs first, each object once.

    Of equally near pairs the one with the lower object, then with the lower cluster, comes first.

    Parameters
    ----------
    states : (n, STATE_COLUMNS) float64
        Predicted to the time of the scan.
    boxes : (m, BOX_COLUMNS) float64
    sensor : (3,) float64
        Where the scan was taken [m].
    max_size : float
        Clusters longer than this [m] are no objects.
    distance : float
        An object is at most this far [m] from where it was expected.

    Returns
    -------
    (m,) int64
    """
    n, m = len(states), len(boxes)
    squares = np.empty((n, m), dtype=np.float64)
    for i in range(n):
        for j in range(m):
            box = boxes[j]
            width, depth = box[GREATEST_X] - box[LEAST_X], box[GREATEST_Y] - box[LEAST_Y]
            if max(width, depth) > max_size:
                squares[i, j] = np.inf
                continue
            x = middle_of(box[LEAST_X], box[GREATEST_X], max(states[i, HALF_X], 0.5 * width), sensor[0], box[FREE_X])
            y = middle_of(box[LEAST_Y], box[GREATEST_Y], max(states[i, HALF_Y], 0.5 * depth), sensor[1], box[FREE_Y])
            dx, dy, dz = x - states[i, X], y - states[i, Y], box[MEAN_Z] - states[i, Z]
            squares[i, j] = dx * dx + dy * dy + dz * dz
    owners = np.empty(m, dtype=np.int64)
    for j in range(m):
        owners[j] = NOBODY
    while True:
        best, object_, cluster = distance * distance, NOBODY, NOBODY
        for i in range(n):
            for j in range(m):
                if squares[i, j] < best or (squares[i, j] == best and object_ == NOBODY):
                    best, object_, cluster = squares[i, j], i, j
        if object_ == NOBODY:
            return owners
        owners[cluster] = object_
        for j in range(m):
            squares[object_, j] = np.inf
        for i in range(n):
            squares[i, cluster] = np.inf


@kernel
def correct(
    states: FloatArray,
    boxes: FloatArray,
    owners: Indices,
    sensor: FloatArray,
    stamp: float,
    seconds: float,
    deviations: FloatArray,
    shrink: float,
) -> None:
    """Correct the objects by their clusters, those that have turned with more weight on what is seen.

    Parameters
    ----------
    states, boxes, owners, sensor
        As in ``assign``, and its result.
    stamp : float
        Of the scan [s].
    seconds : float
        Time since the last scan [s].
    deviations : (2,) float64
        Of the middle of a cluster [m], and of the change of a velocity where an object turns [m/s].
    shrink : float
        How far [m] the remembered half size of an object may fall to what is seen.
    """
    noise = deviations[0] * deviations[0]
    for j in range(len(boxes)):
        if owners[j] == NOBODY:
            continue
        state, box = states[owners[j]], boxes[j]
        columns_x, columns_y = (X, HALF_X, ANCHOR_X, FROM_X), (Y, HALF_Y, ANCHOR_Y, FROM_Y)
        dx = measure(state, columns_x, box[LEAST_X], box[GREATEST_X], sensor[0], box[FREE_X], shrink)
        dy = measure(state, columns_y, box[LEAST_Y], box[GREATEST_Y], sensor[1], box[FREE_Y], shrink)
        _notice_turn(state, dx, dy, noise, seconds, deviations[1])
        total = state[VAR_POSITION] + noise
        gain, velocity_gain = state[VAR_POSITION] / total, state[COVARIANCE] / total
        state[X] += gain * dx
        state[Y] += gain * dy
        state[VX] += velocity_gain * dx
        state[VY] += velocity_gain * dy
        state[VAR_VELOCITY] -= velocity_gain * state[COVARIANCE]
        state[COVARIANCE] -= gain * state[COVARIANCE]
        state[VAR_POSITION] -= gain * state[VAR_POSITION]
        state[Z] = box[MEAN_Z]
        state[PACE] = max(state[PACE], np.sqrt(state[VX] * state[VX] + state[VY] * state[VY]))
        state[LAST_SEEN] = stamp
        state[SCANS] += 1.0
        state[CLEARED] = 0.0


@kernel
def _notice_turn(
    state: FloatArray, dx: float, dy: float, noise: float, seconds: float, turning_deviation: float
) -> None:
    """Trust the velocity less where an object is off (dx, dy) [m] its place to the same side as in the scan before.

    What a filter that knows the motion is off by is independent from scan to scan (Bar-Shalom, Li, Kirubarajan 2001,
    section 5.4.2); a turn, which it does not know, shows in both. It is taken to have been at the last scan.
    """
    together = dx * state[OFF_X] + dy * state[OFF_Y]
    if together > TURNED * TURNED * (state[VAR_POSITION] + noise):
        q = turning_deviation * turning_deviation
        state[VAR_POSITION] += seconds * seconds * q
        state[COVARIANCE] += seconds * q
        state[VAR_VELOCITY] += q
    state[OFF_X], state[OFF_Y] = dx, dy


@kernel
def note_motion(states: FloatArray, stamp: float, distance: float) -> None:
    """Move the anchors of ``states`` that are farther than ``distance`` [m] from them at ``stamp`` [s]."""
    for i in range(len(states)):
        state = states[i]
        dx, dy = state[X] - state[ANCHOR_X], state[Y] - state[ANCHOR_Y]
        if dx * dx + dy * dy > distance * distance:
            state[ANCHOR_X], state[ANCHOR_Y], state[ANCHOR_TIME] = state[X], state[Y], stamp
            state[COURSE_X], state[COURSE_Y], state[HAS_MOVED] = dx, dy, 1.0


@kernel
def born(box: FloatArray, sensor: FloatArray, stamp: float, state: FloatArray, deviations: FloatArray) -> None:
    """Begin a ``state`` from a box; ``deviations`` (2,) are those of position [m] and velocity [m/s]."""
    half_x, half_y = 0.5 * (box[GREATEST_X] - box[LEAST_X]), 0.5 * (box[GREATEST_Y] - box[LEAST_Y])
    for column in range(STATE_COLUMNS):
        state[column] = 0.0
    state[HALF_X], state[HALF_Y] = half_x, half_y
    state[X] = state[ANCHOR_X] = middle_of(box[LEAST_X], box[GREATEST_X], half_x, sensor[0], box[FREE_X])
    state[Y] = state[ANCHOR_Y] = middle_of(box[LEAST_Y], box[GREATEST_Y], half_y, sensor[1], box[FREE_Y])
    state[FROM_X], state[FROM_Y] = box[FREE_X], box[FREE_Y]
    state[Z] = box[MEAN_Z]
    state[VAR_POSITION], state[VAR_VELOCITY] = deviations[0] * deviations[0], deviations[1] * deviations[1]
    state[FIRST_SEEN] = state[LAST_SEEN] = state[ANCHOR_TIME] = stamp
    state[SCANS] = 1.0


@kernel
def may_begin(boxes: FloatArray, owners: Indices, min_points: int, max_size: float) -> Indices:
    """Clusters of no known object that have enough points and are no longer than ``max_size`` [m], ascending."""
    found = np.empty(len(boxes), dtype=np.int64)
    count = 0
    for j in range(len(boxes)):
        box = boxes[j]
        longest = max(box[GREATEST_X] - box[LEAST_X], box[GREATEST_Y] - box[LEAST_Y])
        if owners[j] == NOBODY and box[POINTS] >= min_points and longest <= max_size:
            found[count] = j
            count += 1
    return found[:count]
