"""Where a round robot on a path, or at many places, touches something."""

from __future__ import annotations

import math

import numpy as np

from mbf_mesh_nav.arrays import BoolArray, FloatArray, IntArray
from mbf_mesh_nav.kernels.compiled import Count, inner_array_kernel, inner_kernel, kernel
from mbf_mesh_nav.kernels.fill import fill
from mbf_mesh_nav.kernels.mesh.surface_disc import vertices_in_disc


@kernel
def touching_discs(
    vertices: FloatArray,
    mesh_faces: IntArray,
    offsets: IntArray,
    neighbours: IntArray,
    blocked: BoolArray,
    centres: FloatArray,
    faces: IntArray,
    radius: float,
    least_share: float,
) -> BoolArray:
    """Whether discs of ``radius`` [m] on the surface touch a blocked vertex, as ``MeshPlaces`` says of one pose.

    Parameters
    ----------
    blocked : (V,) bool
    centres : (n, 3) float64
        On the surface [m].
    faces : (n,) int32
        In which the centres lie.
    least_share : float
        A centre with less of a corner than this lies on the edge opposite to it.
    """
    touching = np.empty(len(faces), dtype=np.bool_)
    fill(touching, Count(0))
    shares = np.empty(3)
    for i in range(len(faces)):
        face = mesh_faces[faces[i]]
        _set_shares(vertices, face, centres[i], shares)
        nearest = _largest(shares)
        if not _any_blocked(vertices, offsets, neighbours, blocked, Count(face[nearest]), centres[i], radius):
            continue
        for corner in range(3):
            after = Count(face[(corner + 1) % 3])
            if shares[corner] <= least_share:
                continue
            vertex, on_edge = Count(face[corner]), shares[(corner + 1) % 3] > least_share
            too_long = on_edge and _distance(vertices[vertex], vertices[after]) > radius
            if too_long or _any_blocked(vertices, offsets, neighbours, blocked, vertex, vertices[vertex], radius):
                touching[i] = True
                break
    return touching


@kernel
def blocked_places(
    vertices: FloatArray,
    mesh_faces: IntArray,
    offsets: IntArray,
    neighbours: IntArray,
    blocked: BoolArray,
    centres: FloatArray,
    faces: IntArray,
    radius: float,
    least_share: float,
) -> BoolArray:
    """Whether a path through places meets blocked ground, as ``MeshPlaces`` says of one place on it.

    The nearest corner of the face counts, with a ``radius`` [m] all corners and all vertices of the disc. Parameters as
    of ``touching_discs``.
    """
    meets = np.empty(len(faces), dtype=np.bool_)
    shares = np.empty(3)
    for i in range(len(faces)):
        face = mesh_faces[faces[i]]
        _set_shares(vertices, face, centres[i], shares)
        nearest = _largest(shares)
        meets[i] = blocked[face[nearest]]
        if radius == 0.0:
            continue
        for corner in range(3):
            meets[i] |= shares[corner] > least_share and blocked[face[corner]]
        if not meets[i]:
            start = Count(face[nearest])
            meets[i] = _any_blocked(vertices, offsets, neighbours, blocked, start, centres[i], radius)
    return meets


@inner_kernel
def _largest(shares: FloatArray) -> int:
    """Return the corner with the largest share, the first of equal ones."""
    largest: int = Count(0)
    for corner in range(1, 3):
        if shares[corner] > shares[largest]:
            largest = Count(corner)
    return largest


@inner_array_kernel
def _any_blocked(
    vertices: FloatArray,
    offsets: IntArray,
    neighbours: IntArray,
    blocked: BoolArray,
    start: int,
    centre: FloatArray,
    radius: float,
) -> bool:
    for vertex in vertices_in_disc(vertices, offsets, neighbours, start, centre, radius):
        if blocked[vertex]:
            return True
    return False


@inner_kernel
def _distance(a: FloatArray, b: FloatArray) -> float:
    return math.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2)


@inner_kernel
def _set_shares(vertices: FloatArray, face: IntArray, point: FloatArray, shares: FloatArray) -> None:
    """Barycentric coordinates of a point in a face."""
    origin = vertices[face[0]]
    uu, uv, vv, up, vp = 0.0, 0.0, 0.0, 0.0, 0.0
    for axis in range(3):
        u, v = vertices[face[1], axis] - origin[axis], vertices[face[2], axis] - origin[axis]
        p = point[axis] - origin[axis]
        uu, uv, vv, up, vp = uu + u * u, uv + u * v, vv + v * v, up + u * p, vp + v * p
    area = uu * vv - uv * uv
    shares[1], shares[2] = (vv * up - uv * vp) / area, (uu * vp - uv * up) / area
    shares[0] = 1.0 - shares[1] - shares[2]
