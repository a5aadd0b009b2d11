"""A box tree over the faces of a mesh, with nearest-point and ray queries.

Faces come sorted along a Morton curve, so the tree needs no building beyond boxes: leaf i covers faces 4i to 4i+3,
and node i of a level covers nodes 4i to 4i+3 of the level below. ``levels`` holds where each level starts in ``boxes``.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.arrays import FloatArray, IntArray
from mbf_mesh_nav.kernels.compiled import ONE, Count, Index, inner_kernel, kernel, plain_kernel
from mbf_mesh_nav.kernels.mesh.vectors import difference, dot, triangle

BRANCHES = 4
_BRANCHES: Any = Index(BRANCHES)
STACK_SIZE = 128


def build_boxes(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray]:
    """Boxes (N, 6) as min x y z, max x y z, leaves first, and the start of every level (levels + 1,)."""
    sizes = [-(-len(faces) // BRANCHES)]
    while sizes[-1] > 1:
        sizes.append(-(-sizes[-1] // BRANCHES))
    levels = np.cumsum([0, *sizes], dtype=np.int32)
    boxes = np.empty((levels[-1], 6), dtype=np.float64)
    # Boxes are slightly larger than their faces, so that rounding loses no ray that runs along the side of one.
    margin = 1e-12 * float(np.abs(vertices).max(initial=0.0))
    _fill_boxes(vertices, faces, margin, levels, boxes)
    return boxes, levels


@plain_kernel
def _fill_boxes(vertices: FloatArray, faces: IntArray, margin: float, levels: IntArray, boxes: FloatArray) -> None:
    """Write the box of every ``BRANCHES`` faces, larger by ``margin`` [m] on all sides, then those around boxes."""
    for face in range(len(faces)):
        a, b, c = triangle(vertices, faces, Index(face))
        leaf, is_first = face // BRANCHES, face % BRANCHES == 0
        for axis in range(3):
            least, most = min(min(a[axis], b[axis]), c[axis]), max(max(a[axis], b[axis]), c[axis])
            least, most = least - margin, most + margin
            boxes[leaf, axis] = least if is_first else min(boxes[leaf, axis], least)
            boxes[leaf, axis + 3] = most if is_first else max(boxes[leaf, axis + 3], most)
    for level in range(1, len(levels) - 1):
        below = levels[level - 1]
        for child in range(levels[level] - below):
            node, is_first = levels[level] + child // BRANCHES, child % BRANCHES == 0
            for axis in range(3):
                least, most = boxes[below + child, axis], boxes[below + child, axis + 3]
                boxes[node, axis] = least if is_first else min(boxes[node, axis], least)
                boxes[node, axis + 3] = most if is_first else max(boxes[node, axis + 3], most)


@inner_kernel
def squared_distance_to_box(boxes: FloatArray, node: int, x: float, y: float, z: float) -> float:
    """Squared distance [m^2] from a point to a box, 0 inside."""
    dx = max(max(boxes[node, 0] - x, 0.0), x - boxes[node, 3])
    dy = max(max(boxes[node, 1] - y, 0.0), y - boxes[node, 4])
    dz = max(max(boxes[node, 2] - z, 0.0), z - boxes[node, 5])
    squared: float = dx * dx + dy * dy + dz * dz
    return squared


@plain_kernel
def closest_on_face(
    vertices: FloatArray, faces: IntArray, face: int, x: float, y: float, z: float
) -> tuple[float, float, float]:
    """Squared distance to the nearest point of a triangle and its barycentric weights of corners 1 and 2.

    Region by region after Ericson, Real-Time Collision Detection (2005), section 5.1.5.
    """
    a, b, c = triangle(vertices, faces, face)
    to_b, to_c, to_point = difference(b, a), difference(c, a), difference((x, y, z), a)
    d1, d2 = dot(to_b, to_point), dot(to_c, to_point)
    uu, uw, ww = dot(to_b, to_b), dot(to_b, to_c), dot(to_c, to_c)
    d3, d4 = d1 - uu, d2 - uw
    d5, d6 = d1 - uw, d2 - ww
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    v, w = 0.0, 0.0
    if d1 <= 0.0 and d2 <= 0.0:  # corner 0
        pass
    elif d3 >= 0.0 and d4 <= d3:  # corner 1
        v = 1.0
    elif d6 >= 0.0 and d5 <= d6:  # corner 2
        w = 1.0
    elif vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:  # edge 0-1
        v = d1 / (d1 - d3)
    elif vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:  # edge 0-2
        w = d2 / (d2 - d6)
    elif va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:  # edge 1-2
        w = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        v = 1.0 - w
    else:  # inside
        v, w = vb / (va + vb + vc), vc / (va + vb + vc)
    rx = to_point[0] - v * to_b[0] - w * to_c[0]
    ry = to_point[1] - v * to_b[1] - w * to_c[1]
    rz = to_point[2] - v * to_b[2] - w * to_c[2]
    return rx * rx + ry * ry + rz * rz, v, w


@kernel
def closest_face(
    vertices: FloatArray,
    faces: IntArray,
    boxes: FloatArray,
    levels: IntArray,
    x: float,
    y: float,
    z: float,
    max_distance: float,
    hint_face: int,
) -> tuple[int, float, float, float, float, float, float]:
    """Nearest face of a point within ``max_distance``: (face or -1, distance, weights of corners 1 and 2, x, y, z).

    ``hint_face`` (or -1) is looked at first, so that a good guess prunes nearly the whole tree.
    """
    best_face, best, best_v, best_w = Count(-1), max_distance * max_distance, 0.0, 0.0
    if hint_face >= 0:
        squared, v, w = closest_on_face(vertices, faces, Index(hint_face), x, y, z)
        if squared <= best:
            best_face, best, best_v, best_w = hint_face, squared, v, w
    nodes = np.empty(STACK_SIZE, dtype=np.uint64)
    depths = np.empty(STACK_SIZE, dtype=np.uint64)
    bounds = np.empty(STACK_SIZE, dtype=np.float64)
    face_count = Index(len(faces))
    nodes[0], depths[0] = Index(levels[-1] - 1), Index(len(levels) - 2)
    bounds[0] = squared_distance_to_box(boxes, nodes[0], x, y, z)
    top = ONE
    while top > 0:
        top -= ONE
        if bounds[top] > best:
            continue
        node, depth = nodes[top], depths[top]
        first = _BRANCHES * (node - Index(levels[depth]))
        if depth == 0:
            for face in range(first, min(first + _BRANCHES, face_count)):
                squared, v, w = closest_on_face(vertices, faces, face, x, y, z)
                if squared < best or (best_face < 0 and squared <= best):
                    best_face, best, best_v, best_w = Count(face), squared, v, w
            continue
        # Push the children so that the nearest is on top: insertion into the short run above ``base``.
        base = top
        first += Index(levels[depth - ONE])
        for child in range(first, min(first + _BRANCHES, Index(levels[depth]))):
            bound = squared_distance_to_box(boxes, child, x, y, z)
            if bound > best:
                continue
            place = top
            while place > base and bounds[place - ONE] < bound:
                below = place - ONE
                nodes[place], depths[place], bounds[place] = nodes[below], depths[below], bounds[below]
                place = below
            nodes[place], depths[place], bounds[place] = child, depth - ONE, bound
            top += ONE
    if best_face < 0:
        return -1, np.inf, 0.0, 0.0, 0.0, 0.0, 0.0
    a, b, c = triangle(vertices, faces, Index(best_face))
    weights = (1.0 - best_v - best_w, best_v, best_w)
    nearest_x, nearest_y, nearest_z = (
        dot(weights, (a[0], b[0], c[0])),
        dot(weights, (a[1], b[1], c[1])),
        dot(weights, (a[2], b[2], c[2])),
    )
    return best_face, np.sqrt(best), best_v, best_w, nearest_x, nearest_y, nearest_z


@kernel
def closest_faces(
    vertices: FloatArray,
    faces: IntArray,
    boxes: FloatArray,
    levels: IntArray,
    points: FloatArray,
    order: NDArray[np.int64],
    max_distance: float,
) -> tuple[IntArray, FloatArray, FloatArray, FloatArray]:
    """``closest_face`` of many points: faces (n,), barycentric (n, 3), surface points (n, 3), distances (n,).

    ``order`` (n,) is the order to work them off; along a Morton curve each answer is a good hint for the next point.
    """
    count = points.shape[0]
    found, distances = np.empty(count, dtype=np.int32), np.empty(count, dtype=np.float64)
    weights, surface = np.empty((count, 3), dtype=np.float64), np.empty((count, 3), dtype=np.float64)
    hint = Count(-1)
    for position in range(count):
        index = Index(order[position])
        x, y, z = points[index, 0], points[index, 1], points[index, 2]
        face, distance, v, w, px, py, pz = closest_face(vertices, faces, boxes, levels, x, y, z, max_distance, hint)
        hint = face
        found[index], distances[index] = face, distance
        if face < 0:
            v = px = py = pz = np.nan
        weights[index, 0], weights[index, 1], weights[index, 2] = 1.0 - v - w, v, w if face >= 0 else np.nan
        surface[index, 0], surface[index, 1], surface[index, 2] = px, py, pz
    return found, weights, surface, distances
