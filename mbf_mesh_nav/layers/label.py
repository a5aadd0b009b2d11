"""Label: costs by kind of surface, drawn as labelled polygons.

When to use: lawn costs more than path, mud is forbidden. When not: shapes known from the mesh itself. Where regions
overlap the last one in the list counts. Forbidden regions are closed as those of ``keepout`` are.
"""

from __future__ import annotations

import numpy as np
from pydantic import model_validator

from mbf_abstract.parameters import parameter
from mbf_mesh_nav.layers.polygon_regions import Region
from mbf_mesh_nav.map.layer import CostArray, LayerParameters, LethalArray, MeshLayer


class LabelledRegion(Region):
    """A polygon with the name of its kind of surface."""

    label: str = parameter(..., "Kind of surface, a key of ``label_costs``.")


class LabelParameters(LayerParameters):
    """Parameters of ``label``."""

    regions: tuple[LabelledRegion, ...] = parameter((), "Labelled polygons.")
    label_costs: dict[str, float] = parameter({}, "Cost of each label.")
    lethal_labels: tuple[str, ...] = parameter((), "Labels the robot must not enter.")
    default_cost: float = parameter(0.0, "Cost outside all regions.", ge=0.0)

    @model_validator(mode="after")
    def _labels_are_known(self) -> LabelParameters:
        known = {*self.label_costs, *self.lethal_labels}
        if unknown := sorted({region.label for region in self.regions} - known):
            raise ValueError(
                f"a cost for every label, not for {', '.join(sorted(known)) or 'none'} only: {', '.join(unknown)}"
            )
        if negative := [label for label, cost in self.label_costs.items() if cost < 0.0]:
            raise ValueError(f"label costs of at least 0, not those of {', '.join(negative)}")
        return self


class LabelLayer(MeshLayer):
    """Cost and lethal flag by the label of the region a vertex lies in."""

    Parameters = LabelParameters
    parameters: LabelParameters

    @classmethod
    def reach(cls, parameters: LabelParameters) -> float:
        """0: the edges and faces at a vertex are all it looks at."""
        return 0.0

    def compute(self) -> tuple[CostArray, LethalArray]:
        """Cost of the last region that holds the vertex, ``default_cost`` outside."""
        mesh = self.topology
        costs = np.full(mesh.vertex_count, self.parameters.default_cost, dtype=np.float32)
        lethal = np.zeros(mesh.vertex_count, dtype=np.bool_)
        for region in self.parameters.regions:
            forbidden = region.label in self.parameters.lethal_labels
            # What must not be entered is closed between the vertices too; a cost there would extend beyond its region.
            closed = region.closed_mask(mesh.vertices, mesh.edges, mesh.faces) if forbidden else None
            inside = region.mask(mesh.vertices) if closed is None else closed
            costs[inside] = self.parameters.label_costs.get(region.label, 1.0)
            lethal[inside] = forbidden
        return costs, lethal
