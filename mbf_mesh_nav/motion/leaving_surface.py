"""What a manoeuvre out of forbidden surface may cross, and how far it is to where the robot may stand.

When to use: in ``mesh.escape`` for a robot that cannot turn on the spot, or must not on a steep slope. When not:
others; they turn to the path over the vertices, which is shorter and found faster.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.arithmetic import norm
from mbf_abstract.geometry.transform import Transform
from mbf_abstract.maps.manoeuvres import LEAST_LEFT
from mbf_abstract.maps.queries import PlanarPose
from mbf_mesh_nav.arrays import BoolArray, FloatArray
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.mesh.motion_check import SURFACE_DISTANCE
from mbf_mesh_nav.mesh.surface_point import nearest_corner


class LeavingSurface:
    """Leaving one pose, on the map of the moment; poses of its methods are as seen from there.

    Parameters
    ----------
    mesh_map : MeshMap
    begin : Pose
        Of the robot, in the frame of the map.
    reached : (V,) bool
        Vertices that the robot may cross and get to.
    safe : (V,) bool
        Those of them at which it may stand.
    """

    def __init__(self, mesh_map: MeshMap, begin: Pose, reached: BoolArray, safe: BoolArray) -> None:
        self._mesh_map, self._reached, self._safe = mesh_map, reached, safe
        self._frame = Transform(begin.position, begin.orientation, begin.frame_id, "begin")

    def may_pass(self, pose: PlanarPose) -> bool:
        """Whether the surface at a pose may be crossed."""
        vertex = self._vertex(pose)
        return vertex >= 0 and bool(self._reached[vertex])

    def left(self, pose: PlanarPose) -> float:
        """Distance [m] to where it may stand, at least; 0 there, inf without such a place."""
        vertex = self._vertex(pose)
        if vertex >= 0 and self._safe[vertex]:
            return 0.0
        there = np.asarray(self.on_map(pose).position)
        nearest = float(norm(self._places - there).min()) if len(self._places) else np.inf
        return max(nearest - self._mesh_map.topology.mean_edge_length, LEAST_LEFT)

    @cached_property
    def _places(self) -> FloatArray:
        return self._mesh_map.vertices[self._safe]

    def _vertex(self, pose: PlanarPose) -> int:
        """The vertex nearest to a pose; -1 off the surface."""
        place = self._mesh_map.locate_one(self.on_map(pose).position, SURFACE_DISTANCE)
        return -1 if place is None else nearest_corner(self._mesh_map, place)

    def on_map(self, pose: PlanarPose) -> Pose:
        """The pose in the frame of the map."""
        return self._frame.apply_to_pose(Pose.planar(*pose, frame_id="begin"))
