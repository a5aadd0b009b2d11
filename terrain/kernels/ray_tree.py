"""Building a tree of boxes over triangles that do not move, laid out for rays (``ray_casting``).

A node has up to eight children, found by halving its triangles three times along their longest side. A child is a
node or a leaf of eight triangles. What a ray needs of the eight children of a node, or of the eight triangles of a
leaf, lies side by side in memory, so that vector units work on eight at once. The cuts decide how fast a ray is
cast, not what it hits.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.compiling.decorators import inner_kernel, kernel

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]
OrderArray = NDArray[np.int64]

WIDTH = 8
OCTANTS = 8


class BoxesOfFaces(NamedTuple):
    """The box of each triangle: min, max and middle (n, 3) [m], and by how much [m] a box is made larger."""

    lower: FloatArray
    upper: FloatArray
    centres: FloatArray
    margin: float


class Memory(NamedTuple):
    """Triangles (n,) in the order of the leaves, the part of each node (nodes, 2), its cuts (9,) and a row (8,)."""

    order: OrderArray
    spans: OrderArray
    cuts: OrderArray
    along: FloatArray


@inner_kernel
def halve(centres: FloatArray, order: OrderArray, first: int, end: int) -> int:
    """Sort ``order[first:end]`` into two halves of whole leaves that lie apart, and return where the second begins."""
    axis, longest = 0, -1.0
    for candidate in range(3):
        low = high = centres[order[first], candidate]
        for place in range(first + 1, end):
            low = min(low, centres[order[place], candidate])
            high = max(high, centres[order[place], candidate])
        if high - low > longest:
            axis, longest = candidate, high - low
    middle = first + WIDTH * ((end - first + 2 * WIDTH - 1) // (2 * WIDTH))
    # Quickselect (Hoare 1961): only the part with the middle in it is sorted further.
    lowest, highest = first, end - 1
    while lowest < highest:
        pivot = centres[order[(lowest + highest) // 2], axis]
        up, down = lowest, highest
        while up <= down:
            while centres[order[up], axis] < pivot:
                up += 1
            while centres[order[down], axis] > pivot:
                down -= 1
            if up <= down:
                order[up], order[down] = order[down], order[up]
                up += 1
                down -= 1
        if middle <= down:
            highest = down
        elif middle >= up:
            lowest = up
        else:
            break
    return middle


@inner_kernel
def cut(centres: FloatArray, order: OrderArray, cuts: OrderArray) -> int:
    """Cut the triangles between the first two ``cuts`` into up to eight, write theirs and return how many they are."""
    parts = 1
    for _ in range(3):
        for part in range(parts - 1, -1, -1):
            if cuts[part + 1] - cuts[part] > WIDTH:
                for later in range(parts, part, -1):
                    cuts[later + 1] = cuts[later]
                cuts[part + 1] = halve(centres, order, cuts[part], cuts[part + 1])
                parts += 1
    return parts


@inner_kernel
def write_box(
    box: FloatArray, lane: int, lower: FloatArray, upper: FloatArray, order: OrderArray, margin: float
) -> None:
    """Write the box around the triangles of ``order`` into ``box`` (6, 8), one rounding step larger than they are."""
    for axis in range(3):
        low, high = lower[order[0], axis], upper[order[0], axis]
        for face in order:
            low, high = min(low, lower[face, axis]), max(high, upper[face, axis])
        box[axis, lane], box[3 + axis, lane] = low - margin, high + margin


@inner_kernel
def write_leaf(leaf: FloatArray, vertices: FloatArray, faces: IntArray, order: OrderArray) -> None:
    """Write a corner and the two sides from it of every triangle of ``order`` into ``leaf`` (9, 8)."""
    for lane in range(len(order)):
        for axis in range(3):
            corner = vertices[faces[order[lane], 0], axis]
            leaf[axis, lane] = corner
            leaf[3 + axis, lane] = vertices[faces[order[lane], 1], axis] - corner
            leaf[6 + axis, lane] = vertices[faces[order[lane], 2], axis] - corner


@inner_kernel
def write_far_first(ranks: NDArray[np.uint8], box: FloatArray, parts: int, along: FloatArray) -> None:
    """Write for rays into each octant in which order they leave the children in ``box`` behind, the last one first."""
    for octant in range(OCTANTS):
        for lane in range(WIDTH):
            along[lane] = 0.0 if lane < parts else -np.inf
            for axis in range(3):
                if lane < parts:
                    middle = box[axis, lane] + box[3 + axis, lane]
                    along[lane] += -middle if (octant >> axis) & 1 else middle
        for lane in range(WIDTH):
            rank = 0
            for other in range(WIDTH):
                rank += along[other] > along[lane] or (along[other] == along[lane] and other < lane)
            ranks[octant, rank] = lane


def build_tree(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray, NDArray[np.uint8], FloatArray]:
    """Build the tree over ``faces`` (n >= 1, 3) of ``vertices`` (m, 3) [m].

    All memory is taken here: each kind of array that a kernel makes costs a first start as much as a short kernel.

    Returns
    -------
    boxes : (nodes, 6, 8) float64
        Min x y z and max x y z of the children of every node; of a child that does not exist NaN. Node 0 stands above
        the root: its one child is the root.
    children : (nodes, 8) int32
        Their numbers as nodes; of leaf i it is -1 - i.
    far_first : (nodes, 8, 8) uint8
        The order in which rays go on the stack, for each octant of directions (bit k is set where axis k falls).
    leaves : (leaves, 9, 8) float64
        A corner and the two sides from it of every triangle; those that do not exist are points.
    """
    a, b, c = vertices[faces[:, 0]], vertices[faces[:, 1]], vertices[faces[:, 2]]
    lower, upper = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
    margin = 1e-9 * max(1.0, float(np.abs(vertices).max()))
    leaf_count = (len(faces) + WIDTH - 1) // WIDTH
    most = leaf_count + 1  # a node has at least two children, but for the one above the root
    boxes, leaves = np.full((most, 6, WIDTH), np.nan), np.zeros((leaf_count, 9, WIDTH))
    children = np.zeros((most, WIDTH), dtype=np.int32)
    far_first = np.empty((most, OCTANTS, WIDTH), dtype=np.uint8)
    memory = Memory(
        np.arange(len(faces)), np.empty((most, 2), np.int64), np.empty(WIDTH + 1, np.int64), np.empty(WIDTH)
    )
    boxes_of_faces = BoxesOfFaces(lower, upper, 0.5 * (lower + upper), margin)
    nodes = fill_tree(boxes, children, far_first, leaves, vertices, faces, boxes_of_faces, memory)
    return boxes[:nodes].copy(), children[:nodes].copy(), far_first[:nodes].copy(), leaves


@kernel
def fill_tree(
    boxes: FloatArray,
    children: IntArray,
    far_first: NDArray[np.uint8],
    leaves: FloatArray,
    vertices: FloatArray,
    faces: IntArray,
    boxes_of_faces: BoxesOfFaces,
    memory: Memory,
) -> int:
    """Write what ``build_tree`` returns and return the number of nodes; ``boxes`` begin as NaN, ``leaves`` as 0."""
    order, spans, cuts, along = memory
    lower, upper, centres, margin = boxes_of_faces
    spans[0, 0], spans[0, 1] = 0, len(faces)
    node, node_count, written = 0, 1, 0
    while node < node_count:
        cuts[0], cuts[1] = spans[node, 0], spans[node, 1]
        parts = cut(centres, order, cuts) if node > 0 else 1
        for lane in range(parts):
            within = order[cuts[lane] : cuts[lane + 1]]
            write_box(boxes[node], lane, lower, upper, within, margin)
            if len(within) <= WIDTH:
                write_leaf(leaves[written], vertices, faces, within)
                written += 1
                children[node, lane] = -written
            else:
                spans[node_count, 0], spans[node_count, 1] = cuts[lane], cuts[lane + 1]
                children[node, lane] = node_count
                node_count += 1
        write_far_first(far_first[node], boxes[node], parts, along)
        node += 1
    return node_count
