"""Continuous vector planner: a wave over faces, a path down its distance field, and the field for the controller.

Strengths: paths cross faces freely, so they are as short and smooth as the surface allows (within 0.5 % on average),
whatever the triangulation; every reachable pair gets a path; the field lets a controller correct deviations.
Known failure: passes only where whole faces are free, a chain of single free vertices does not count (``mesh.astar``
uses those); on rough meshes one vertex in 5,000 or so is 2 to 4 % off, where two fronts meet. Within a face the field
is straight, so where faces are as long as the way to the goal the path winds; ``mesh.any_angle`` pulls it taut,
densifying the map (``mesh_map.densify``) mends the field.
Cost: about 0.4 us a vertex nearer than the goal. The C++ original's rule and defaults; the path is traced exactly here.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.parameters import parameter
from mbf_mesh_nav.leg_search import Leg, LegQuery
from mbf_mesh_nav.path_cost import cost_along
from mbf_mesh_nav.plugins import MeshContext
from mbf_mesh_nav.surface_planner import SurfacePlanner, SurfacePlannerParameters
from mbf_mesh_nav.wave_search import WaveSearch


class CVPParameters(SurfacePlannerParameters):
    """Parameters of ``mesh.cvp``."""

    goal_dist_offset: float = parameter(
        0.3, "How far beyond the robot the field is computed; a controller needs it to correct.", unit="m", ge=0.0
    )


class CVPPlanner(SurfacePlanner):
    """Wave from the goal, descent from the start."""

    way = "over whole faces"

    Parameters = CVPParameters
    parameters: CVPParameters

    def __init__(self, context: MeshContext) -> None:
        super().__init__(context)
        self._search = WaveSearch(self.mesh_map)

    def reach(self, query: LegQuery) -> NDArray[np.float32] | None:
        """As for every planner; here over free faces."""
        return self._search.reach(query)

    def find_leg(self, query: LegQuery) -> Leg | None:
        """Spread the wave until the robot's face is settled, trace the path, keep the field."""
        wave = self._search.spread(query, self.parameters.goal_dist_offset)
        if wave is None:
            return None
        positions, point_faces = self._search.trace(query, wave)
        normals = self.mesh_map.face_normals[point_faces]
        cost = cost_along(self.mesh_map, query.snapshot, positions, point_faces)
        return Leg(positions, normals, cost, self._search.field(query, wave))
