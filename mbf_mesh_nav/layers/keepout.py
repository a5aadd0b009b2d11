"""Keep-out: regions the robot must not enter, as polygons on the map.

When to use: stairs, flower beds, areas closed by rule rather than by shape. When not: moving obstacles. Where a region
is narrower than the mesh's edges, the ends of the edges that cross it are closed too; a denser mesh keeps it narrower.
"""

from __future__ import annotations

import numpy as np

from mbf_abstract.parameters import parameter
from mbf_mesh_nav.layers.polygon_regions import Region
from mbf_mesh_nav.map.layer import CostArray, LayerParameters, LethalArray, MeshLayer


class KeepoutParameters(LayerParameters):
    """Parameters of ``keepout``."""

    regions: tuple[Region, ...] = parameter((), "Polygons that must not be entered.")


class KeepoutLayer(MeshLayer):
    """Lethal inside the regions, free outside."""

    Parameters = KeepoutParameters
    parameters: KeepoutParameters

    def configuration_warning(self) -> str:
        """The first region that is hardly meant as it is: a polygon that is none, or that closes nothing."""
        mesh = self.topology
        for index, region in enumerate(self.parameters.regions):
            if problem := region.warning():
                return f"{region.title('regions', index)}: {problem}"
            if not region.closed_mask(mesh.vertices, mesh.edges, mesh.faces).any():
                return f"{region.title('regions', index)}: there is no ground in it, at its heights"
        return ""

    def lethal_reason(self, vertex: int) -> str:
        """The region that closes it."""
        mesh, regions = self.topology, self.parameters.regions
        for index, region in enumerate(regions):
            if region.closed_mask(mesh.vertices, mesh.edges, mesh.faces)[vertex]:
                return region.title("regions", index)
        return ""

    @classmethod
    def reach(cls, parameters: KeepoutParameters) -> float:
        """0: the edges and faces at a vertex are all it looks at."""
        return 0.0

    def compute(self) -> tuple[CostArray, LethalArray]:
        """Cost 1 and lethal inside any region and at what closes it between vertices, else 0."""
        mesh = self.topology
        lethal = np.zeros(mesh.vertex_count, dtype=np.bool_)
        for region in self.parameters.regions:
            lethal |= region.closed_mask(mesh.vertices, mesh.edges, mesh.faces)
        return lethal.astype(np.float32), lethal
