"""Ridge: large on convex ridges, small in furrows; meant for driving between crop beds.

When to use: to keep a robot in the furrow by cost. When not: as a guard; its value is about the radius on a flat
surface and has no meaning in metres of step height. Rule of mesh_navigation: mean distance of the tips of unit normals
planted on a vertex and on its neighbourhood. A vertex without a neighbour within the radius gets ``threshold + 0.1``.
"""

from __future__ import annotations

from mbf_abstract.parameters import parameter
from mbf_mesh_nav.kernels.layers.neighbourhood_layers import normal_tip_distances
from mbf_mesh_nav.map.layer import CostArray, LayerParameters, LethalArray, MeshLayer


class RidgeParameters(LayerParameters):
    """Parameters of ``ridge``."""

    threshold: float = parameter(0.3, "Lethal above this value.", unit="m", gt=0.0)
    radius: float = parameter(0.3, "Radius of the neighbourhood.", unit="m", gt=0.0, le=5.0)


class RidgeLayer(MeshLayer):
    """Mean distance between the tips of the vertex normals of a neighbourhood."""

    Parameters = RidgeParameters
    parameters: RidgeParameters
    cacheable = True

    @classmethod
    def reach(cls, parameters: RidgeParameters) -> float:
        """The radius of the neighbourhood."""
        return parameters.radius

    def compute(self) -> tuple[CostArray, LethalArray]:
        """Cost = mean tip distance [m], lethal above ``threshold``."""
        mesh = self.topology
        costs = normal_tip_distances(
            mesh.vertices,
            mesh.vertex_normals,
            mesh.neighbour_offsets,
            mesh.neighbours,
            self.parameters.radius,
            self.parameters.threshold + 0.1,
        )
        return costs, costs > self.parameters.threshold
