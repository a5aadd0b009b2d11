"""What a way over the surface costs: its length plus what the map's costs collect along it.

Along edges that is the sum of their weights; a way through faces has the costs of their corners interpolated in
between, so both agree where a way follows an edge.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.arithmetic import norm
from mbf_mesh_nav.mesh_map import MeshMap
from mbf_mesh_nav.snapshot import MeshSnapshot


def cost_along(
    mesh_map: MeshMap, snapshot: MeshSnapshot, positions: NDArray[np.float64], point_faces: NDArray[np.int32]
) -> float:
    """Length plus collected cost [m] of a path.

    Parameters
    ----------
    positions : (n, 3) float64
        Points on the surface [m].
    point_faces : (n,) int32
        The face in which the way to each point lies. Corners of infinite cost, which only the faces of a start or a
        goal have, do not count.
    """
    lengths = norm(np.diff(positions, axis=0))
    if snapshot.edge_cost_factor == 0.0:
        return float(lengths.sum())
    middles = (positions[1:] + positions[:-1]) / 2.0
    corners = mesh_map.faces[point_faces[1:]]
    a, b, c = (mesh_map.vertices[corners[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    squared = np.sum(normals**2, axis=1)
    weight_b = np.sum(np.cross(middles - a, c - a) * normals, axis=1) / squared
    weight_c = np.sum(np.cross(b - a, middles - a) * normals, axis=1) / squared
    weights = np.stack([1.0 - weight_b - weight_c, weight_b, weight_c], axis=1)
    corner_costs = snapshot.costs[corners].astype(np.float64)
    finite = np.isfinite(corner_costs)
    costs = np.sum(weights * np.where(finite, corner_costs, 0.0), axis=1)
    costs /= np.maximum(np.sum(np.where(finite, weights, 0.0), axis=1), 1e-9)
    return float(np.sum(lengths * (1.0 + snapshot.edge_cost_factor * costs)))
