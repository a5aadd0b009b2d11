"""Roughness: how much the normals change from vertex to vertex around a place [rad].

When to use: gravel, stubble, rubble. When not: as the only guard against steps; one sharp kerb in a smooth floor
averages out over the radius.
Rule of mesh_navigation: the mean edge angle of a vertex, averaged over the connected neighbourhood.
"""

from __future__ import annotations

from mbf_abstract.parameters import parameter
from mbf_mesh_nav.kernels.layers.neighbourhood_layers import mean_edge_angles, neighbourhood_means
from mbf_mesh_nav.map.layer import CostArray, LayerParameters, LethalArray, MeshLayer


class RoughnessParameters(LayerParameters):
    """Parameters of ``roughness``."""

    threshold: float = parameter(0.3, "Lethal above this roughness.", unit="rad", gt=0.0, le=3.1416)
    radius: float = parameter(0.3, "Radius of the neighbourhood.", unit="m", gt=0.0, le=5.0)


class RoughnessLayer(MeshLayer):
    """Mean angle between the normals of neighbours, averaged over the connected neighbourhood."""

    Parameters = RoughnessParameters
    parameters: RoughnessParameters
    unit = "rad"
    cacheable = True

    @classmethod
    def reach(cls, parameters: RoughnessParameters) -> float:
        """The radius of the neighbourhood."""
        return parameters.radius

    def compute(self) -> tuple[CostArray, LethalArray]:
        """Cost = roughness [rad], lethal above ``threshold``."""
        mesh = self.topology
        angles = mean_edge_angles(mesh.vertex_normals, mesh.neighbour_offsets, mesh.neighbours)
        costs = neighbourhood_means(
            angles, mesh.vertices, mesh.neighbour_offsets, mesh.neighbours, self.parameters.radius
        )
        return costs, costs > self.parameters.threshold
