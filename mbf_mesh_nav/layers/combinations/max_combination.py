"""Maximum of the inputs.

When to use: to join inflated maps (static and sensed obstacles). When not: to weigh raw layers with different units.
Rule of mesh_navigation: start at 0, ignore the combination weights; lethal is the union.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.layers.combinations.combination import CombinationLayer
from mbf_mesh_nav.map.layer import CostArray


class MaxCombinationLayer(CombinationLayer):
    """Vertex by vertex the greatest cost of the inputs, at least 0."""

    def combine(self, costs: list[CostArray], weights: list[float]) -> NDArray[np.floating]:
        """Greatest cost; weights play no part."""
        return np.asarray(np.maximum.reduce([np.zeros_like(costs[0]), *costs]))
