"""Turning on the spot on a surface, or nearly so: where the outline would sweep an obstacle, and where it is too steep.

When to use: before a motion whose turn has its middle within the robot, see ``pivots``: its corners sweep ground that
a disc of the inscribed radius never touches, and its wheels slip sideways. When not: wider curves, where what the
sides would touch is in the costs, see ``motion_check``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from mbf_abstract.geometry import FloatArray, Pose, Twist
from mbf_abstract.geometry.arithmetic import arctan2, norm
from mbf_abstract.maps.controllers.failures import obstacle_text
from mbf_mesh_nav.arrays import Float32Array
from mbf_mesh_nav.kernels.mesh.surface_walk import tangent, turned
from mbf_mesh_nav.kernels.motion.outline_sweep import sweep
from mbf_mesh_nav.mesh.locate import SurfacePoint
from mbf_mesh_nav.mesh.positions import position_text, vector_of
from mbf_mesh_nav.mesh.topology import MeshTopology

SPACING = 0.05
"""Distance [m] of points on an outline, and of two looks at its farthest corner."""


def pivots(command: Twist, reach: float) -> bool:
    """Whether the middle of a motion's turn lies within ``reach`` [m] of the robot's origin."""
    return abs(command.wz) * reach > command.speed


def slope_at(mesh: MeshTopology, place: SurfacePoint) -> float:
    """Inclination [rad] of the face at a place; 0 = level."""
    return math.acos(min(max(float(mesh.face_normals[place.face, 2]), -1.0), 1.0))


def swept_obstacle(
    mesh: MeshTopology,
    ranks: Float32Array,
    place: SurfacePoint,
    pose: Pose,
    command: Twist,
    duration: float,
    corners: Sequence[Sequence[float]],
    may_overhang: bool = False,
) -> str:
    """Where an outline would touch more lethal ground, or border, than it does now, as a text; empty if nowhere.

    Parameters
    ----------
    ranks : (V,) float32
        How forbidden the vertices are, see ``MeshSnapshot.traversability_rank``.
    place : SurfacePoint
        Where the robot stands, at ``pose``.
    command : Twist
        Kept for ``duration`` [s], or until it has turned once.
    corners : (n, 2) float
        Of the outline [m].
    may_overhang : bool
        Whether it may reach over a border.
    """
    points = points_on(corners)
    distances = norm(points)
    turn = min(abs(command.wz) * duration, 2.0 * math.pi)
    steps = math.ceil(turn * float(distances.max()) / SPACING)
    if steps == 0:
        return ""
    seconds = turn / abs(command.wz) / steps
    course = math.atan2(command.vy, command.vx) if command.speed > 0.0 else 0.0
    outline = np.column_stack([arctan2(points[:, 1], points[:, 0]) - course, distances])
    point, normal = vector_of(place.point), vector_of(mesh.face_normals[place.face])
    ahead = turned(tangent(vector_of(pose.rotation[:, 0]), normal), normal, course)
    step = command.speed * seconds, command.wz * seconds, steps
    touched, corner = sweep(mesh.surface, ranks, place.face, point, ahead, outline, *step, not may_overhang)
    return obstacle_text(position_text(corner)) if touched else ""


def points_on(corners: Sequence[Sequence[float]]) -> FloatArray:
    """Points (n, 2) [m] along an outline, at most ``SPACING`` apart, its corners among them."""
    ends = np.asarray(corners, dtype=np.float64)
    sides = np.roll(ends, -1, axis=0) - ends
    counts = np.maximum(np.ceil(norm(sides) / SPACING).astype(np.int64), 1)
    return np.concatenate(
        [end + np.arange(count)[:, None] / count * side for end, side, count in zip(ends, sides, counts, strict=True)]
    )
