"""Layer `flooded_ground`: ground below a water level is lethal, ground just above it costs more the lower it lies.

When to use: rivers and tides of a known level. When not: the level differs from place to place; it is one number.
"""

from __future__ import annotations

import numpy as np

from mbf_abstract.parameters import parameter
from mbf_mesh_nav.map.layer import CostArray, LayerParameters, LethalArray, MeshLayer


class FloodedGroundParameters(LayerParameters):
    """Parameters of `flooded_ground`."""

    water_level: float = parameter(-0.5, "Height of the water.", unit="m")
    margin: float = parameter(0.5, "Height above the water where the cost has fallen to 0.", unit="m", gt=0.0)


class FloodedGround(MeshLayer):
    """Reads nothing but the heights of the vertices."""

    Parameters = FloodedGroundParameters
    parameters: FloodedGroundParameters

    def compute(self) -> tuple[CostArray, LethalArray]:
        """Cost from 1 at the water to 0 at ``margin`` above it; lethal below the water."""
        above = self.topology.vertices[:, 2] - self.parameters.water_level
        costs = np.clip(1.0 - above / self.parameters.margin, 0.0, 1.0).astype(np.float32)
        return costs, above < 0.0
