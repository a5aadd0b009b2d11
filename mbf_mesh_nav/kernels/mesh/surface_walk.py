"""Walking straight ahead on the surface: exact edge crossings, the direction unfolded from face to face.

This is how a robot's motion is predicted on a mesh: within a face it is a line, at an edge the direction keeps its
angle to the edge (the two faces are unfolded into one plane), at a border the walk ends.
"""

from __future__ import annotations

import math

import numpy as np

from mbf_mesh_nav.arrays import FloatArray, IntArray
from mbf_mesh_nav.kernels.compiled import Count, plain_kernel
from mbf_mesh_nav.kernels.mesh.vectors import Vector, cross, difference, dot, row

_MAX_CROSSINGS = 200


@plain_kernel
def tangent(direction: Vector, normal: Vector) -> Vector:
    """Project a direction onto a face's plane and make it a unit vector; any tangent if it is along the normal."""
    along = dot(direction, normal)
    x, y, z = direction[0] - along * normal[0], direction[1] - along * normal[1], direction[2] - along * normal[2]
    length = math.sqrt(x * x + y * y + z * z)
    if length < 1e-9:
        x, y, z = (0.0, normal[2], -normal[1]) if abs(normal[0]) < 0.9 else (normal[2], 0.0, -normal[0])
        length = math.sqrt(x * x + y * y + z * z)
    return x / length, y / length, z / length


@plain_kernel
def turned(direction: Vector, normal: Vector, angle: float) -> Vector:
    """Turn a tangent direction left (counter-clockwise seen from above) by ``angle`` [rad]."""
    left = cross(normal, direction)
    c, s = math.cos(angle), math.sin(angle)
    return (c * direction[0] + s * left[0], c * direction[1] + s * left[1], c * direction[2] + s * left[2])


@plain_kernel
def walk(
    vertices: FloatArray,
    faces: IntArray,
    face_neighbours: IntArray,
    face_normals: FloatArray,
    face: int,
    point: Vector,
    direction: Vector,
    distance: float,
) -> tuple[int, Vector, Vector, float]:
    """Walk ``distance`` [m] straight ahead over the surface.

    Parameters
    ----------
    vertices, faces, face_neighbours, face_normals
        The mesh; (V, 3) float64 [m], (F, 3) int32, (F, 3) int32, (F, 3) float64.
    face, point, direction
        Where to start: a face, a point in it [m], a unit vector in its plane.
    distance : float
        At least 0.

    Returns
    -------
    face, point, direction
        Where the walk ends.
    walked : float
        Less than ``distance`` where a border stopped the walk [m].
    """
    left_to_walk = distance
    for _ in range(_MAX_CROSSINGS):
        normal = row(face_normals, face)
        nearest, exit_side = np.inf, -1
        exit_edge = (0.0, 0.0, 0.0)
        for side in range(3):
            a, b = row(vertices, Count(faces[face, side])), row(vertices, Count(faces[face, (side + 1) % 3]))
            edge = difference(b, a)
            inward = cross(normal, edge)
            rate = dot(direction, inward)
            if rate < 0.0:
                height = dot(difference(point, a), inward)
                ahead = max(-height / rate, 0.0)
                if ahead < nearest:
                    nearest, exit_side, exit_edge = ahead, side, edge
        step = min(nearest, left_to_walk)
        point = (point[0] + step * direction[0], point[1] + step * direction[1], point[2] + step * direction[2])
        left_to_walk -= step
        if nearest >= left_to_walk + step or exit_side < 0:
            break
        following = Count(face_neighbours[face, exit_side])
        if following < 0:
            break
        # Unfold: keep the part along the edge, carry the part across it over into the next face.
        length = math.sqrt(dot(exit_edge, exit_edge))
        unit = (exit_edge[0] / length, exit_edge[1] / length, exit_edge[2] / length)
        along = dot(direction, unit)
        across = dot(direction, cross(normal, unit))
        sideways = cross(row(face_normals, following), unit)
        direction = (
            along * unit[0] + across * sideways[0],
            along * unit[1] + across * sideways[1],
            along * unit[2] + across * sideways[2],
        )
        face = following
    return face, point, direction, distance - left_to_walk
