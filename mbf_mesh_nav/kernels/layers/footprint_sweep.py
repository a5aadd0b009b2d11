"""How far a four-wheeled footprint uses the limits of its tilt anywhere on a straight drive, not at samples of it.

Seen from above every wheel moves along a line, so its height is linear as long as it stays on its face. The drive is
swept from one change of a face to the next: between two of them all slopes are linear and greatest at one of both, and
the surface below the belly rises above the plane of the wheels by a quadratic, whose greatest value is known.
"""

from __future__ import annotations

import math

import numpy as np

from mbf_mesh_nav.arrays import FloatArray, IntArray
from mbf_mesh_nav.kernels.compiled import Count, inner_kernel, kernel, plain_kernel
from mbf_mesh_nav.kernels.layers.chassis import Chassis, Scratch, gather_below, highest_below, wheel_plane
from mbf_mesh_nav.kernels.layers.footprint_settling import LEAST_UPWARD, MAX_STEPS, face_below
from mbf_mesh_nav.kernels.mesh.surface import Surface
from mbf_mesh_nav.kernels.mesh.vectors import Vector, row


@plain_kernel
def greatest_use(
    surface: Surface,
    chassis: Chassis,
    scratch: Scratch,
    face: int,
    start: Vector,
    end: Vector,
    cosine: float,
    sine: float,
) -> float:
    """Greatest share of a limit anywhere between two points [m] of a face; inf where a wheel has no surface.

    Parameters
    ----------
    start, end : (float, float, float)
        The middle of the footprint goes straight from one to the other; the same point twice is standing there.
    cosine, sine : float
        Of the heading.
    """
    x, y = end[0] - start[0], end[1] - start[1]
    for wheel in range(4):  # front left, rear left, rear right, front right
        forward = (0.5 if wheel == 0 or wheel == 3 else -0.5) * chassis.wheelbase
        left = (0.5 if wheel < 2 else -0.5) * chassis.track
        scratch.wheels[wheel, 0] = start[0] + cosine * forward - sine * left
        scratch.wheels[wheel, 1] = start[1] + sine * forward + cosine * left
        below = face_below(surface, face, scratch.wheels[wheel, 0], scratch.wheels[wheel, 1])
        if below < 0:
            return np.inf
        scratch.wheel_faces[wheel] = below
    size = gather_below(surface, chassis, scratch, face, start, end)
    worst, now, stalled = 0.0, 0.0, 0
    while True:
        # 1. Until when does every wheel stay on its face?
        until, leaving, side = 1.0, Count(-1), Count(-1)
        for wheel in range(4):
            moment, corner = _leaves_face(surface, scratch, wheel, x, y)
            if moment < until:
                until, leaving, side = moment, Count(wheel), Count(corner)
        until = max(until, now)
        # 2. The slopes at the begin and at the end of that, and the belly in between.
        first = wheel_plane(surface, chassis, scratch, now, x, y)
        last = wheel_plane(surface, chassis, scratch, until, x, y)
        worst = max(worst, first[3], last[3])
        if chassis.clearance < np.inf:
            middle = max(
                start[2] + now * (end[2] - start[2]) - first[0], start[2] + until * (end[2] - start[2]) - last[0]
            )
            bump = max(middle, highest_below(surface, chassis, scratch, size, start, x, y, cosine, sine, now, until))
            worst = max(worst, bump / chassis.clearance)
        # 3. On to the next face.
        if leaving < 0:
            return worst
        following = Count(surface.face_neighbours[scratch.wheel_faces[leaving], side])
        stalled = stalled + 1 if until <= now else 0
        if following < 0 or surface.face_normals[following, 2] < LEAST_UPWARD or stalled > MAX_STEPS:
            return np.inf
        scratch.wheel_faces[leaving] = following
        now = until


@kernel
def uses_along(
    surface: Surface,
    chassis: Chassis,
    scratch: Scratch,
    faces: IntArray,
    starts: FloatArray,
    ends: FloatArray,
    ahead: FloatArray,
) -> FloatArray:
    """``greatest_use`` (n,) of short drives (n, 3) [m] near faces (n,), each with a unit vector (n, 2) as heading."""
    uses = np.empty(len(faces), dtype=np.float64)
    for index in range(len(faces)):
        start, end = row(starts, Count(index)), row(ends, Count(index))
        uses[index] = greatest_use(
            surface, chassis, scratch, faces[index], start, end, ahead[index, 0], ahead[index, 1]
        )
    return uses


@inner_kernel
def move_use(surface: Surface, chassis: Chassis, scratch: Scratch, begin: int, end: int, share: float) -> float:
    """``greatest_use`` of the straight move from a vertex to another; inf where no face carries a wheel.

    With ``share`` NaN they are neighbours, and the move goes along their edge. Else ``end`` is the far corner of the
    face beyond one at ``begin``, and the edge between both faces is crossed at that share of its length.

    Both kinds are one kernel, as each that calls the sweep is compiled with all of it (decision 0086).
    """
    start, goal = row(surface.vertices, Count(begin)), row(surface.vertices, Count(end))
    x, y = goal[0] - start[0], goal[1] - start[1]
    length = math.sqrt(x * x + y * y)
    face, beyond, middle = Count(-1), Count(-1), goal
    if not np.isnan(share):
        face, side = _face_towards(surface, begin, end)
        if face >= 0:
            beyond = Count(surface.face_neighbours[face, side])
            a = row(surface.vertices, Count(surface.faces[face, side]))
            b = row(surface.vertices, Count(surface.faces[face, (side + 1) % 3]))
            middle = (a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1]), a[2] + share * (b[2] - a[2]))
    elif length > 0.0:
        face = _face_beside(surface, begin, end)
    if face < 0:
        return np.inf
    use = greatest_use(surface, chassis, scratch, face, start, middle, x / length, y / length)
    if beyond >= 0:
        use = max(use, greatest_use(surface, chassis, scratch, beyond, middle, goal, x / length, y / length))
    return float(use)


@inner_kernel
def _face_beside(surface: Surface, begin: int, end: int) -> int:
    """The flattest of the faces beside an edge that carry a wheel; -1: none does."""
    best, best_z = Count(-1), LEAST_UPWARD
    for position in range(surface.vertex_face_offsets[begin], surface.vertex_face_offsets[begin + 1]):
        face = Count(surface.vertex_faces[position])
        for corner in range(3):
            if surface.faces[face, corner] == end and surface.face_normals[face, 2] >= best_z:
                best, best_z = face, surface.face_normals[face, 2]
    return best  # type: ignore[no-any-return]


@inner_kernel
def _face_towards(surface: Surface, begin: int, end: int) -> tuple[int, int]:
    """The face at a vertex beyond which there is one with the corner ``end``, and the side between; -1: none."""
    for position in range(surface.vertex_face_offsets[begin], surface.vertex_face_offsets[begin + 1]):
        face = Count(surface.vertex_faces[position])
        for corner in range(3):
            if surface.faces[face, corner] != begin:
                continue
            side = Count((corner + 1) % 3)
            beyond = surface.face_neighbours[face, side]
            for other in range(3):
                if beyond >= 0 and surface.faces[beyond, other] == end:
                    return face, side
    return Count(-1), Count(-1)


@inner_kernel
def _leaves_face(surface: Surface, scratch: Scratch, wheel: int, x: float, y: float) -> tuple[float, int]:
    """When (share of the drive) a wheel leaves its face, and over which side; inf if it never does."""
    face = scratch.wheel_faces[wheel]
    leaves, side = np.inf, Count(-1)
    for corner in range(3):
        a, b = surface.faces[face, corner], surface.faces[face, (corner + 1) % 3]
        ax, ay = surface.vertices[a, 0], surface.vertices[a, 1]
        bx, by = surface.vertices[b, 0] - ax, surface.vertices[b, 1] - ay
        inside = bx * (scratch.wheels[wheel, 1] - ay) - by * (scratch.wheels[wheel, 0] - ax)
        rate = bx * y - by * x
        if rate < 0.0 and -inside / rate < leaves:
            leaves, side = -inside / rate, Count(corner)
    return leaves, side
