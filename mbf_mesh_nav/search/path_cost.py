"""Cost of a path over the surface: its length plus the map's costs integrated along it.

Along edges that is the sum of their weights; a path through faces has the costs of their corners interpolated in
between, so both agree where a path follows an edge.
"""

from __future__ import annotations

import numpy as np

from mbf_mesh_nav.arrays import FloatArray, IntArray
from mbf_mesh_nav.kernels.motion.path_costs import way_cost
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.map.snapshot import MeshSnapshot


def cost_along(mesh_map: MeshMap, snapshot: MeshSnapshot, positions: FloatArray, point_faces: IntArray) -> float:
    """Length plus collected cost [m] of a path.

    Parameters
    ----------
    positions : (n, 3) float64
        Points on the surface [m].
    point_faces : (n,) int32
        The face in which the segment to each point lies. Corners of infinite cost, which only the faces of a start or a
        goal have, do not count.
    """
    return way_cost(
        mesh_map.vertices,
        mesh_map.faces,
        snapshot.costs,
        snapshot.edge_cost_factor,
        np.ascontiguousarray(positions),
        point_faces,
    )
