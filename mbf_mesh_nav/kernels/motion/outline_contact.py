"""Which lethal vertices lie under a robot's outline, at poses and along a motion."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.arrays import BoolArray, FloatArray, IntArray
from mbf_mesh_nav.kernels.compiled import Count, inner_kernel, kernel, plain_kernel
from mbf_mesh_nav.kernels.mesh.surface import Surface
from mbf_mesh_nav.kernels.mesh.surface_disc import vertices_in_disc
from mbf_mesh_nav.kernels.mesh.surface_walk import turned, walk
from mbf_mesh_nav.kernels.mesh.vectors import Vector, cross, difference, dot, row


@inner_kernel
def _is_inside(corners: FloatArray, x: float, y: float) -> bool:
    """Whether a point [m] lies inside an outline (n, 2); crossing number test (Shimrat 1962)."""
    inside = False
    last = len(corners) - 1
    for n in range(len(corners)):
        ax, ay, bx, by = corners[last, 0], corners[last, 1], corners[n, 0], corners[n, 1]
        if (ay > y) != (by > y) and x < ax + (y - ay) / (by - ay) * (bx - ax):
            inside = not inside
        last = n
    return inside


@inner_kernel
def _is_under(corners: FloatArray, point: Vector, course: Vector, normal: Vector, place: Vector) -> bool:
    """Whether a place [m] lies under an outline at ``point``, seen along the ``normal``; it looks along ``course``."""
    offset = difference(place, point)
    return _is_inside(corners, dot(offset, course), dot(offset, cross(normal, course)))


@kernel
def vertex_under_outlines(
    surface: Surface,
    offsets: IntArray,
    neighbours: IntArray,
    lethal: BoolArray,
    faces: IntArray,
    starts: IntArray,
    points: FloatArray,
    courses: FloatArray,
    corners: FloatArray,
    reach: float,
) -> NDArray[np.int32]:
    """A lethal vertex (n,) under the outline at each of many poses, the first that is found; -1 without one.

    Parameters
    ----------
    lethal : (V,) bool
    faces, starts, points, courses : (n,) int32, (n,) int32, (n, 3), (n, 3) float64
        Where the robot stands, the nearest corner of the face, and its heading in the plane of the face.
    corners : (k, 2) float64
        Of the outline [m], x ahead, y left.
    reach : float
        How far [m] the outline reaches.
    """
    found = np.empty(len(faces), dtype=np.int32)
    for n in range(len(faces)):
        found[n] = -1
        point, course, normal = row(points, n), row(courses, n), row(surface.face_normals, faces[n])
        for vertex in vertices_in_disc(surface.vertices, offsets, neighbours, Count(starts[n]), points[n], reach):
            if lethal[vertex] and _is_under(corners, point, course, normal, row(surface.vertices, vertex)):
                found[n] = vertex
                break
    return found


@plain_kernel
def _count_under(
    places: FloatArray, corners: FloatArray, point: Vector, course: Vector, normal: Vector
) -> tuple[int, int]:
    """How many of places (m, 3) [m] lie under an outline, and the last of them."""
    count, last = Count(0), Count(-1)
    for m in range(len(places)):
        if _is_under(corners, point, course, normal, row(places, m)):
            count, last = count + 1, Count(m)
    return count, last


@plain_kernel
def swept_place(
    surface: Surface,
    places: FloatArray,
    face: int,
    point: Vector,
    course: Vector,
    corners: FloatArray,
    stride: float,
    turn: float,
    steps: int,
) -> int:
    """The first of places (m, 3) [m] that makes more of them lie under an outline in a motion than do now; -1: none.

    Parameters
    ----------
    face, point, course
        Where the robot stands, and its direction of motion, or its heading if it turns on the spot.
    corners : (k, 2) float64
        Of the outline [m], x along the course.
    stride, turn : float
        Length [m] and turn [rad] of one step.
    """
    before, _ = _count_under(places, corners, point, course, row(surface.face_normals, face))
    for _ in range(steps):
        if stride > 0.0:
            face, point, course, _ = walk(
                surface.vertices,
                surface.faces,
                surface.face_neighbours,
                surface.face_normals,
                face,
                point,
                course,
                stride,
            )
        normal = row(surface.face_normals, face)
        course = turned(course, normal, turn)
        count, last = _count_under(places, corners, point, course, normal)
        if count > before:
            return last
    return -1
