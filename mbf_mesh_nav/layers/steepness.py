"""Steepness: the angle between the vertex normal and the vertical [rad].

When to use: always, as the cheapest guard against walls and slopes the robot slides on. When not: where the heading
decides (a robot that may climb 20 degrees but tips at 10 degrees sideways): use ``tilt``. A face that looks down
counts as upside down (pi), so the mesh must be wound upwards.
Rule of mesh_navigation: acos of the normal's z component.
"""

from __future__ import annotations

from mbf_abstract.parameters import parameter
from mbf_mesh_nav.kernels.mesh.slopes import inclinations
from mbf_mesh_nav.map.layer import CostArray, LayerParameters, LethalArray, MeshLayer


class SteepnessParameters(LayerParameters):
    """Parameters of ``steepness``."""

    threshold: float = parameter(0.3, "Lethal above this inclination.", unit="rad", gt=0.0, le=3.1416)


class SteepnessLayer(MeshLayer):
    """Inclination of the surface, without direction."""

    Parameters = SteepnessParameters
    parameters: SteepnessParameters

    @classmethod
    def reach(cls, parameters: SteepnessParameters) -> float:
        """0: the faces around a vertex are all it looks at."""
        return 0.0

    def compute(self) -> tuple[CostArray, LethalArray]:
        """Cost = inclination [rad] from 0 to pi, lethal above ``threshold``."""
        costs = inclinations(self.topology.vertex_normals)
        return costs, costs > self.parameters.threshold
