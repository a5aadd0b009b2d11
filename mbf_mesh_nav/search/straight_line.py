"""A line that is straight in the plan view, over as many faces as it takes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mbf_abstract.geometry.arithmetic import norm
from mbf_mesh_nav.arrays import FloatArray, IntArray
from mbf_mesh_nav.mesh.topology import MeshTopology

LEAST_UPWARD = 0.05
"""z of the normal below which a face is a wall."""
_MOST_FACES = 100
_SAME_PLACE = 1e-6  # m
_ARRIVED = 1.0 - 1e-9


class StraightLine(NamedTuple):
    """Points (n, 3) [m] on the surface from start to end, one on each edge crossed; faces (n - 1,) between them."""

    points: FloatArray
    faces: IntArray


def line_over_ground(mesh: MeshTopology, face: int, start: FloatArray, end: FloatArray) -> StraightLine | None:
    """The line from a point of a face to another point on the surface [m]; None if a border or a wall ends it."""
    points, faces = [start], []
    ahead = (end - start)[:2].tolist()
    for _ in range(_MOST_FACES):
        corners = mesh.vertices[mesh.faces[face]]
        share, side = 1.0, -1
        # A corner of this face is reached within it, even if by rounding the line leaves across the edge it begins on.
        is_corner = (corners == end).all(axis=1).any()
        for index in () if is_corner else range(3):
            across = (corners[(index + 1) % 3] - corners[index])[:2].tolist()
            offset = (start - corners[index])[:2].tolist()
            inside, rate = _cross(across, offset), _cross(across, ahead)
            if rate < 0.0 and -inside / rate < share:
                share, side = -inside / rate, index
        arrived = side < 0 or share >= _ARRIVED
        point = end if arrived else _on_side(corners, side, start, ahead, share)
        if norm(point - points[-1]) > _SAME_PLACE:
            points.append(point)
            faces.append(face)
        if arrived:
            return StraightLine(np.array(points), np.array(faces, dtype=np.int32))
        face = int(mesh.face_neighbours[face, side])
        if face < 0 or mesh.face_normals[face, 2] < LEAST_UPWARD:
            return None
    return None


def _on_side(corners: FloatArray, side: int, start: FloatArray, ahead: list[float], share: float) -> FloatArray:
    """The point of a side of a face that lies at a share of the line, seen from above."""
    first, second = corners[side], corners[(side + 1) % 3]
    along = 0 if abs(second[0] - first[0]) > abs(second[1] - first[1]) else 1
    part = (start[along] + share * ahead[along] - first[along]) / (second[along] - first[along])
    return np.asarray(first + part * (second - first))


def _cross(first: list[float], second: list[float]) -> float:
    return first[0] * second[1] - first[1] * second[0]
