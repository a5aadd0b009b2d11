"""From sampled velocities to scored trajectories: what the sampling controllers (DWA, MPPI) share."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import Twist
from mbf_abstract.maps.controllers.inertia import InertiaParameters
from mbf_costmap_nav.control.path_handling import ControlCycle
from mbf_costmap_nav.critics import CRITICS, CriticParameters, Rollouts
from mbf_costmap_nav.critics.obstacle_critic import COLLISION
from mbf_costmap_nav.grid.costmap import INSCRIBED, LETHAL
from mbf_costmap_nav.grid.footprint import Footprint
from mbf_costmap_nav.kernels.control.rollout import integrate

FloatArray = NDArray[np.float64]
Float32Array = NDArray[np.float32]

PATH_SPACING = 0.1
"""Distance [m] of the path points the critics compare with."""
SMALL = 1e-20
"""A half turn [rad] whose sine is as large as itself."""
MOST_STEPS = 200
"""So many steps of a robot that brakes are looked at."""


def roll_out(
    cycle: ControlCycle,
    velocities: Float32Array,
    dt: float,
    reach: float,
    poses: Float32Array | None = None,
    turning_radius: float = 0.0,
) -> Rollouts:
    """Integrate velocities (3, steps, samples) and lay out the path ahead for the critics.

    Parameters
    ----------
    poses : (3, steps, samples) float32, optional
        Buffer for the trajectories, overwritten.
    dt : float
        Length of a step [s].
    reach : float
        Farthest a sample can get [m]; the path is laid out a little beyond.
    turning_radius : float
        Of the tightest curve the velocities hold [m]; 0 = they may turn on the spot.
    """
    pose, tracker = cycle.request.pose, cycle.tracker
    points, free = _path_ahead(cycle, 1.3 * reach + 6 * PATH_SPACING)
    goal = tracker.goal
    poses = np.empty_like(velocities) if poses is None else poses
    integrate(velocities, pose.yaw, dt, poses)
    return Rollouts(
        poses,
        velocities,
        (points - (pose.x, pose.y)).astype(np.float32),
        free,
        PATH_SPACING,
        tracker.remaining,
        (goal.x - pose.x, goal.y - pose.y, goal.yaw),
        tracker.on_last_section,
        tracker.driving_backward,
        cycle.goal_tolerance,
        cycle.costmap,
        (pose.x, pose.y),
        footprint_discs(cycle.footprint.footprint),
        turning_radius,
        cycle.touches,
    )


def _path_ahead(cycle: ControlCycle, length: float) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Points (m, 2) of the path over ``length`` [m] ahead of the progress, or to its end, and which of them are free.

    Beyond a cusp they continue straight; obstacles there are ignored.
    """
    tracker = cycle.tracker
    on_path = min(length, tracker.to_cusp)
    along = tracker.progress + np.concatenate((np.arange(0.0, on_path, PATH_SPACING), (on_path,)))
    points = tracker.points_at(along)
    free = _free_points(cycle, points)
    if tracker.on_last_section or on_path == length:
        return points, free
    step = points[-1] - tracker.point_at(tracker.next_cusp - PATH_SPACING)
    beyond = np.arange(1.0, math.ceil((length - on_path) / PATH_SPACING) + 1.0)
    run_out = points[-1] + beyond[:, None] * step
    return np.concatenate([points, run_out]), np.concatenate([free, np.ones(len(run_out), dtype=bool)])


def _free_points(cycle: ControlCycle, points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(m,) bool: whether path points lie in cells below the inscribed cost; unknown and outside are free."""
    cells, inside = cycle.costmap.world_to_cells(points)
    if inside.all():
        costs = cycle.costmap.cells[cells[:, 1], cells[:, 0]]
        return np.asarray((costs < INSCRIBED) | (costs > LETHAL))
    free = np.ones(len(points), dtype=bool)
    costs = cycle.costmap.cells[cells[inside, 1], cells[inside, 0]]
    free[inside] = (costs < INSCRIBED) | (costs > LETHAL)
    return free


def score(weights: CriticParameters, rollouts: Rollouts) -> Float32Array:
    """Sum (samples,) of the weighted critics; a collision costs ``COLLISION``, whatever the obstacles' weight."""
    total = np.zeros(rollouts.samples, dtype=np.float32)
    for name, critic in CRITICS.items():
        weight = getattr(weights, name)
        if weight == 0.0 and name != "obstacle":
            continue
        cost = critic(rollouts)
        if cost is not None:
            total += np.float32(weight) * cost
    total[rollouts.collided] += np.float32(COLLISION)
    return total


def footprint_discs(footprint: Footprint) -> Float32Array:
    """Offsets (k,) [m] along x of discs of the inscribed radius that cover the footprint's middle line."""
    if len(footprint.vertices) < 3:
        return np.zeros(1, dtype=np.float32)
    front, back = footprint.vertices[:, 0].max(), footprint.vertices[:, 0].min()
    first, last = back + footprint.inscribed_radius, front - footprint.inscribed_radius
    if last - first < 0.25 * footprint.inscribed_radius:
        return np.zeros(1, dtype=np.float32)
    count = 1 + math.ceil((last - first) / footprint.inscribed_radius)
    return np.linspace(first, last, count).astype(np.float32)


def is_free(cycle: ControlCycle, velocities: Float32Array | FloatArray, dt: float) -> bool:
    """Whether the full footprint is free of lethal cells while the robot drives velocities (3, steps) of ``dt`` [s].

    Along exact arcs in float64: the rollouts end up to 0.03 mm a step beside them, which is enough to touch something.
    Where the footprint touches some already, they must lead out, see ``ControlCycle.first_collision``.
    """
    pose = cycle.request.pose
    return cycle.first_collision(driven_poses((pose.x, pose.y, pose.yaw), velocities.T.astype(np.float64), dt)) < 0


def stops_free(
    cycle: ControlCycle, velocity: FloatArray, braking: FloatArray, dt: float, looked_at: float = 0.0
) -> bool:
    """Whether a robot that is stopped after a step of ``dt`` [s] with a velocity touches nothing until it stands.

    Where this holds for every command, no robot whose next motions are all refused rolls into something. One that
    touches something already has to get out of it, not to stop.

    Parameters
    ----------
    velocity, braking : (3,) float64
        vx, vy, wz [m/s, rad/s], and by how much each is slowed down [m/s^2, rad/s^2].
    looked_at : float
        So long ahead [s] its arc is free; one that stands after half of that stops on it, as good as.
    """
    stands_after = float(np.max(np.abs(velocity) / braking))
    if cycle.touches or stands_after <= 0.5 * looked_at:
        return True
    steps = min(math.ceil(stands_after / dt) + 1, MOST_STEPS)
    speeds = np.maximum(np.abs(velocity)[:, None] - (braking * dt)[:, None] * np.arange(steps), 0.0)
    return is_free(cycle, np.sign(velocity)[:, None] * speeds, dt)


def brakes_free(cycle: ControlCycle, velocity: FloatArray, inertia: InertiaParameters) -> bool:
    """Whether a robot that brakes along the arc of a command, after a period of it, touches nothing until it stands.

    So it is driven where none of its next motions is free. One that touches something already has to get out of it.

    Parameters
    ----------
    velocity : (3,) float64
        The command: vx, vy, wz [m/s, rad/s].
    """
    stands_after = inertia.stops_after(Twist.planar(*velocity.tolist()))
    if cycle.touches or stands_after == 0.0:
        return True
    dt = inertia.control_period
    steps = min(math.ceil(stands_after / dt) + 1, MOST_STEPS)
    shares = np.clip(1.0 - dt / stands_after * (np.arange(steps) - 0.5), 0.0, 1.0)
    return is_free(cycle, velocity[:, None] * shares, dt)


def driven_poses(pose: tuple[float, float, float], velocities: FloatArray, dt: float) -> FloatArray:
    """Poses (n, 3: x, y, yaw) after each of velocities (n, 3: vx, vy, wz) kept for ``dt`` [s], from ``pose`` on."""
    forward, left, turns = velocities[:, 0], velocities[:, 1], velocities[:, 2] * dt
    poses = np.empty((len(turns), 3))
    poses[:, 2] = pose[2] + turns.cumsum()
    headings = poses[:, 2] - 0.5 * turns  # of the chords
    halves = math.pi * (turns / (2.0 * math.pi))
    halves[halves == 0.0] = SMALL
    chords = dt * (np.sin(halves) / halves)
    c, s = np.cos(headings), np.sin(headings)
    poses[:, 0] = pose[0] + (chords * (forward * c - left * s)).cumsum()
    poses[:, 1] = pose[1] + (chords * (forward * s + left * c)).cumsum()
    return poses
