"""Finding what is wrong at the edges and vertices of a face list; used once, when a mesh is loaded."""

from __future__ import annotations

import numpy as np

from mbf_mesh_nav.arrays import BoolArray, FloatArray, IntArray
from mbf_mesh_nav.kernels.compiled import Count, Index, inner_kernel, kernel
from mbf_mesh_nav.kernels.fill import fill
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


@kernel
def superfluous_faces(faces: IntArray, face_offsets: IntArray, incident: IntArray) -> tuple[BoolArray, BoolArray]:
    """Faces to drop when faces are added in order.

    Returns
    -------
    repeated, surplus : (F,) bool
        Faces with the corners of an earlier one, in any order; other faces that would be the third at an edge.
    """
    repeated, surplus = np.empty(faces.shape[0], dtype=np.bool_), np.empty(faces.shape[0], dtype=np.bool_)
    fill(repeated, Count(0))
    fill(surplus, Count(0))
    for face in range(faces.shape[0]):
        for corner in range(3):
            start, end, third = faces[face, corner], faces[face, (corner + 1) % 3], faces[face, (corner + 2) % 3]
            present = 0
            for position in range(face_offsets[start], face_offsets[start + 1]):
                other = incident[position]
                if other >= face:
                    break
                if has_corner(faces, other, end):
                    repeated[face] |= has_corner(faces, other, third)
                    present += not (repeated[other] or surplus[other])
            surplus[face] |= present >= 2
        surplus[face] &= not repeated[face]
    return repeated, surplus


@inner_kernel
def has_corner(faces: IntArray, face: int, vertex: int) -> bool:
    """Whether a vertex is a corner of a face."""
    return bool(faces[face, 0] == vertex or faces[face, 1] == vertex or faces[face, 2] == vertex)


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
    flip = np.empty(face_count, dtype=np.bool_)
    fill(flip, Count(0))
    seen = np.empty(face_count, dtype=np.bool_)
    fill(seen, Count(0))
    patch = np.empty(face_count, dtype=np.int32)
    patches = np.empty(face_count, dtype=np.int32)
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


@kernel
def fans_at_vertices(
    faces: IntArray, face_neighbours: IntArray, face_offsets: IntArray, incident: IntArray
) -> tuple[IntArray, IntArray]:
    """Fan of every entry of ``incident`` (3F,), counted from 0 at each vertex, and the number of fans (V,).

    A fan is a group of faces around a vertex that are connected over edges; a sound vertex has one.
    """
    fans, counts = np.empty(len(incident), dtype=np.int32), np.empty(len(face_offsets) - 1, dtype=np.int32)
    fill(fans, Count(-1))
    fill(counts, Count(0))
    waiting = np.empty(len(incident), dtype=np.int32)
    for vertex in range(counts.shape[0]):
        begin, end = face_offsets[vertex], face_offsets[vertex + 1]
        for entry in range(begin, end):
            if fans[entry] >= 0:
                continue
            fans[entry], waiting[0], size = counts[vertex], incident[entry], 1
            while size > 0:
                size -= 1
                face = waiting[size]
                for corner in range(3):
                    if faces[face, corner] != vertex and faces[face, (corner + 1) % 3] != vertex:
                        continue
                    for place in range(begin, end):
                        if incident[place] == face_neighbours[face, corner] and fans[place] < 0:
                            fans[place], waiting[size] = counts[vertex], incident[place]
                            size += 1
            counts[vertex] += 1
    return fans, counts
