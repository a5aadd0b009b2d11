"""Clearance: free height above the surface for a robot of a given height.

When to use: multi-storey maps, tunnels, doors, furniture. When not: open terrain, it only costs time (one ray a
vertex).
Rule of mesh_navigation: a ray from 1 mm above the vertex along its normal; cost 1 and lethal below the robot's height,
a cosine ramp over ``height_inflation`` above it, then 0.
"""

from __future__ import annotations

import numpy as np

from mbf_abstract.parameters import parameter
from mbf_mesh_nav.arrays import FloatArray
from mbf_mesh_nav.map.layer import CostArray, LayerParameters, LethalArray, MeshLayer

RAY_OFFSET = 0.001
"""Start of the ray above the surface [m], so that it does not hit the faces it stands on."""


class ClearanceParameters(LayerParameters):
    """Parameters of ``clearance``."""

    robot_height: float = parameter(..., "Height the robot needs above the surface.", unit="m", gt=0.0, le=100.0)
    height_inflation: float = parameter(0.3, "Additional height over which the cost falls to 0.", unit="m", ge=0.0)


class ClearanceLayer(MeshLayer):
    """Free height along the vertex normal, as a cost from 1 (does not fit) to 0."""

    Parameters = ClearanceParameters
    parameters: ClearanceParameters
    cacheable = True

    @classmethod
    def reach(cls, parameters: ClearanceParameters) -> float:
        """The length of the ray."""
        return parameters.robot_height + parameters.height_inflation

    def free_heights(self) -> FloatArray:
        """Free height [m] above every vertex (V,), inf where it is more than the robot and the ramp need."""
        normals = self.topology.vertex_normals
        enough = self.parameters.robot_height + self.parameters.height_inflation
        starts = self.topology.vertices + RAY_OFFSET * normals
        _, distances = self.locator.cast_rays(starts, normals, enough)
        return distances + RAY_OFFSET

    def compute(self) -> tuple[CostArray, LethalArray]:
        """Cost by free height, lethal where it is less than ``robot_height``."""
        spare = self.free_heights() - self.parameters.robot_height
        lethal: LethalArray = np.asarray(spare < 0.0)
        costs = lethal.astype(np.float32)
        ramp = ~lethal & (spare < self.parameters.height_inflation)
        costs[ramp] = (np.cos(np.pi * spare[ramp] / self.parameters.height_inflation) + 1.0) / 2.0
        return costs, lethal
