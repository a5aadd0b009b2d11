"""What a robot on a mesh would touch along a motion, and where the nearest obstacle lies.

The robot's centre is walked over the surface along the arc of its command, and on by its radius in the direction it
then has. Forbidden surface ends the motion, and so does a border; a robot that stands on forbidden
surface may leave it, see ``kernels.search.forbidden_surface``, and one in a contact gets no deeper, see ``contact``.
A robot that follows a path is asked for less, see
``forbidden_ahead``. What its sides would touch is in the costs: on a map
that is not inflated only what lies straight ahead counts. What turns on the spot is checked in ``turning``, too.
"""

from __future__ import annotations

import numpy as np

from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.geometry.arithmetic import norm
from mbf_abstract.maps.controllers.failures import obstacle_text
from mbf_mesh_nav.arrays import BoolArray, Float32Array, FloatArray
from mbf_mesh_nav.kernels.mesh.surface_disc import vertices_in_disc
from mbf_mesh_nav.kernels.mesh.surface_walk import tangent, turned, walk
from mbf_mesh_nav.kernels.mesh.vectors import Vector
from mbf_mesh_nav.kernels.search.forbidden_surface import LETHAL_RANK, may_enter, rank_at
from mbf_mesh_nav.mesh.borders import on_surface
from mbf_mesh_nav.mesh.contact import Contact
from mbf_mesh_nav.mesh.locate import SurfaceLocator, SurfacePoint
from mbf_mesh_nav.mesh.positions import position_text, vector_of
from mbf_mesh_nav.mesh.topology import MeshTopology

SURFACE_DISTANCE = 1.0
"""How far [m] a robot's frame may be off the surface it stands on."""
UNKNOWN_RADIUS = 0.3
"""Radius [m] of a robot whose inscribed radius the map does not know."""
STRIDE, TURN = 0.05, 0.5
"""Length [m] of the steps of a walk, and how far [rad] an arc turns over one of them at most."""


def forbidden_ahead(
    mesh: MeshTopology,
    ranks: Float32Array,
    place: SurfacePoint,
    pose: Pose,
    command: Twist,
    duration: float,
    radius: float,
    surface: SurfaceLocator | None = None,
) -> str:
    """Where the motion would lead onto forbidden surface or past a border, as a text; empty if it is free.

    Parameters
    ----------
    ranks : (V,) float32
        How forbidden the vertices are, see ``MeshSnapshot.traversability_rank``.
    place : SurfacePoint
        Where the robot stands, at ``pose``.
    command : Twist
        Kept for ``duration`` [s].
    radius : float
        How far [m] the robot reaches beyond its centre.
    surface : SurfaceLocator, optional
        Of a robot that follows a path. Only its centre may not leave the surface, nor come onto what costs too much, as
        planners ask for no more; beyond its centre it may touch all but a lethal vertex, as in ``check_pose``.
    """
    face, point = place.face, vector_of(place.point)
    stands_on = rank_at(mesh.vertices, mesh.faces, ranks, face, point)
    contact = Contact.at(mesh, ranks, place, radius, command.speed * duration)
    if command.speed == 0.0:
        blocked = command.wz != 0.0 and stands_on >= LETHAL_RANK
        return f"the robot stands on an obstacle at {position_text(point)}" if blocked else ""
    ahead = pose.rotation[:, 0] * command.vx + pose.rotation[:, 1] * command.vy
    direction = tangent(vector_of(ahead), vector_of(mesh.face_normals[face]))
    on_arc, total, walked = command.speed * duration, command.speed * duration + radius, 0.0
    curvature = command.wz / command.speed
    on_curve = min(STRIDE, TURN / abs(curvature)) if curvature != 0.0 else STRIDE
    centre = np.array(point)
    while walked < total:
        is_on_arc = walked < on_arc
        stride = min(on_curve, on_arc - walked) if is_on_arc else min(STRIDE, total - walked)
        half_turn = 0.5 * stride * curvature if is_on_arc else 0.0
        direction = turned(direction, vector_of(mesh.face_normals[face]), half_turn)
        face, point, direction, done = walk(
            mesh.vertices, mesh.faces, mesh.face_neighbours, mesh.face_normals, face, point, direction, stride
        )
        ends = done < stride - 1e-6
        if ends and surface is None:
            return f"the surface ends at {position_text(point)}"
        comes_to = rank_at(mesh.vertices, mesh.faces, ranks, face, point)
        centre = np.array(point) if is_on_arc else centre
        if contact is None:
            is_ahead = surface is not None and not is_on_arc
            reaches_over = is_ahead and not _touches_lethal(mesh, ranks, face, point, centre, radius)
            may_come = may_enter(stands_on, comes_to) or reaches_over
        else:  # it knows what is touched on all sides
            may_come = not is_on_arc or (comes_to < LETHAL_RANK and contact.allows(face, point, comes_to))
        if not may_come:
            return obstacle_text(position_text(point))
        if ends and surface is not None:
            past = on_arc - walked - done
            return _past_border(mesh, surface, face, point, direction, past, curvature)
        stands_on, walked = comes_to, walked + stride
        direction = turned(direction, vector_of(mesh.face_normals[face]), half_turn)
    return ""


def _touches_lethal(
    mesh: MeshTopology, ranks: Float32Array, face: int, point: Vector, centre: FloatArray, radius: float
) -> bool:
    """Whether the corner of a face that is nearest to a point in it is lethal, and within the robot's disc."""
    corners = mesh.faces[face]
    nearest = corners[int(np.argmin(norm(mesh.vertices[corners] - np.array(point))))]
    distance = float(norm(mesh.vertices[nearest] - centre))
    return bool(ranks[nearest] >= LETHAL_RANK) and distance <= radius


def _past_border(
    mesh: MeshTopology,
    locator: SurfaceLocator,
    face: int,
    point: Vector,
    direction: Vector,
    distance: float,
    curvature: float,
) -> str:
    """Where a motion that comes to a border at ``point`` leads farther past it than is slack, as a text.

    It goes on from there for ``distance`` [m] in the plane of the last face, which is how a path is followed that runs
    along the border.
    """
    place, normal, left = np.array(point), vector_of(mesh.face_normals[face]), distance
    while left > 0.0:
        stride = min(STRIDE, left)
        place, left = place + stride * np.array(direction), left - stride
        if on_surface(mesh, locator, place, SURFACE_DISTANCE) is None:
            return f"the surface ends at {position_text(point)}"
        direction = turned(direction, normal, stride * curvature)
    return ""


def nearest_of(
    mesh: MeshTopology, place: SurfacePoint, pose: Pose, within: float, forbidden: BoolArray
) -> tuple[float, float, float] | None:
    """Offset [m] from a pose to the nearest ``forbidden`` (V,) vertex of its storey; None if none is ``within`` [m]."""
    graph = (mesh.vertices, mesh.neighbour_offsets, mesh.neighbours)
    start = int(mesh.faces[place.face, np.argmax(place.barycentric)])
    near = vertices_in_disc(*graph, start, place.point, float(within))
    near = near[forbidden[near]]
    if len(near) == 0:
        return None
    offsets = mesh.vertices[near] - np.asarray(pose.position)
    distances = norm(offsets)
    nearest = int(np.argmin(distances))
    x, y, z = offsets[nearest].tolist()
    return (x, y, z) if distances[nearest] <= within else None
