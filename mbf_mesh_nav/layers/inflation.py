"""Inflation: costs that fall off with the distance, over the surface, from lethal vertices.

When to use: below every planner; it keeps the robot's body off what its centre must not touch. When not: to model a
long narrow robot (the inscribed radius is a circle; use ``tilt`` or a footprint check besides).
Rule of mesh_navigation: ``lethal_value`` at the lethal vertices, ``inscribed_value`` up to the inscribed radius, then
``inscribed_value * exp(-cost_scaling_factor (d - inscribed_radius))`` up to the inflation radius, 0 beyond. Deviations:
isolated lethal vertices are inflated too, distances are measured straight from them and past convex corners (see
``kernels/layers/front_offers.py``), with ``source_cost`` also vertices that are not lethal are inflated, a change of
the input repairs the distances instead of starting over, and ``inscribed_value`` is 1 by default instead of 0.99:
planners would pass where the robot touches. Beyond the inscribed radius costs are always less than that, also where the
fall-off is 0. The repulsive vectors are not offered; our planners do not steer by them.
Cost: linear in the vertices within the radius; an update in the vertices whose distance changes.
"""

from __future__ import annotations

import math

import numpy as np
from pydantic import model_validator

from mbf_abstract.maps.layers.inflation import InflationRadii
from mbf_abstract.parameters import parameter, with_changes
from mbf_mesh_nav.arrays import IntArray
from mbf_mesh_nav.kernels.layers.fading_costs import set_fading_costs
from mbf_mesh_nav.kernels.layers.inflation import repair_distances, update_sources
from mbf_mesh_nav.map.layer import CostArray, LayerContext, LayerParameters, LethalArray, MeshLayer
from mbf_mesh_nav.map.layer_graph import union_of


class InflationParameters(LayerParameters, InflationRadii):
    """Parameters of ``inflation``."""

    inscribed_radius: float = parameter(0.25, "Radius of the robot's inner circle.", unit="m", gt=0.0)
    inflation_radius: float = parameter(0.4, "Distance at which the cost ends.", unit="m", gt=0.0)
    lethal_value: float = parameter(1.0, "Cost of lethal vertices; .inf is the safe choice.", ge=0.0, allow_inf=True)
    inscribed_value: float = parameter(
        1.0, "Cost up to the inscribed radius; below the cost_limit of planners they pass there.", ge=0.0
    )
    cost_scaling_factor: float = parameter(
        1.0, "Rate of the exponential fall-off; with 0 ground within the radius is dear, but free.", unit="1/m", ge=0.0
    )
    source_cost: float = parameter(
        math.inf,
        "Vertices of the input whose cost reaches this are inflated like lethal ones, without becoming lethal.",
        gt=0.0,
        allow_inf=True,
    )

    @model_validator(mode="after")
    def _reaches_the_robot(self) -> InflationParameters:
        if self.inflation_radius < self.inscribed_radius:
            raise ValueError(
                f"inflation_radius of at least inscribed_radius, {self.inscribed_radius:g} m: else ground the "
                f"robot's body touches would be free, got {self.inflation_radius:g} m"
            )
        return self

    def for_radius(self, old: float, new: float) -> InflationParameters:
        """Both radii grow or shrink by as much as the robot, so its costs fall off over the same distance."""
        change = new - (old or self.inscribed_radius)
        radii = {name: getattr(self, name) + change for name in ("inscribed_radius", "inflation_radius")}
        return with_changes(self, radii)

    def relaxed(self, factor: float, robot_radius: float) -> InflationParameters:
        """As of all inflations; the layer's own inscribed radius shrinks too, to that of the robot at most."""
        inscribed = min(self.inscribed_radius, max(factor * self.inscribed_radius, robot_radius or math.inf))
        return super().relaxed(factor, inscribed).model_copy(update={"inscribed_radius": inscribed})


class InflationLayer(MeshLayer):
    """Costs by geodesic distance from the sources in its one input: the vertices that are lethal, or costly enough.

    Attributes
    ----------
    distances : (V,) float32
        Geodesic distance [m] to the nearest source, inf beyond the inflation radius.
    """

    Parameters = InflationParameters
    parameters: InflationParameters
    inputs_allowed = (1, 1)

    def __init__(self, context: LayerContext) -> None:
        super().__init__(context)
        self._drop_all()

    @classmethod
    def reach(cls, parameters: InflationParameters) -> float:
        """The inflation radius and half as much: what a distance is made from may lie aside along the front."""
        return 1.5 * parameters.inflation_radius

    def compute(self) -> tuple[CostArray, LethalArray]:
        """Distances from scratch, costs from distances, lethal as the input."""
        self._drop_all()
        costs, source = np.zeros(self.topology.vertex_count, dtype=np.float32), self.inputs[0]
        self._is_source = source.lethal | (source.costs >= self.parameters.source_cost)
        self._repair(np.flatnonzero(self._is_source).astype(np.int32), costs)
        return costs, source.lethal.copy()

    def update_from_inputs(self, changed: IntArray) -> IntArray:
        """Repair the distances around the vertices that became sources or ceased to be, and the costs."""
        source, source_cost = self.inputs[0], np.float32(self.parameters.source_cost)
        flipped = update_sources(source.lethal, source.costs, source_cost, changed, self._lethal, self._is_source)
        repaired = self._repair(changed, self._costs)
        repaired.sort()
        return union_of([repaired, flipped])

    def _drop_all(self) -> None:
        count = self.topology.vertex_count
        self.distances = np.full(count, np.inf, dtype=np.float32)
        self._made_from = np.full((count, 3), -1, dtype=np.int32)
        # Which vertices are sources now, and of which the distances are.
        self._is_source, self._known_sources = np.zeros(count, dtype=np.bool_), np.zeros(count, dtype=np.bool_)

    def _repair(self, changed: IntArray, costs: CostArray) -> IntArray:
        """Bring distances and costs up to date in place; a vertex that became a source has changed at any cost."""
        settings = self.parameters
        touched, flips = repair_distances(
            self.topology.surface,
            settings.inflation_radius,
            self._is_source,
            self._known_sources,
            changed,
            self.distances,
            self._made_from,
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
