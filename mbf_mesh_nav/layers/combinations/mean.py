"""Weighted mean of the inputs: the sum of ``weighted_sum`` divided by the weights.

When to use: soft preferences from several layers of like units. When not: guards; a deadly value of one layer is
diluted (the lethal flag is not: it is the union).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.layers.combinations.weighted_sum import WeightedSumLayer
from mbf_mesh_nav.map.layer import CostArray


class MeanLayer(WeightedSumLayer):
    """Vertex by vertex the mean cost of the inputs, weighted by ``combination_weight``."""

    def combine(self, costs: list[CostArray], weights: list[float]) -> NDArray[np.floating]:
        """Weighted mean; an input of weight 0 plays no part. All weights 0 give 0."""
        return super().combine(costs, weights) / max(sum(weights), 1e-12)
