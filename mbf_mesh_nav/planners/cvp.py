"""Continuous vector planner: a wave over faces, a path down its distance field, and the field for the controller.

Strengths: paths cross faces freely and are geodesics, as short as the surface allows (within 0.2 % on average),
whatever the triangulation; every pair ``mesh.dijkstra`` finds a path for gets one; the field lets a controller correct
deviations. Without a path over whole free faces the wave walks along single edges, and the message says so.
Known failure: on rough meshes one vertex in 5,000 or so is 2 to 4 % off in the field, where two fronts meet; over
costs, where faces are as long as the path to the goal, the path may pass a ridge or an obstacle on the longer side, by
some percent; densify such a map (``mesh_map.densify``). The field is the wave's, also where the path is shorter.
Cost: about 0.4 us a vertex nearer than the goal. The C++ original's rule and defaults; the path is traced exactly here.
"""

from __future__ import annotations

from mbf_abstract.parameters import parameter
from mbf_mesh_nav.plugins import MeshContext
from mbf_mesh_nav.search.leg_search import Leg, LegQuery
from mbf_mesh_nav.search.path_cost import cost_along
from mbf_mesh_nav.search.surface_planner import SurfacePlanner, SurfacePlannerParameters
from mbf_mesh_nav.search.wave_search import WaveSearch


class CVPParameters(SurfacePlannerParameters):
    """Parameters of ``mesh.cvp``."""

    goal_dist_offset: float = parameter(
        0.3, "How far beyond the robot the field is computed; a controller needs it to correct.", unit="m", ge=0.0
    )


class CVPPlanner(SurfacePlanner):
    """Wave from the goal, descent from the start."""

    Parameters = CVPParameters
    parameters: CVPParameters

    def __init__(self, context: MeshContext) -> None:
        super().__init__(context)
        self._search = WaveSearch(self.mesh_map)

    def find_leg(self, query: LegQuery) -> Leg | None:
        """Propagate the wave until the robot's face is settled, take the shortened descent, keep the field."""
        wave = self._search.propagate(query, self.parameters.goal_dist_offset)
        if wave is None:
            return None
        positions, point_faces = self._search.path(query, wave, pull_over_costs=False)
        normals = self.mesh_map.face_normals[point_faces]
        cost = cost_along(self.mesh_map, query.snapshot, positions, point_faces)
        note = self._search.edges_text(query, wave, positions, point_faces)
        return Leg(positions, normals, cost, self._search.field(query, wave), note)
