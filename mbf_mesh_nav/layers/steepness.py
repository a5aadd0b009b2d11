"""Steepness: the angle between the vertex normal and the vertical [rad].

When to use: always, as the cheapest guard against walls and slopes the robot slides on. When not: where the heading
decides (a robot that may climb 20 degrees but tips at 10 degrees sideways): use ``tilt``. A face that looks down
counts as upside down (pi), so the mesh must be wound upwards.
Rule of mesh_navigation: acos of the normal's z component. On a map whose heights have an error the threshold is lower,
by the standard error of the normal: on a square grid of triangles with the spacing L, the mean of the six normals
around a vertex is wrong by error / (sqrt(3) L), along x as along y.
"""

from __future__ import annotations

import math

import numpy as np

from mbf_abstract.parameters import parameter
from mbf_mesh_nav.kernels.mesh.slopes import inclinations
from mbf_mesh_nav.map.height_error import Errors, HeightErrorParameters, angle_of, errors_for, narrowed
from mbf_mesh_nav.map.layer import CostArray, LethalArray, MeshLayer

SPACING = 3.0 / (2.0 + math.sqrt(2.0))
"""Spacing of a square grid of triangles, in mean lengths of its edges."""


class SteepnessParameters(HeightErrorParameters):
    """Parameters of ``steepness``."""

    threshold: float = parameter(0.3, "Lethal above this inclination.", unit="rad", gt=0.0, le=3.1416)


class SteepnessLayer(MeshLayer):
    """Inclination of the surface, without direction."""

    Parameters = SteepnessParameters
    parameters: SteepnessParameters
    unit = "rad"

    @property
    def lethal_for_good(self) -> LethalArray:
        """Above ``threshold`` on the map as it is."""
        return self.costs > self.parameters.threshold

    @classmethod
    def reach(cls, parameters: SteepnessParameters) -> float:
        """0: the faces around a vertex are all it looks at."""
        return 0.0

    def compute(self) -> tuple[CostArray, LethalArray]:
        """Cost = inclination [rad] from 0 to pi, lethal above ``threshold`` less the error of the normals."""
        costs = inclinations(np.ascontiguousarray(self.topology.vertex_normals[:, 2]))
        return costs, costs > narrowed(self.parameters.threshold, self.normal_error, 0.0)

    @property
    def normal_error(self) -> Errors:
        """Standard error of a normal in one direction [rad], of all vertices or of each."""
        spacing = SPACING * self.topology.mean_edge_length
        return angle_of(errors_for(self) / (math.sqrt(3.0) * spacing))
