"""Any-angle paths: the descent of a continuous wave, shortened by string pulling, without the field.

Strengths: the path of ``mesh.cvp``, a geodesic where nothing on it has a cost, without computing a vector field; over
costs it is shortened as far as that costs no more, where ``mesh.cvp`` keeps the descent of the field. Known failure: a
local optimum over costs, there it passes ridges and obstacles on the side on which the wave did; where nothing costs
and faces are large, other courses are looked for (``other_courses``). Cost: little more than that of a wave, twice that
for the short paths of which other courses are looked at. When not: with a controller that wants a field; over costs on
coarse meshes, with faces as long as the path around an obstacle, densify the map (``mesh_map.densify``).
"""

from __future__ import annotations

from mbf_mesh_nav.plugins import MeshContext
from mbf_mesh_nav.search.leg_search import Leg, LegQuery
from mbf_mesh_nav.search.path_cost import cost_along
from mbf_mesh_nav.search.surface_planner import SurfacePlanner
from mbf_mesh_nav.search.wave_search import WaveSearch


class AnyAnglePlanner(SurfacePlanner):
    """Wave from the goal, descent from the start, shortened by a funnel."""

    def __init__(self, context: MeshContext) -> None:
        super().__init__(context)
        self._search = WaveSearch(self.mesh_map)

    def find_leg(self, query: LegQuery) -> Leg | None:
        """Propagate the wave until the start is reached, take the shortened descent of its field."""
        wave = self._search.propagate(query, overshoot=0.0)
        if wave is None:
            return None
        positions, point_faces = self._search.path(query, wave, pull_over_costs=True)
        normals = self.mesh_map.face_normals[point_faces]
        cost = cost_along(self.mesh_map, query.snapshot, positions, point_faces)
        return Leg(positions, normals, cost, note=self._search.edges_text(query, wave, positions, point_faces))
