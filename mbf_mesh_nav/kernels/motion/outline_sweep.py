"""What a robot's outline comes to stand on while it turns on a surface."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.arrays import Float32Array, FloatArray, IntArray
from mbf_mesh_nav.kernels.compiled import kernel, plain_kernel
from mbf_mesh_nav.kernels.mesh.surface import Surface
from mbf_mesh_nav.kernels.mesh.surface_walk import turned, walk
from mbf_mesh_nav.kernels.mesh.vectors import Vector, difference, dot, row
from mbf_mesh_nav.kernels.search.forbidden_surface import LETHAL_RANK

Flags = NDArray[np.bool_]

ROUNDING = 1e-6
"""A walk over the surface that is shorter than asked for by more than this [m] was ended by a border."""


@plain_kernel
def touching(
    vertices: FloatArray,
    faces: IntArray,
    face_neighbours: IntArray,
    face_normals: FloatArray,
    ranks: Float32Array,
    face: int,
    point: Vector,
    course: Vector,
    outline: FloatArray,
    border: bool,
    touches: Flags,
) -> Vector:
    """Note which points (n, 2: bearing off the course [rad], distance [m]) of an outline are on lethal ground or off.

    Off the surface counts if ``border``. Ground is lethal where the nearest corner of its face is. Writes ``touches``
    (n,); returns the last such point.
    """
    normal, last = row(face_normals, face), point
    for n in range(len(outline)):
        direction = turned(course, normal, outline[n, 0])
        at_face, at, _, walked = walk(
            vertices, faces, face_neighbours, face_normals, face, point, direction, outline[n, 1]
        )
        is_off = walked < outline[n, 1] - ROUNDING
        nearest, rank = np.inf, np.float32(0.0)
        for side in range(3):
            off = difference(at, row(vertices, faces[at_face, side]))
            square = dot(off, off)
            if square < nearest:
                nearest, rank = square, ranks[faces[at_face, side]]
        touches[n] = (border and is_off) or rank >= LETHAL_RANK
        if touches[n]:
            last = at
    return last


@kernel
def sweep(
    surface: Surface,
    ranks: Float32Array,
    face: int,
    point: Vector,
    course: Vector,
    outline: FloatArray,
    stride: float,
    turn: float,
    steps: int,
    border: bool,
) -> tuple[bool, Vector]:
    """Whether more of an outline touches lethal ground, or the border, in the course of a turn than before it.

    Parameters
    ----------
    ranks : (V,) float32
        How forbidden the vertices are.
    face, point, course
        Where the robot stands, and its direction of motion, or its heading if it turns on the spot.
    outline : (n, 2) float64
        Bearing [rad] off the course and distance [m] of points on it.
    stride, turn : float
        Length [m] and turn [rad] of one step.
    border : bool
        Whether a point past the border touches it.

    Returns
    -------
    touched : bool
    point : (3,) float
        Where, if so.
    """
    vertices, faces = surface.vertices, surface.faces
    face_neighbours, face_normals = surface.face_neighbours, surface.face_normals
    touches = np.empty(len(outline), dtype=np.bool_)
    how = outline, border, touches
    touching(vertices, faces, face_neighbours, face_normals, ranks, face, point, course, *how)
    before = touches.sum()
    for _ in range(steps):
        if stride > 0.0:
            face, point, course, _ = walk(vertices, faces, face_neighbours, face_normals, face, point, course, stride)
        course = turned(course, row(face_normals, face), turn)
        place = touching(vertices, faces, face_neighbours, face_normals, ranks, face, point, course, *how)
        if touches.sum() > before:
            return True, place
    return False, point
