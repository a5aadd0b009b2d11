"""Finding what is wrong at the edges of a face list; used once, when a mesh is loaded."""

from __future__ import annotations

import numpy as np

from mbf_mesh_nav.arrays import BoolArray, FloatArray, IntArray
from mbf_mesh_nav.kernels.compiled import Index, inner_kernel, kernel
from mbf_mesh_nav.kernels.mesh.vectors import cross, difference, dot, norm, triangle


@kernel
def face_shapes(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Area vector (x, y, z), area and longest edge squared of every face, (F, 5) [m^2].

    The vector points where the face looks.
    """
    shapes = np.empty((faces.shape[0], 5), dtype=np.float64)
    for face in range(faces.shape[0]):
        a, b, c = triangle(vertices, faces, Index(face))
        ab, ac, cb = difference(b, a), difference(c, a), difference(b, c)
        doubled = cross(ab, ac)
        for axis in range(3):
            shapes[face, axis] = 0.5 * doubled[axis]
        shapes[face, 3] = 0.5 * norm(doubled)
        shapes[face, 4] = max(max(dot(ab, ab), dot(ac, ac)), dot(cb, cb))
    return shapes


def faces_without_area(vertices: FloatArray, faces: IntArray, tolerance: float) -> BoolArray:
    """Mask (F,) of faces whose doubled area is at most ``tolerance`` times their longest edge squared."""
    shapes = face_shapes(vertices, faces)
    return np.asarray(2.0 * shapes[:, 3] <= tolerance * shapes[:, 4])


def repeated_faces(faces: IntArray) -> BoolArray:
    """Mask (F,) of faces with the same three corners, in any order, as a face of smaller number."""
    corners = np.sort(faces, axis=1)
    order = np.lexsort(corners.T)
    repeated = np.zeros(len(faces), dtype=np.bool_)
    repeated[order[1:]] = (corners[order[1:]] == corners[order[:-1]]).all(axis=1)
    return repeated


@kernel
def surplus_faces(faces: IntArray, face_offsets: IntArray, incident: IntArray) -> BoolArray:
    """Mask (F,) of faces that would be the third at one of their edges when faces are added in order."""
    surplus = np.zeros(faces.shape[0], dtype=np.bool_)
    for face in range(faces.shape[0]):
        for corner in range(3):
            start = faces[face, corner]
            end = faces[face, (corner + 1) % 3]
            present = 0
            for position in range(face_offsets[start], face_offsets[start + 1]):
                other = incident[position]
                if other >= face:
                    break
                if not surplus[other] and (faces[other, 0] == end or faces[other, 1] == end or faces[other, 2] == end):
                    present += 1
            if present >= 2:
                surplus[face] = True
                break
    return surplus


@inner_kernel
def runs_along(faces: IntArray, face: int, start: int, end: int) -> bool:
    """Whether the winding of ``face`` passes from ``start`` directly to ``end``."""
    for corner in range(3):
        if faces[face, corner] == start and faces[face, (corner + 1) % 3] == end:
            return True
    return False


@kernel
def winding_flips(faces: IntArray, face_neighbours: IntArray, areas: FloatArray) -> tuple[BoolArray, IntArray, int]:
    """Faces (F,) to turn round so that neighbours agree, patch of every face (F,), and edges where none can.

    Edges at which neighbours cannot agree are those of one-sided surfaces, such as a Moebius corridor.

    Each patch of faces is oriented from its first face; of the two possible answers the one that turns less area wins.
    """
    face_count = faces.shape[0]
    flip = np.zeros(face_count, dtype=np.bool_)
    seen = np.zeros(face_count, dtype=np.bool_)
    patch = np.zeros(face_count, dtype=np.int32)
    patches = np.zeros(face_count, dtype=np.int32)
    contradictions, patch_count = 0, 0
    for start in range(face_count):
        if seen[start]:
            continue
        seen[start] = True
        patch[0] = start
        size, position = 1, 0
        area, turned = 0.0, 0.0
        while position < size:
            face = patch[position]
            position += 1
            patches[face] = patch_count
            area += areas[face]
            if flip[face]:
                turned += areas[face]
            for corner in range(3):
                other = face_neighbours[face, corner]
                if other < 0:
                    continue
                same = runs_along(faces, other, faces[face, corner], faces[face, (corner + 1) % 3])
                wanted = flip[face] != same
                if not seen[other]:
                    seen[other] = True
                    flip[other] = wanted
                    patch[size] = other
                    size += 1
                elif flip[other] != wanted and other > face:
                    contradictions += 1
        if turned > 0.5 * area:
            for index in range(size):
                flip[patch[index]] = not flip[patch[index]]
        patch_count += 1
    return flip, patches, contradictions
