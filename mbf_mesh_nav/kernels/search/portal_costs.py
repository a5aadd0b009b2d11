"""The least distance among the vertices of each portal of a tile."""

from __future__ import annotations

import numpy as np

from mbf_mesh_nav.arrays import Float32Array, IntArray
from mbf_mesh_nav.kernels.compiled import Index, kernel


@kernel
def least_of_portals(distances: Float32Array, shared: IntArray, portal_of: IntArray, count: int) -> Float32Array:
    """Least of the distances (V,) among the ``shared`` vertices (s,) of each of ``count`` portals; inf for none."""
    least = np.full(count, np.inf, dtype=np.float32)
    for place in range(len(shared)):
        portal = Index(portal_of[place])
        least[portal] = min(least[portal], distances[Index(shared[place])])
    return least
