"""A tree of boxes over triangles that do not move, laid out for rays.

Triangles come sorted along a Morton curve, so the tree needs no building beyond boxes: leaf i holds triangles 4i to
4i+3, and node i of a level holds nodes 4i to 4i+3 of the level below. What a ray needs of the four children of a node,
or of the four triangles of a leaf, lies side by side in memory.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from terrain.kernels.compiled import kernel

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]

WIDTH = 4
STACK_SIZE = 96  # three more for each level of the tree, of which there are at most 31
EDGE_SLACK = 1e-9  # share of a triangle by which it is larger, so that no ray slips through between two
HUGE = 1e300  # inverse of a direction's component that is 0: finite, so that no NaN arises at the side of a box


@kernel
def morton_codes(points: FloatArray, lower: FloatArray, cell: float) -> NDArray[np.uint64]:
    """Codes (n,) of points (n, 3): the bits of their cell numbers from ``lower`` (3,) on, interleaved."""
    codes = np.empty(len(points), dtype=np.uint64)
    for index in range(len(points)):
        code = np.uint64(0)
        for axis in range(3):
            number = np.uint64((points[index, axis] - lower[axis]) / cell)
            for bit in range(20):
                code |= ((number >> np.uint64(bit)) & np.uint64(1)) << np.uint64(3 * bit + axis)
        codes[index] = code
    return codes


@kernel
def build_leaves(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Triangles (leaves, 9, 4): a corner and the two sides from it, of four triangles; those left over are points."""
    leaves = np.zeros(((len(faces) + WIDTH - 1) // WIDTH, 9, WIDTH), dtype=np.float64)
    for face in range(len(faces)):
        leaf, lane = face // WIDTH, face % WIDTH
        for axis in range(3):
            corner = vertices[faces[face, 0], axis]
            leaves[leaf, axis, lane] = corner
            leaves[leaf, 3 + axis, lane] = vertices[faces[face, 1], axis] - corner
            leaves[leaf, 6 + axis, lane] = vertices[faces[face, 2], axis] - corner
    return leaves


@kernel
def build_nodes(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, NDArray[np.int64]]:
    """Boxes (nodes, 6, 4) of the children of every node, the lowest level first, and where each level starts.

    Each box is min x y z, max x y z, a hair larger than what is in it. Children that do not exist are empty boxes.
    """
    leaf_count = (len(faces) + WIDTH - 1) // WIDTH
    starts = np.zeros(33, dtype=np.int64)
    levels, count = 0, leaf_count
    while levels == 0 or count > 1:
        count = (count + WIDTH - 1) // WIDTH
        starts[levels + 1] = starts[levels] + count
        levels += 1
    nodes = np.empty((starts[levels], 6, WIDTH), dtype=np.float64)
    nodes[:, :3] = np.inf
    nodes[:, 3:] = -np.inf
    hair = 1e-9 * max(np.abs(vertices).max(), 1.0)
    for face in range(len(faces)):
        leaf = face // WIDTH
        for corner in range(3):
            for axis in range(3):
                value = vertices[faces[face, corner], axis]
                low, high = nodes[leaf // WIDTH, axis, leaf % WIDTH], nodes[leaf // WIDTH, 3 + axis, leaf % WIDTH]
                nodes[leaf // WIDTH, axis, leaf % WIDTH] = min(low, value - hair)
                nodes[leaf // WIDTH, 3 + axis, leaf % WIDTH] = max(high, value + hair)
    for level in range(1, levels):
        for child in range(starts[level] - starts[level - 1]):
            node = starts[level] + child // WIDTH
            for axis in range(3):
                nodes[node, axis, child % WIDTH] = nodes[starts[level - 1] + child, axis].min()
                nodes[node, 3 + axis, child % WIDTH] = nodes[starts[level - 1] + child, 3 + axis].max()
    return nodes, starts[: levels + 1]


@kernel
def first_distances(
    nodes: FloatArray,
    starts: NDArray[np.int64],
    leaves: FloatArray,
    origins: FloatArray,
    directions: FloatArray,
    max_range: float,
) -> FloatArray:
    """Distance (n,) [m] along each ray to the first triangle within ``max_range``, both sides count; inf = none.

    Parameters
    ----------
    nodes, starts, leaves
        Of ``build_nodes`` and ``build_leaves``.
    origins, directions : (n, 3) float64
        Directions of unit length.
    """
    distances = np.empty(len(origins), dtype=np.float64)
    stack, levels = np.empty(STACK_SIZE, dtype=np.int64), np.empty(STACK_SIZE, dtype=np.int64)
    enters = np.empty(STACK_SIZE, dtype=np.float64)
    near, far = np.empty(WIDTH, dtype=np.float64), np.empty(WIDTH, dtype=np.float64)
    for ray in range(len(origins)):
        x, y, z = origins[ray, 0], origins[ray, 1], origins[ray, 2]
        dx, dy, dz = directions[ray, 0], directions[ray, 1], directions[ray, 2]
        ix = 1.0 / dx if dx != 0.0 else HUGE
        iy = 1.0 / dy if dy != 0.0 else HUGE
        iz = 1.0 / dz if dz != 0.0 else HUGE
        # Which side of a box a ray enters through depends on its direction alone.
        in_x, in_y, in_z = 0 if ix >= 0.0 else 3, 1 if iy >= 0.0 else 4, 2 if iz >= 0.0 else 5
        best = max_range
        found = False
        stack[0], levels[0], enters[0] = starts[-1] - 1, len(starts) - 2, 0.0
        top = 1
        while top > 0:
            top -= 1
            if enters[top] > best:
                continue
            node, level = stack[top], levels[top]
            if level < 0:
                # 1. A leaf: its triangles (Moeller and Trumbore 1997).
                leaf = leaves[node]
                for lane in range(WIDTH):
                    bx, by, bz = leaf[3, lane], leaf[4, lane], leaf[5, lane]
                    cx, cy, cz = leaf[6, lane], leaf[7, lane], leaf[8, lane]
                    ox, oy, oz = x - leaf[0, lane], y - leaf[1, lane], z - leaf[2, lane]
                    px, py, pz = dy * cz - dz * cy, dz * cx - dx * cz, dx * cy - dy * cx
                    qx, qy, qz = oy * bz - oz * by, oz * bx - ox * bz, ox * by - oy * bx
                    inverse = 1.0 / (bx * px + by * py + bz * pz)
                    v = (ox * px + oy * py + oz * pz) * inverse
                    w = (dx * qx + dy * qy + dz * qz) * inverse
                    distance = (cx * qx + cy * qy + cz * qz) * inverse
                    hit = (v >= -EDGE_SLACK) & (w >= -EDGE_SLACK) & (v + w <= 1.0 + EDGE_SLACK) & (distance >= 0.0)
                    near[lane] = distance if hit else np.inf
                for lane in range(WIDTH):
                    if near[lane] <= best:
                        best = near[lane]
                        found = True
                continue
            # 2. A node: where the ray enters and leaves its four children.
            box = nodes[node]
            low_x, low_y, low_z = box[in_x], box[in_y], box[in_z]
            high_x, high_y, high_z = box[3 - in_x], box[5 - in_y], box[7 - in_z]
            for lane in range(WIDTH):
                ex, ey, ez = (low_x[lane] - x) * ix, (low_y[lane] - y) * iy, (low_z[lane] - z) * iz
                enter = ex if ex > ey else ey
                enter = enter if enter > ez else ez
                near[lane] = enter if enter > 0.0 else 0.0
            for lane in range(WIDTH):
                lx, ly, lz = (high_x[lane] - x) * ix, (high_y[lane] - y) * iy, (high_z[lane] - z) * iz
                leave = lx if lx < ly else ly
                far[lane] = leave if leave < lz else lz
            # 3. Children onto the stack, the one entered first on top.
            first = WIDTH * (node - starts[level]) + (starts[level - 1] if level > 0 else 0)
            base = top
            for lane in range(WIDTH):
                enter = near[lane]
                if enter > far[lane] or enter > best:
                    continue
                place = top
                while place > base and enters[place - 1] < enter:
                    stack[place], levels[place] = stack[place - 1], levels[place - 1]
                    enters[place] = enters[place - 1]
                    place -= 1
                stack[place], levels[place], enters[place] = first + lane, level - 1, enter
                top += 1
        distances[ray] = best if found else np.inf
    return distances
