"""The vector field of a plan: a direction towards the goal everywhere, handed on to controllers with the path.

It belongs to one plan and is never changed, so a controller that drives by it cannot be disturbed by a planner that
works on the next plan.
"""

from __future__ import annotations

from dataclasses import dataclass

from mbf_abstract.geometry.arithmetic import norm, rotated_back
from mbf_mesh_nav.arrays import Float32Array, FloatArray
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.mesh.locate import SurfacePoint
from mbf_mesh_nav.mesh.topology import MeshTopology


@dataclass(frozen=True, eq=False)
class VectorField:
    """Directions towards one goal. ``Path.guidance`` holds a tuple of these, one per leg, in order.

    Attributes
    ----------
    directions : (V, 3) float32
        Unit vectors in the surface, in the map's internal numbering; zero where the goal cannot be reached from.
    distances : (V,) float32
        Weighted distance [m] to the goal, inf where it cannot be reached from.
    goal : (3,) float64
        Where the field leads to [m].
    topology : MeshTopology
        The mesh it belongs to; on another one its vectors are invalid.
    """

    directions: Float32Array
    distances: Float32Array
    goal_face: int
    goal: FloatArray
    topology: MeshTopology

    def __post_init__(self) -> None:
        for array in (self.directions, self.distances, self.goal):
            array.flags.writeable = False

    def direction_at(self, mesh_map: MeshMap, point: SurfacePoint) -> FloatArray | None:
        """Return the unit vector (3,) at a surface point, None where the field does not lead anywhere.

        Corners the wave did not reach do not count; in the goal's face the direction is the straight line to the goal.
        """
        if point.face == self.goal_face:
            direction = self.goal - point.point
        else:
            direction = rotated_back(self.directions[mesh_map.faces[point.face]], point.barycentric)
        length = float(norm(direction))
        return direction / length if length > 1e-9 else None
