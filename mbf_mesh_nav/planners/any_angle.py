"""Any-angle paths: the way down a continuous wave, pulled taut through the strip of faces it crosses.

Strengths: the shortest paths of all planners here (the traced path's small zigzags and its error near the goal are
gone), straight where the ground is, still through free faces only; where the taut line would cost more than the
traced one (costs on the map), the traced one stays. Known failure: a local optimum, the strip itself is that of the
wave; no vector field is handed on, it would not match the path. Cost: that of ``mesh.cvp`` plus about 2 us a face.
When not: on coarse meshes, with faces as long as the way around an obstacle or a ridge. There the wave may choose the
wrong side of a vertex, and the taut path stays on it; densify the map (``mesh_map.densify``) instead.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.face_strip import FaceStrip
from mbf_mesh_nav.leg_search import Leg, LegQuery
from mbf_mesh_nav.path_cost import cost_along
from mbf_mesh_nav.plugins import MeshContext
from mbf_mesh_nav.surface_planner import SurfacePlanner
from mbf_mesh_nav.wave_search import WaveSearch


class AnyAnglePlanner(SurfacePlanner):
    """Wave from the goal, descent from the start, shortened by a funnel."""

    way = "over whole faces"

    def __init__(self, context: MeshContext) -> None:
        super().__init__(context)
        self._search = WaveSearch(self.mesh_map)

    def reach(self, query: LegQuery) -> NDArray[np.float32] | None:
        """As for every planner; here over free faces."""
        return self._search.reach(query)

    def find_leg(self, query: LegQuery) -> Leg | None:
        """Trace the wave's path and pull it taut."""
        wave = self._search.spread(query, overshoot=0.0)
        if wave is None:
            return None
        strip = FaceStrip(self.mesh_map, query.snapshot, query.blocked)
        positions, point_faces = strip.shorten(*self._search.trace(query, wave))
        normals = self.mesh_map.face_normals[point_faces]
        return Leg(positions, normals, cost_along(self.mesh_map, query.snapshot, positions, point_faces))
