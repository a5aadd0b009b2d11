"""First hits of rays with a mesh, over the box tree of ``bounding_boxes``."""

from __future__ import annotations

import numpy as np

from mbf_mesh_nav.arrays import FloatArray, IntArray
from mbf_mesh_nav.kernels.compiled import Count, Index, inner_kernel, kernel
from mbf_mesh_nav.kernels.mesh.bounding_boxes import BRANCHES, STACK_SIZE
from mbf_mesh_nav.kernels.mesh.vectors import Vector, cross, difference, dot, row, triangle


@inner_kernel
def distance_to_triangle(vertices: FloatArray, faces: IntArray, face: int, origin: Vector, direction: Vector) -> float:
    """Distance along a ray to a triangle, both sides count, inf without a hit (Moeller and Trumbore 1997)."""
    a, b, c = triangle(vertices, faces, Index(face))
    to_b, to_c, to_origin = difference(b, a), difference(c, a), difference(origin, a)
    p, q = cross(direction, to_c), cross(to_origin, to_b)
    determinant = dot(to_b, p)
    if determinant == 0.0:
        return np.inf
    v, w = dot(to_origin, p) / determinant, dot(direction, q) / determinant
    # Some tolerance, so that no ray slips through the edge between two faces.
    if v < -1e-12 or w < -1e-12 or v + w > 1.0 + 1e-12:
        return np.inf
    distance = dot(to_c, q) / determinant
    return distance if distance >= 0.0 else np.inf


@inner_kernel
def distance_to_box(
    boxes: FloatArray,
    node: int,
    x: float,
    y: float,
    z: float,
    inverse_x: float,
    inverse_y: float,
    inverse_z: float,
    limit: float,
) -> float:
    """Distance along a ray from (x, y, z) at which it enters a box, inf if it misses it or enters beyond ``limit``."""
    near, far = (boxes[node, 0] - x) * inverse_x, (boxes[node, 3] - x) * inverse_x
    enter, leave = max(0.0, min(near, far)), min(limit, max(near, far))
    near, far = (boxes[node, 1] - y) * inverse_y, (boxes[node, 4] - y) * inverse_y
    enter, leave = max(enter, min(near, far)), min(leave, max(near, far))
    near, far = (boxes[node, 2] - z) * inverse_z, (boxes[node, 5] - z) * inverse_z
    enter, leave = max(enter, min(near, far)), min(leave, max(near, far))
    return enter if enter <= leave else np.inf


@inner_kernel
def inverse_component(component: float) -> float:
    """Inverse of a direction's component; a huge number for 0, so that no NaN arises at the side of a box."""
    return 1.0 / component if component != 0.0 else 1e300


@kernel
def first_hits(
    vertices: FloatArray,
    faces: IntArray,
    boxes: FloatArray,
    levels: IntArray,
    origins: FloatArray,
    directions: FloatArray,
    max_distance: float,
) -> tuple[IntArray, FloatArray]:
    """First face (n,) hit by each ray within ``max_distance`` (-1 = none) and the distance (n,), inf = none.

    Parameters
    ----------
    origins, directions : (n, 3) float64
        Directions of unit length.
    """
    count = origins.shape[0]
    hit_faces, hit_distances = np.empty(count, dtype=np.int32), np.empty(count, dtype=np.float64)
    nodes, depths = np.empty(STACK_SIZE, dtype=np.int32), np.empty(STACK_SIZE, dtype=np.int32)
    enters = np.empty(STACK_SIZE, dtype=np.float64)
    for index in range(count):
        origin, direction = row(origins, index), row(directions, index)
        x, y, z = origin[0], origin[1], origin[2]
        ix, iy, iz = (inverse_component(direction[0]), inverse_component(direction[1]), inverse_component(direction[2]))
        best_face, best = -1, max_distance
        root = levels[-1] - 1
        nodes[0], depths[0] = root, levels.shape[0] - 2
        enters[0] = distance_to_box(boxes, root, x, y, z, ix, iy, iz, best)
        top = 1 if enters[0] < np.inf else 0
        while top > 0:
            top -= 1
            if enters[top] > best:
                continue
            node, depth = nodes[top], depths[top]
            first = BRANCHES * (node - levels[depth])
            if depth == 0:
                for face in range(first, min(first + BRANCHES, faces.shape[0])):
                    distance = distance_to_triangle(vertices, faces, face, origin, direction)
                    # A hit as far as the limit counts, but a miss is no hit at infinity.
                    if distance < best or (distance == best and best_face < 0 and distance < np.inf):
                        best_face, best = face, distance
                continue
            # Children on the stack with the one entered first on top.
            base = top
            first += levels[depth - 1]
            for child in range(first, min(first + BRANCHES, Count(levels[depth]))):
                enter = distance_to_box(boxes, child, x, y, z, ix, iy, iz, best)
                if enter == np.inf:
                    continue
                place = top
                while place > base and enters[place - 1] < enter:
                    nodes[place], depths[place], enters[place] = nodes[place - 1], depths[place - 1], enters[place - 1]
                    place -= 1
                nodes[place], depths[place], enters[place] = child, depth - 1, enter
                top += 1
        hit_faces[index], hit_distances[index] = best_face, best if best_face >= 0 else np.inf
    return hit_faces, hit_distances
