"""Weighted sum of the inputs (what mesh_navigation calls AvgCombination: it does not divide).

When to use: to add up costs in one unit, or as the reference configuration does, mainly for the union of lethal
flags. When not: with more inputs than the cost limit of the planner allows for; use ``mean``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.layers.combinations.combination import CombinationLayer
from mbf_mesh_nav.map.layer import CostArray


class WeightedSumLayer(CombinationLayer):
    """Vertex by vertex the sum of ``combination_weight * cost`` of the inputs."""

    def combine(self, costs: list[CostArray], weights: list[float]) -> NDArray[np.floating]:
        """Sum of weight times cost; an input of weight 0 plays no part, even where its cost is infinite."""
        total = np.zeros(len(costs[0]))
        for cost, weight in zip(costs, weights, strict=True):
            if weight > 0.0:
                total += weight * cost
        return total
