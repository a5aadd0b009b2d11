"""Casting rays at a tree of boxes (``ray_tree``), eight boxes or triangles at a time.

The two loops over lanes write nothing but bits of a number, so the compiler can turn them into vector instructions
without a check whether two arrays overlap. A triangle's arithmetic is the same in every
lane and on every CPU, and the nearest of all hits does not depend on their order.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.compiling.decorators import Index, inlined_kernel, kernel
from terrain.kernels.ray_tree import OCTANTS, WIDTH

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]

STACK_SIZE = 128  # seven more for each level of the tree, of which there are at most 12
EDGE_SLACK = 1e-9  # share of a triangle by which it is larger, so that no ray slips through between two
HUGE = 1e300  # inverse of a direction's component that is 0: finite, so that no NaN arises at the side of a box

ONE = Index(1)
LANES = Index(WIDTH)
BOX_SIZE = Index(6 * WIDTH)
LEAF_SIZE = Index(9 * WIDTH)


@inlined_kernel
def crosses(
    boxes: FloatArray, at: int, x: float, y: float, z: float, ix: float, iy: float, iz: float, best: float
) -> bool:
    """Whether a ray is in the box whose min x is ``boxes[at]`` before it is ``best`` [m] long; never if that is NaN."""
    ax, bx = (boxes[at] - x) * ix, (boxes[at + Index(3) * LANES] - x) * ix
    ay, by = (boxes[at + LANES] - y) * iy, (boxes[at + Index(4) * LANES] - y) * iy
    az, bz = (boxes[at + Index(2) * LANES] - z) * iz, (boxes[at + Index(5) * LANES] - z) * iz
    enter_x, leave_x = ax if ax < bx else bx, ax if ax > bx else bx
    enter_y, leave_y = ay if ay < by else by, ay if ay > by else by
    enter_z, leave_z = az if az < bz else bz, az if az > bz else bz
    enter = enter_x if enter_x > enter_y else enter_y
    enter = enter if enter > enter_z else enter_z
    enter = 0.0 if enter < 0.0 else enter
    leave = leave_x if leave_x < leave_y else leave_y
    leave = leave if leave < leave_z else leave_z
    leave = best if leave > best else leave
    return bool(enter <= leave)


@inlined_kernel
def hit_distance(leaves: FloatArray, at: int, x: float, y: float, z: float, dx: float, dy: float, dz: float) -> float:
    """Distance [m] along a ray to the triangle whose corner's x is ``leaves[at]``; inf beside it.

    Moeller and Trumbore, Fast, minimum storage ray-triangle intersection (1997).
    """
    bx, by, bz = leaves[at + Index(3) * LANES], leaves[at + Index(4) * LANES], leaves[at + Index(5) * LANES]
    cx, cy, cz = leaves[at + Index(6) * LANES], leaves[at + Index(7) * LANES], leaves[at + Index(8) * LANES]
    ox, oy, oz = x - leaves[at], y - leaves[at + LANES], z - leaves[at + Index(2) * LANES]
    px, py, pz = dy * cz - dz * cy, dz * cx - dx * cz, dx * cy - dy * cx
    qx, qy, qz = oy * bz - oz * by, oz * bx - ox * bz, ox * by - oy * bx
    inverse = 1.0 / (bx * px + by * py + bz * pz)
    v = (ox * px + oy * py + oz * pz) * inverse
    w = (dx * qx + dy * qy + dz * qz) * inverse
    distance = (cx * qx + cy * qy + cz * qz) * inverse
    hit = (v >= -EDGE_SLACK) & (w >= -EDGE_SLACK) & (v + w <= 1.0 + EDGE_SLACK) & (distance >= 0.0)
    return distance if hit else np.inf


@kernel
def first_distances(
    boxes: FloatArray,
    children: IntArray,
    far_first: NDArray[np.uint8],
    leaves: FloatArray,
    origins: FloatArray,
    directions: FloatArray,
    max_range: float,
) -> FloatArray:
    """Distance (n,) [m] along each ray to the first triangle within ``max_range``, both sides count; inf = none.

    Parameters
    ----------
    boxes, children, far_first, leaves
        Of ``build_tree``, each with its elements in one row.
    origins, directions : (n, 3) float64
        Directions of unit length.
    """
    distances = np.empty(len(origins), dtype=np.float64)
    stack = np.empty(STACK_SIZE, dtype=np.uint64)
    for ray in range(len(origins)):
        x, y, z = origins[ray, 0], origins[ray, 1], origins[ray, 2]
        dx, dy, dz = directions[ray, 0], directions[ray, 1], directions[ray, 2]
        ix = 1.0 / dx if dx != 0.0 else HUGE
        iy = 1.0 / dy if dy != 0.0 else HUGE
        iz = 1.0 / dz if dz != 0.0 else HUGE
        octant = Index(ix < 0.0) | Index(iy < 0.0) << ONE | Index(iz < 0.0) << Index(2)
        best, found = max_range, np.inf
        stack[Index(0)] = Index(0)  # the root: child 0 of node 0
        top = ONE
        while top > Index(0):
            top -= ONE
            slot = stack[top]
            box = slot // LANES * BOX_SIZE + slot % LANES
            if found < np.inf and not crosses(boxes, box, x, y, z, ix, iy, iz, best):
                continue
            child = children[slot]
            mask = Index(0)
            if child < 0:
                # 1. A leaf: which of its triangles are hit, and the nearest of them, rarely more than one.
                first = Index(-1 - child) * LEAF_SIZE
                for lane in range(WIDTH):
                    distance = hit_distance(leaves, first + Index(lane), x, y, z, dx, dy, dz)
                    mask |= Index(distance <= best) << Index(lane)
                if mask != Index(0):
                    for lane in range(WIDTH):
                        if mask >> Index(lane) & ONE != Index(0):
                            distance = hit_distance(leaves, first + Index(lane), x, y, z, dx, dy, dz)
                            if distance <= best:
                                best = found = distance
                continue
            # 2. A node: which of its children the ray crosses.
            first = Index(child) * BOX_SIZE
            for lane in range(WIDTH):
                mask |= Index(crosses(boxes, first + Index(lane), x, y, z, ix, iy, iz, best)) << Index(lane)
            if mask == Index(0):
                continue
            # 3. Those go onto the stack, the one that the ray meets first on top.
            first = (Index(child) * Index(OCTANTS) + octant) * LANES
            for rank in range(WIDTH):
                nearer = Index(far_first[first + Index(rank)])
                stack[top] = Index(child) * LANES + nearer
                top += mask >> nearer & ONE
        distances[ray] = found
    return distances
