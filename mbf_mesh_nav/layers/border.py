"""Border: vertices where the mesh ends.

When to use: nearly always; beyond a border lies the unknown. When not: scans full of small holes, where every hole
becomes an obstacle; close the holes first or raise ``threshold`` above ``border_cost``.
Rule of mesh_navigation: ``border_cost`` at both ends of an edge that has one face only, else 0.
"""

from __future__ import annotations

import numpy as np

from mbf_abstract.parameters import parameter
from mbf_mesh_nav.map.layer import CostArray, LayerParameters, LethalArray, MeshLayer


class BorderParameters(LayerParameters):
    """Parameters of ``border``."""

    threshold: float = parameter(0.5, "Lethal above this cost.", gt=0.0)
    border_cost: float = parameter(1.0, "Cost of a vertex at the border.", gt=0.0)


class BorderLayer(MeshLayer):
    """Marks the vertices at the boundary of the mesh and of its holes."""

    Parameters = BorderParameters
    parameters: BorderParameters

    @classmethod
    def reach(cls, parameters: BorderParameters) -> float:
        """0: the faces around a vertex are all it looks at."""
        return 0.0

    def compute(self) -> tuple[CostArray, LethalArray]:
        """Cost = ``border_cost`` at the border, lethal if that exceeds ``threshold``."""
        costs = np.zeros(self.topology.vertex_count, dtype=np.float32)
        costs[self.topology.border_vertices] = self.parameters.border_cost
        return costs, costs > self.parameters.threshold
