"""Many trajectories at once: velocities out of a nominal sequence and noise, integrated to poses, and their mean.

Arrays are time-major, (steps, samples) float32, so that the inner loops run over samples and vectorise. Positions are
relative to the robot (axes of the map), which keeps float32 exact to micrometres.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.compiling.decorators import kernel, plain_kernel

Float32Array = NDArray[np.float32]


@plain_kernel
def _clip_together(
    velocities: Float32Array,
    now: Float32Array,
    low: Float32Array,
    high: Float32Array,
    change: Float32Array,
    top_speed: np.float32,
) -> None:
    """Limit (vx, vy) of velocities (3, steps, samples) as vectors: range and ``top_speed`` [m/s], then the change."""
    one = np.float32(1.0)
    for t in range(velocities.shape[1]):
        forward, left = velocities[0, t], velocities[1, t]
        for n in range(velocities.shape[2]):
            vx, vy = min(max(forward[n], low[0]), high[0]), min(max(left[n], low[1]), high[1])
            speed = np.sqrt(vx * vx + vy * vy)
            share = top_speed / speed if speed > top_speed else one
            last_vx = velocities[0, t - 1, n] if t > 0 else now[0]
            last_vy = velocities[1, t - 1, n] if t > 0 else now[1]
            ahead, aside = share * vx - last_vx, share * vy - last_vy
            gain, side_gain = ahead / change[0], aside / change[1]
            parts = max(np.sqrt(gain * gain + side_gain * side_gain), one)
            forward[n], left[n] = last_vx + ahead / parts, last_vy + aside / parts


@kernel
def clip_velocities(
    velocities: Float32Array,
    now: Float32Array,
    low: Float32Array,
    high: Float32Array,
    change: Float32Array,
    min_turning_radius: float,
    top_speed: float,
) -> None:
    """Limit velocities (3, steps, samples: vx, vy, wz) in place: range, change per step, turning radius, speed.

    A robot that can go sideways accelerates along its velocity: ``change`` holds for (vx, vy) together, as the half
    axes of an ellipse.

    Parameters
    ----------
    now : (3,) float32
        Measured velocity before the first step.
    low, high, change : (3,) float32
        Range of each component and its largest change from step to step.
    min_turning_radius : float
        abs(wz) is at most abs(vx) / radius [m]; 0 = can turn in place.
    top_speed : float
        Limit [m/s] of the length of (vx, vy), which keeps its direction; looked at where the robot can go sideways.
    """
    _, steps, samples = velocities.shape
    per_radius = np.float32(1.0 / min_turning_radius) if min_turning_radius > 0.0 else np.float32(0.0)
    goes_sideways = low[1] != high[1]
    if goes_sideways:
        _clip_together(velocities, now, low, high, change, np.float32(top_speed))
    for component in range(3):
        if goes_sideways and component < 2:
            continue
        lowest, highest, delta = low[component], high[component], change[component]
        if lowest == highest:  # a direction this robot does not have
            velocities[component] = lowest
            continue
        last = np.full(samples, now[component], dtype=np.float32)
        for t in range(steps):
            row = velocities[component, t]
            for n in range(samples):  # plain comparisons, because min and max of floats do not vectorise
                value = row[n]
                most, least = last[n] + delta, last[n] - delta
                value = most if value > most else value
                value = least if value < least else value
                value = highest if value > highest else value
                value = lowest if value < lowest else value
                row[n] = value
                last[n] = value
    if per_radius > 0.0:
        for t in range(steps):
            forward, turn = velocities[0, t], velocities[2, t]
            for n in range(samples):
                limit = abs(forward[n]) * per_radius
                turn[n] = min(max(turn[n], -limit), limit)


@kernel
def integrate(velocities: Float32Array, yaw: float, dt: float, poses: Float32Array) -> None:
    """Fill poses (3, steps, samples: x, y, yaw) with those after each step of body velocities, from (0, 0, ``yaw``).

    The heading is carried as a rotated unit vector whose turn per step uses the sine's and cosine's series up to the
    fifth power: exact to 1e-6 rad for up to half a radian a step, and free of library calls, so the loops vectorise.
    Each step goes along the mean of its two headings (the trapezoidal rule), to 0.03 mm of the arc at 0.5 m/s, 2 rad/s
    and 0.05 s; along the first of them it would be 1 mm beside it each time.
    """
    _, steps, samples = velocities.shape
    cosine = np.full(samples, np.float32(np.cos(yaw)), dtype=np.float32)
    sine = np.full(samples, np.float32(np.sin(yaw)), dtype=np.float32)
    x, y = np.zeros(samples, dtype=np.float32), np.zeros(samples, dtype=np.float32)
    heading = np.full(samples, np.float32(yaw), dtype=np.float32)
    h = np.float32(dt)
    one, half = np.float32(1.0), np.float32(0.5)
    sixth, fourth_factorial, fifth_factorial = np.float32(1 / 6), np.float32(1 / 24), np.float32(1 / 120)
    for t in range(steps):
        vx, vy, wz = velocities[0, t], velocities[1, t], velocities[2, t]
        out_x, out_y, out_yaw = poses[0, t], poses[1, t], poses[2, t]
        for n in range(samples):
            c, s = cosine[n], sine[n]
            turn = wz[n] * h
            square = turn * turn
            turn_cosine = one - square * (half - square * fourth_factorial)
            turn_sine = turn * (one - square * (sixth - square * fifth_factorial))
            cosine[n] = c * turn_cosine - s * turn_sine
            sine[n] = s * turn_cosine + c * turn_sine
            mean_cosine, mean_sine = half * (c + cosine[n]), half * (s + sine[n])
            x[n] += (mean_cosine * vx[n] - mean_sine * vy[n]) * h
            y[n] += (mean_sine * vx[n] + mean_cosine * vy[n]) * h
            heading[n] += turn
            out_x[n], out_y[n], out_yaw[n] = x[n], y[n], heading[n]


@plain_kernel
def add_noise(nominal: Float32Array, noise: Float32Array, deviation: Float32Array, velocities: Float32Array) -> None:
    """Fill velocities (3, steps, samples) with ``nominal`` (3, steps) plus noise times deviation (3,).

    A direction without deviation is one that the robot does not have: ``clip_velocities`` fills it. The output is an
    argument so that a controller can use one buffer in all cycles.
    """
    components, steps, samples = noise.shape
    for component in range(components):
        scale = deviation[component]
        if scale == 0.0:
            continue
        for t in range(steps):
            base = nominal[component, t]
            row, out = noise[component, t], velocities[component, t]
            for n in range(samples):
                out[n] = base + scale * row[n]


LANES = 64  # parts of a sum; long enough that the compiler's check for overlapping arrays pays


@kernel
def blend(velocities: Float32Array, costs: Float32Array, temperature: float, smoothing: Float32Array) -> Float32Array:
    """Mean of all samples, weighted by exp(-cost / temperature) (Williams 2018, algorithm 1), then smoothed in time.

    Sums run in ``LANES`` interleaved parts: an order that vectorises and is the same on every CPU.

    Parameters
    ----------
    velocities : (3, steps, samples) float32
    costs : (samples,) float32
    temperature : float
        Unit of the costs.
    smoothing : (steps, steps) float32
        Applied to each row of the mean from the right.

    Returns
    -------
    (3, steps) float32
    """
    components, steps, samples = velocities.shape
    # 1. Weights.
    whole = samples - samples % LANES
    lowest = costs.min()
    weights = np.empty(samples, dtype=np.float32)
    total = 0.0
    for n in range(samples):
        weight = math.exp(-(costs[n] - lowest) / temperature)
        weights[n] = weight
        total += weight
    # 2. Weighted means of every component and step.
    mean = np.empty((components, steps), dtype=np.float32)
    lanes = np.empty(LANES, dtype=np.float32)
    for component in range(components):
        for t in range(steps):
            row = velocities[component, t]
            lanes[:] = 0.0
            for begin in range(0, whole, LANES):
                for lane in range(LANES):
                    lanes[lane] += weights[begin + lane] * row[begin + lane]
            weighted = 0.0
            for lane in range(LANES):
                weighted += lanes[lane]
            for n in range(whole, samples):
                weighted += weights[n] * row[n]
            mean[component, t] = weighted / total
    # 3. Smoothing along time.
    smooth = np.zeros((components, steps), dtype=np.float32)
    for component in range(components):
        for t in range(steps):
            for source in range(steps):
                smooth[component, t] += mean[component, source] * smoothing[source, t]
    return smooth
