"""Rollouts of many control sequences over the surface, each scored by the critics in one pass.

A rollout turns and walks from face to face (``surface_walk.py``), so its poses are on the surface by construction.
Critics, summed over the steps: *path* (squared distance to the path), *cost* (mean cost of the face), *tilt* (roll and
pitch of the robot over their limits), *turn* (yaw rate); at the end *goal* (path length left) and *heading* (towards
the path ahead). A step into a forbidden face or over a border ends the rollout as a collision.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mbf_mesh_nav.arrays import BoolArray, Float32Array, FloatArray
from mbf_mesh_nav.kernels.compiled import Count, inner_kernel, kernel
from mbf_mesh_nav.kernels.fill import fill
from mbf_mesh_nav.kernels.mesh.surface import Surface
from mbf_mesh_nav.kernels.mesh.surface_walk import turned, walk
from mbf_mesh_nav.kernels.mesh.vectors import Vector, cross, difference, dot, norm, row
from mbf_mesh_nav.kernels.search.forbidden_surface import may_enter, rank_at

PATH, COST, TILT, TURN, GOAL, HEADING = range(6)
"""Positions of the critics in the weights array."""


class SurfacePose(NamedTuple):
    """Where a robot stands: a face, a point [m] and its heading, a unit vector, in it."""

    face: int
    point: Vector
    heading: Vector


class PathAhead(NamedTuple):
    """The path ahead.

    Attributes
    ----------
    points, remaining : (m, 3), (m,) float64
        Evenly sampled, and the path length [m] left from each point.
    facing : float
        1 where the robot looks along the path, -1 where it drives it backward.
    """

    points: FloatArray
    remaining: FloatArray
    facing: float


class Critics(NamedTuple):
    """Weights (6,) float64 in the order of this module's constants, and the roll and the pitch [rad] that cost 1."""

    weights: FloatArray
    roll_limit: float
    pitch_limit: float


@kernel
def score_rollouts(
    surface: Surface,
    costs: Float32Array,
    ranks: Float32Array,
    start: SurfacePose,
    controls: FloatArray,
    period: float,
    path: PathAhead,
    critics: Critics,
    poses: Float32Array,
) -> tuple[FloatArray, BoolArray]:
    """Score every sequence of ``controls``.

    Parameters
    ----------
    costs, ranks : (V,) float32
        The current map; ``forbidden_surface.py`` defines the rank of forbidden surface and where a rollout
        that starts there may go.
    start : SurfacePose
        The robot.
    controls : (n, t, 2) float64
        Forward speed [m/s] and yaw rate [rad/s] per step.
    period : float
        Length of a step [s].
    poses : (3, t, n) float32
        Filled with x, y [m] relative to the start and yaw [rad], seen from above, after each step, a rollout that
        collides staying where it does. Without steps, (3, 0, n), nothing is filled.

    Returns
    -------
    scores : (n,) float64
    collided : (n,) bool
    """
    # A walk takes single arrays: as one argument they would be counted at each call, which takes six times as long.
    vertices, faces = surface.vertices, surface.faces
    face_neighbours, face_normals = surface.face_neighbours, surface.face_normals
    sequence_count, step_count, _ = controls.shape
    scores = np.empty(sequence_count, dtype=np.float64)
    collided = np.empty(sequence_count, dtype=np.bool_)
    fill(collided, Count(0))
    path_points, remaining, facing = path
    weights, roll_limit, pitch_limit = critics
    sin_roll, sin_pitch = math.sin(roll_limit), math.sin(pitch_limit)
    for sequence in range(sequence_count):
        face, point, direction = start
        stands_on = rank_at(vertices, faces, ranks, face, point)
        nearest = Count(0)
        score = 0.0
        for step in range(step_count):
            # 1. Move: turn, then walk (backwards along the opposite direction).
            speed, yaw_rate = controls[sequence, step, 0], controls[sequence, step, 1]
            direction = turned(direction, row(face_normals, face), yaw_rate * period)
            sign = 1.0 if speed >= 0.0 else -1.0
            way = (sign * direction[0], sign * direction[1], sign * direction[2])
            distance = abs(speed) * period
            face, point, way, walked = walk(vertices, faces, face_neighbours, face_normals, face, point, way, distance)
            direction = (sign * way[0], sign * way[1], sign * way[2])
            # 2. Collisions end the rollout.
            comes_to = rank_at(vertices, faces, ranks, face, point)
            if walked < distance - 1e-9 or not may_enter(stands_on, comes_to):
                collided[sequence] = True
                _note(poses, sequence, Count(step), Count(step_count), difference(point, start.point), direction)
                break
            _note(poses, sequence, Count(step), Count(step + 1), difference(point, start.point), direction)
            stands_on = comes_to
            # 3. The path point nearest to here is at or after the one of the step before.
            gap = _squared_distance(path_points, nearest, point)
            while nearest + 1 < len(path_points) and _squared_distance(path_points, nearest + 1, point) <= gap:
                nearest += 1
                gap = _squared_distance(path_points, nearest, point)
            # 4. Critics of the step.
            score += weights[PATH] * gap + weights[TURN] * yaw_rate * yaw_rate
            mean_cost = (costs[faces[face, 0]] + costs[faces[face, 1]] + costs[faces[face, 2]]) / 3.0
            score += weights[COST] * min(mean_cost, 2.0)
            roll = cross(row(face_normals, face), direction)[2] / sin_roll
            pitch = direction[2] / sin_pitch
            score += weights[TILT] * (roll * roll + pitch * pitch)
        # 5. Critics of the end.
        score /= step_count
        score += weights[GOAL] * (remaining[nearest] + math.sqrt(_squared_distance(path_points, nearest, point)))
        target = row(path_points, min(nearest + 3, len(path_points) - 1))
        ahead = difference(target, point)
        length = norm(ahead)
        if length > 0.1:
            score += weights[HEADING] * (1.0 - facing * dot(ahead, direction) / length)
        scores[sequence] = score
    return scores, collided


@inner_kernel
def _squared_distance(points: FloatArray, index: int, point: Vector) -> float:
    offset = difference(row(points, index), point)
    return dot(offset, offset)


@inner_kernel
def _note(poses: Float32Array, sequence: int, begin: int, end: int, offset: Vector, direction: Vector) -> None:
    """Fill the steps from ``begin`` to ``end`` of a sequence with a pose, as far as there is room for them."""
    for step in range(begin, min(end, poses.shape[1])):
        poses[0, step, sequence], poses[1, step, sequence] = offset[0], offset[1]
        poses[2, step, sequence] = math.atan2(direction[1], direction[0])
