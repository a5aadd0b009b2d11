"""The part of the surface under a round robot."""

from __future__ import annotations

import numpy as np

from mbf_mesh_nav.arrays import FloatArray, IntArray
from mbf_mesh_nav.kernels.compiled import kernel


@kernel
def vertices_in_disc(
    vertices: FloatArray, offsets: IntArray, neighbours: IntArray, start: int, centre: FloatArray, radius: float
) -> IntArray:
    """Vertices reached from ``start`` over edges without leaving ``radius`` [m] of ``centre`` (3,); start included.

    Being connected, they lie on one storey.
    """
    seen = np.zeros(vertices.shape[0], dtype=np.bool_)
    members = np.empty(vertices.shape[0], dtype=np.int32)
    members[0] = start
    seen[start] = True
    size, head = 1, 0
    while head < size:
        vertex = members[head]
        head += 1
        for entry in range(offsets[vertex], offsets[vertex + 1]):
            other = neighbours[entry]
            if seen[other]:
                continue
            seen[other] = True
            dx, dy, dz = vertices[other, 0] - centre[0], vertices[other, 1] - centre[1], vertices[other, 2] - centre[2]
            if dx * dx + dy * dy + dz * dz <= radius * radius:
                members[size] = other
                size += 1
    return members[:size].copy()
