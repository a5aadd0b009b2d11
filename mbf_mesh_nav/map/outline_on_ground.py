"""Where a robot's outline, not only its disc, fits on the ground of a mesh.

When to use: for a robot that is longer than wide among walls, shelves and trees; ``check_footprint: true`` of the map
has plans, motions and questions look at its outline. When not: on open ground whose lethal part is too steep rather
than solid. There a corner may well stand over it, and the wheels are what counts (the ``tilt`` layer).

The outline lies in the plane of the face below the robot's origin. It touches a lethal vertex that is connected to
that face and lies under it, as the disc of ``places`` does. What lies past a border counts as free, as for paths.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import Pose, Twist, rotation_matrix
from mbf_abstract.geometry.arithmetic import norm, plane_rotation, rotated, scalar_products
from mbf_abstract.geometry.transform import Transform
from mbf_abstract.maps.controllers.failures import obstacle_text
from mbf_abstract.maps.queries import CellState, Fit, PlaceAnswer, PlaceCheck, PlaneCheck, in_plane
from mbf_mesh_nav.arrays import BoolArray, FloatArray, IntArray
from mbf_mesh_nav.kernels.mesh.surface_disc import vertices_in_disc
from mbf_mesh_nav.kernels.mesh.surface_walk import tangent, turned
from mbf_mesh_nav.kernels.motion.outline_contact import swept_place, vertex_under_outlines
from mbf_mesh_nav.map.places import SURFACE_DISTANCE
from mbf_mesh_nav.map.snapshot import MeshSnapshot
from mbf_mesh_nav.mesh.locate import Location, SurfaceLocator, SurfacePoint
from mbf_mesh_nav.mesh.positions import position_text, vector_of
from mbf_mesh_nav.mesh.topology import MeshTopology

FitCheck = Callable[[FloatArray], NDArray[np.int8]]
"""The ``Fit`` (n,) at positions (n, 3) [m]."""

STEP = 0.05
"""How far [m] the outline moves between two looks, at most."""


class OutlineOnGround:
    """An outline on one state of the map.

    Parameters
    ----------
    corners : (n, 2) float
        Of the outline [m], x forward, y left.

    Attributes
    ----------
    reach : float
        How far [m] it reaches from the robot's origin.
    """

    def __init__(self, topology: MeshTopology, snapshot: MeshSnapshot, corners: FloatArray) -> None:
        self._mesh, self._corners = topology, corners
        self._lethal: BoolArray = snapshot.lethal | ~np.isfinite(snapshot.costs)
        self.reach = float(norm(self._corners).max())

    def touched(self, spots: Location, ahead: FloatArray) -> IntArray:
        """The lethal vertex (n,) that it touches at places on the surface, with headings (n, 3); -1 where none.

        A heading is any vector that is not upright.
        """
        mesh = self._mesh
        normals = mesh.face_normals[spots.faces]
        courses = ahead - scalar_products(ahead, normals)[:, None] * normals
        courses /= norm(courses)[:, None]
        starts: IntArray = mesh.faces[spots.faces, np.argmax(spots.barycentric, axis=1)]
        graph = mesh.surface, mesh.neighbour_offsets, mesh.neighbours
        robot = self._corners, self.reach
        found = vertex_under_outlines(*graph, self._lethal, spots.faces, starts, spots.points, courses, *robot)
        return np.asarray(found)

    def touches(self, spot: SurfacePoint, pose: Pose) -> bool:
        """Whether it touches something at a pose, whose place on the surface is ``spot``."""
        face = np.array([spot.face], dtype=np.int32)
        here = Location(face, spot.barycentric[None], spot.point[None], np.array([spot.distance]))
        return bool(self.touched(here, pose.rotation[None, :, 0])[0] >= 0)

    def pose_check(self, check: PlaceCheck, locator: SurfaceLocator) -> PlaceCheck:
        """A check of places that says LETHAL, too, where the outline touches something."""

        def fits(pose: Pose) -> PlaceAnswer:
            answer, spot = check(pose), locator.locate_one(pose.position, SURFACE_DISTANCE)
            if answer.state >= CellState.LETHAL or spot is None or not self.touches(spot, pose):
                return answer
            return replace(answer, state=CellState.LETHAL)

        return fits

    def fit_check(self, fit: FitCheck, frame: Transform, locator: SurfaceLocator) -> PlaneCheck:
        """A check of positions as one of poses in the plane of a frame that says TOUCHES where the outline does."""
        rotation = rotation_matrix(frame.rotation)

        def fits(poses: FloatArray) -> NDArray[np.int8]:
            positions = in_plane(frame, poses)
            found = fit(positions)
            free = np.flatnonzero(found != Fit.TOUCHES)
            headings = [(math.cos(yaw), math.sin(yaw), 0.0) for yaw in poses[free, 2].tolist()]
            spots = locator.locate(positions[free], SURFACE_DISTANCE)
            found[free[self.touched(spots, rotated(rotation, np.array(headings).reshape(-1, 3))) >= 0]] = Fit.TOUCHES
            return found

        return fits

    def swept(self, spot: SurfacePoint, pose: Pose, command: Twist, duration: float) -> str:
        """Where a motion from ``pose``, at ``spot``, touches more than the robot does now, as a text; "" if nowhere."""
        mesh, seconds = self._mesh, duration
        if command.wz != 0.0:
            seconds = min(duration, 2.0 * math.pi / abs(command.wz))
        steps = math.ceil(max(abs(command.wz) * self.reach, command.speed) * seconds / STEP)
        start = int(mesh.faces[spot.face, np.argmax(spot.barycentric)])
        graph, within = (mesh.vertices, mesh.neighbour_offsets, mesh.neighbours), self.reach + command.speed * seconds
        near = vertices_in_disc(*graph, start, spot.point, float(within))
        near = near[self._lethal[near]]
        if steps == 0 or not len(near):
            return ""
        course = math.atan2(command.vy, command.vx) if command.speed > 0.0 else 0.0
        normal = vector_of(mesh.face_normals[spot.face])
        ahead = turned(tangent(vector_of(pose.rotation[:, 0]), normal), normal, course)
        corners = rotated(plane_rotation(-course), self._corners)
        motion = ahead, corners, command.speed * seconds / steps, command.wz * seconds / steps, steps
        index = swept_place(mesh.surface, mesh.vertices[near], spot.face, vector_of(spot.point), *motion)
        return obstacle_text(position_text(mesh.vertices[near[index]])) if index >= 0 else ""
