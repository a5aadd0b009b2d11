"""What the combination layers share: the union of lethal flags and updates of changed vertices only."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.arrays import IntArray
from mbf_mesh_nav.map.layer import CostArray, LethalArray, MeshLayer


class CombinationLayer(MeshLayer):
    """Merges any number of inputs vertex by vertex."""

    inputs_allowed = (1, 1000)

    @classmethod
    def reach(cls, parameters: Any) -> float:
        """0: each vertex is merged by itself."""
        return 0.0

    @abstractmethod
    def combine(self, costs: list[CostArray], weights: list[float]) -> NDArray[np.floating]:
        """Merge the inputs' costs, each (n,), of the same n vertices into one (n,)."""

    def compute(self) -> tuple[CostArray, LethalArray]:
        """Merge all vertices."""
        return self._merged(np.arange(self.topology.vertex_count, dtype=np.int32))

    def update_from_inputs(self, changed: IntArray) -> IntArray:
        """Merge the changed vertices and return those whose result differs."""
        costs, lethal = self._merged(changed)
        differs = (costs != self._costs[changed]) | (lethal != self._lethal[changed])
        moved: IntArray = changed[differs]
        self._costs[moved], self._lethal[moved] = costs[differs], lethal[differs]
        return moved

    def _merged(self, vertices: IntArray) -> tuple[CostArray, LethalArray]:
        weights = [float(read.parameters.combination_weight) for read in self.inputs]
        costs = self.combine([read.costs[vertices] for read in self.inputs], weights)
        lethal = np.logical_or.reduce([read.lethal[vertices] for read in self.inputs])
        return costs.astype(np.float32), lethal
