"""Sampled motions of the robot among objects that keep their velocities: how near each comes to any of them, and when.

Arrays are time-major, (steps, samples) float32, so that the inner loops run over samples and vectorise.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.compiling.decorators import kernel

Float32Array = NDArray[np.float32]
Int32Array = NDArray[np.int32]

OBJECT_COLUMNS = 5
X, Y, VX, VY, RADIUS = range(OBJECT_COLUMNS)
"""Columns of an object: place [m] relative to the robot, velocity [m/s], radius [m]; along the axes of the map."""
NOBODY = -1
"""Instead of the row of an object."""


def meet(
    poses: Float32Array,
    yaw: float,
    step_time: float,
    stride: int,
    box: Float32Array,
    objects: Float32Array,
    horizon: float,
    margin: float,
) -> tuple[Float32Array, Int32Array]:
    """What each motion makes worse than a robot that stays where it is: contacts, and less room than the margin.

    At each look nearness to an object is 1 in contact and falls to 0 at the margin. A motion costs the most that its
    nearness exceeds that of the robot that stays, less the later it is: from 1 now to 0 at the horizon.

    Parameters
    ----------
    poses : (3, steps, samples) float32
        x, y [m] relative to the robot, axes of the map, and yaw [rad] after each step.
    yaw : float
        Of the robot now [rad].
    step_time : float
        Length of a step [s].
    stride : int
        Every how many steps to look.
    box : (5,) float32
        Back, front, right and left side of the outline in the robot's frame [m], and the radius that it is grown by.
    objects : (k, OBJECT_COLUMNS) float32
        All of this moment.
    horizon : float
        Later encounters [s] do not count.
    margin : float
        [m], above 0.

    Returns
    -------
    costs : (samples,) float32
        From 0 to 1.
    touched : (samples,) int32
        Row of the first object that the motion leads into at a time when the robot that stays is not touched by it;
        NOBODY if there is none.
    """
    samples = poses.shape[2]
    costs, touched = np.zeros(samples, np.float32), np.full(samples, NOBODY, np.int32)
    directions = np.zeros((2, samples), np.float32)
    write_encounters(poses, yaw, step_time, stride, box, objects, horizon, margin, costs, touched, directions)
    return costs, touched


@kernel
def write_encounters(
    poses: Float32Array,
    yaw: float,
    step_time: float,
    stride: int,
    box: Float32Array,
    objects: Float32Array,
    horizon: float,
    margin: float,
    costs: Float32Array,
    touched: Int32Array,
    directions: Float32Array,
) -> None:
    """Write what ``meet`` returns; ``costs`` begin as 0, ``touched`` as NOBODY, ``directions`` (2, samples) is memory.

    Made here, each of these arrays would cost a first start as much as a short kernel.
    """
    _, steps, samples = poses.shape
    if len(objects) == 0:
        return
    back, front, right, left, radius = box[0], box[1], box[2], box[3], box[4]
    length, width = max(-back, front), max(-right, left)  # as far as the outline reaches from the centre
    extent = np.sqrt(length * length + width * width) + radius + np.float32(margin)
    per_margin, zero, one = np.float32(1.0 / margin), np.float32(0.0), np.float32(1.0)
    cosine_now, sine_now = np.float32(np.cos(yaw)), np.float32(np.sin(yaw))
    is_disc = back == zero and front == zero and right == zero and left == zero
    cosines, sines = directions[0], directions[1]
    for t in range(stride - 1, steps, stride):
        time = np.float32((t + 1) * step_time)
        if time >= horizon:
            break
        urgency = one - time / np.float32(horizon)
        xs, ys, yaws = poses[0, t], poses[1, t], poses[2, t]
        # 1. How far the robot can be by now, and how it looks there.
        farthest = zero
        for n in range(samples):
            square = xs[n] * xs[n] + ys[n] * ys[n]
            farthest = square if square > farthest else farthest
        farthest = np.sqrt(farthest)
        for n in range(samples):
            cosines[n], sines[n] = (one, zero) if is_disc else (np.cos(yaws[n]), np.sin(yaws[n]))
        for k in range(len(objects)):
            # 2. Where the object is by now; nobody meets one that is out of reach.
            x, y = objects[k, X] + time * objects[k, VX], objects[k, Y] + time * objects[k, VY]
            if np.sqrt(x * x + y * y) > farthest + extent + objects[k, RADIUS]:
                continue
            # 3. The robot that stays.
            ahead, aside = cosine_now * x + sine_now * y, cosine_now * y - sine_now * x
            beyond_x = max(max(back - ahead, ahead - front), zero)
            beyond_y = max(max(right - aside, aside - left), zero)
            reach = radius + objects[k, RADIUS]
            gap = np.sqrt(beyond_x * beyond_x + beyond_y * beyond_y) - reach
            staying = min(max(one - gap * per_margin, zero), one)
            is_touched = gap < zero
            # 4. Each motion against it; plain comparisons, because min and max of floats do not vectorise.
            for n in range(samples):
                dx, dy = x - xs[n], y - ys[n]
                ahead, aside = cosines[n] * dx + sines[n] * dy, cosines[n] * dy - sines[n] * dx
                beyond_x = back - ahead if back > ahead else (ahead - front if ahead > front else zero)
                beyond_y = right - aside if right > aside else (aside - left if aside > left else zero)
                gap = np.sqrt(beyond_x * beyond_x + beyond_y * beyond_y) - reach
                near = one - gap * per_margin
                near = one if near > one else near
                cost = urgency * (near - staying)
                costs[n] = cost if cost > costs[n] else costs[n]
                touched[n] = k if touched[n] == NOBODY and gap < zero and not is_touched else touched[n]
