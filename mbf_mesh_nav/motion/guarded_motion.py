"""Moving the robot inside a recovery on a mesh, and a look at the surface ahead.

Each behaviour looks at the surface in its own manner: along a track, below the wheels, along an escape path.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.maps import guarded_motion
from mbf_mesh_nav.kernels.mesh.surface_walk import tangent, walk
from mbf_mesh_nav.kernels.search.forbidden_surface import hardness_at, may_enter
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.mesh.locate import SurfacePoint
from mbf_mesh_nav.plugins import MeshRecovery


class GuardedRecovery(MeshRecovery, guarded_motion.GuardedRecovery):
    """Base of the recoveries that move the robot: write ``recover`` and use ``drive``."""

    def stale_reason(self) -> str:
        """Why the mesh map is too old to drive on; empty if it is fresh."""
        return self.mesh_map.stale_reason(self.clock.now())


def free_distance(
    mesh_map: MeshMap,
    hardness: NDArray[np.float32],
    spot: SurfacePoint,
    direction: NDArray[np.float64],
    distance: float,
    stride: float = 0.05,
) -> float:
    """How far [m], up to ``distance``, the ground is free straight ahead of a surface point.

    Borders end it, and forbidden ground, ``hardness`` (V,); where the robot stands on such ground itself it may leave
    it, see ``kernels.forbidden_ground``.
    """
    face = spot.face
    x, y, z = spot.point
    normal = mesh_map.face_normals[face]
    point = (float(x), float(y), float(z))
    way = tangent((float(direction[0]), float(direction[1]), float(direction[2])), tuple(normal.tolist()))
    stands_on = hardness_at(mesh_map.vertices, mesh_map.faces, hardness, face, point)
    travelled = 0.0
    while travelled < distance:
        face, point, way, walked = walk(
            mesh_map.vertices,
            mesh_map.faces,
            mesh_map.face_neighbours,
            mesh_map.face_normals,
            face,
            point,
            way,
            min(stride, distance - travelled),
        )
        comes_to = hardness_at(mesh_map.vertices, mesh_map.faces, hardness, face, point)
        if not may_enter(stands_on, comes_to):
            break
        stands_on = comes_to
        travelled += walked
        if walked < 1e-6:
            break
    return travelled
