"""Height difference: how far the surface around a vertex reaches above and below its tangent plane [m].

When to use: steps, kerbs, walls and holes that are small against the slope of the ground; pair it with ``steepness``,
because a smooth slope costs nothing here. When not: meshes whose edges are as long as the radius (nothing lies within
it) and noisy scans with random normals.
Rule of mesh_navigation: the neighbourhood is a cylinder about the vertex normal. It has no bound along the normal
there, so next to a wall it can run over the whole mesh, at a cost quadratic in the vertices;
``height_limit`` bounds it.
"""

from __future__ import annotations

import numpy as np

from mbf_abstract.parameters import parameter
from mbf_mesh_nav.kernels.neighbourhood_layers import height_differences
from mbf_mesh_nav.layer import CostArray, LayerParameters, LethalArray, MeshLayer


class HeightDiffParameters(LayerParameters):
    """Parameters of ``height_diff``."""

    threshold: float = parameter(0.185, "Lethal above this height difference.", unit="m", gt=0.0)
    radius: float = parameter(0.3, "Radius of the neighbourhood, across the normal.", unit="m", gt=0.0, le=5.0)
    height_limit: float = parameter(
        np.inf, "Half the height of the neighbourhood, along the normal.", unit="m", gt=0.0, allow_inf=True
    )


class HeightDiffLayer(MeshLayer):
    """Greatest minus least height along the vertex normal over the connected neighbourhood."""

    Parameters = HeightDiffParameters
    parameters: HeightDiffParameters
    cacheable = True

    def compute(self) -> tuple[CostArray, LethalArray]:
        """Cost = height difference [m], lethal above ``threshold``."""
        mesh = self.topology
        costs = height_differences(
            mesh.vertices,
            mesh.vertex_normals,
            mesh.neighbour_offsets,
            mesh.neighbours,
            self.parameters.radius,
            self.parameters.height_limit,
        )
        return costs, costs > self.parameters.threshold
