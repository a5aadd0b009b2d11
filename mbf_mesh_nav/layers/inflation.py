"""Inflation: costs that fall off with the distance, over the surface, from lethal vertices.

When to use: below every planner; it keeps the robot's body off what its centre must not touch. When not: to model a
long narrow robot (the inscribed radius is a circle; use ``tilt`` or a footprint check besides).
Rule of mesh_navigation: ``lethal_value`` at the lethal vertices, ``inscribed_value`` up to the inscribed radius, then
``inscribed_value * exp(-cost_scaling_factor (d - inscribed_radius))`` up to the inflation radius, 0 beyond. Deviations:
isolated lethal vertices are inflated too, and a change of the input repairs the distances instead of starting over. The
repulsive vectors are not offered; our planners do not steer by them.
Cost: linear in the vertices within the radius; an update in the vertices whose distance changes.
"""

from __future__ import annotations

import math

import numpy as np
from pydantic import model_validator

from mbf_abstract.maps.layers.inflation import InflationRadii
from mbf_abstract.parameters import parameter
from mbf_mesh_nav.arrays import IntArray
from mbf_mesh_nav.kernels.layers.inflation import repair_distances, set_fading_costs
from mbf_mesh_nav.map.layer import CostArray, LayerContext, LayerParameters, LethalArray, MeshLayer


class InflationParameters(LayerParameters, InflationRadii):
    """Parameters of ``inflation``."""

    inscribed_radius: float = parameter(0.25, "Radius of the robot's inner circle.", unit="m", gt=0.0)
    inflation_radius: float = parameter(0.4, "Distance at which the cost ends.", unit="m", gt=0.0)
    lethal_value: float = parameter(1.0, "Cost of lethal vertices; .inf is the safe choice.", ge=0.0, allow_inf=True)
    inscribed_value: float = parameter(0.99, "Cost up to the inscribed radius.", ge=0.0)
    cost_scaling_factor: float = parameter(1.0, "Rate of the exponential fall-off.", unit="1/m", ge=0.0)

    @model_validator(mode="after")
    def _reaches_the_robot(self) -> InflationParameters:
        if self.inflation_radius < self.inscribed_radius:
            raise ValueError(
                f"inflation_radius of at least inscribed_radius, {self.inscribed_radius:g} m: else ground the "
                f"robot's body touches would be free, got {self.inflation_radius:g} m"
            )
        return self

    def relaxed(self, factor: float, robot_radius: float) -> InflationParameters:
        """As of all inflations; the layer's own inscribed radius shrinks too, to that of the robot at most."""
        inscribed = min(self.inscribed_radius, max(factor * self.inscribed_radius, robot_radius or math.inf))
        return super().relaxed(factor, inscribed).model_copy(update={"inscribed_radius": inscribed})


class InflationLayer(MeshLayer):
    """Costs by geodesic distance from the lethal vertices of its one input.

    Attributes
    ----------
    distances : (V,) float32
        Geodesic distance [m] to the nearest lethal vertex, inf beyond the inflation radius.
    """

    Parameters = InflationParameters
    parameters: InflationParameters
    inputs_allowed = (1, 1)

    def __init__(self, context: LayerContext) -> None:
        super().__init__(context)
        self._drop_all()

    def compute(self) -> tuple[CostArray, LethalArray]:
        """Distances from scratch, costs from distances, lethal as the input."""
        self._drop_all()
        count = self.topology.vertex_count
        costs, lethal = np.zeros(count, dtype=np.float32), np.zeros(count, dtype=np.bool_)
        self._repair(np.flatnonzero(self.inputs[0].lethal).astype(np.int32), costs, lethal)
        return costs, lethal

    def update_from_inputs(self, changed: IntArray) -> IntArray:
        """Repair the distances around the vertices whose lethal flag changed, and the costs."""
        return np.sort(self._repair(changed, self._costs, self._lethal))

    def _drop_all(self) -> None:
        self.distances = np.full(self.topology.vertex_count, np.inf, dtype=np.float32)
        self._sources = np.full((self.topology.vertex_count, 2), -1, dtype=np.int32)

    def _repair(self, changed: IntArray, costs: CostArray, known_lethal: LethalArray) -> IntArray:
        """Bring distances, costs and flags up to date in place; a flag that changed is a change at any cost."""
        mesh, settings = self.topology, self.parameters
        touched, flips = repair_distances(
            mesh.vertices,
            mesh.faces,
            mesh.vertex_face_offsets,
            mesh.vertex_faces,
            mesh.neighbour_offsets,
            mesh.neighbours,
            settings.inflation_radius,
            self.inputs[0].lethal,
            known_lethal,
            changed,
            self.distances,
            self._sources,
        )
        return set_fading_costs(
            self.distances,
            touched,
            flips,
            settings.inscribed_radius,
            settings.lethal_value,
            settings.inscribed_value,
            settings.cost_scaling_factor,
            costs,
        )
