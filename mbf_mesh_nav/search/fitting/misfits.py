"""Where an outline does not fit along a leg, with the headings that a follower has there."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mbf_abstract.geometry.arithmetic import norm
from mbf_abstract.geometry.polyline import polyline_lengths
from mbf_abstract.maps.controllers.failures import obstacle_text
from mbf_abstract.maps.controllers.room_to_turn import ARM
from mbf_mesh_nav.arrays import BoolArray, FloatArray, IntArray
from mbf_mesh_nav.kernels.mesh.surface_disc import vertices_in_disc
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.map.outline_on_ground import OutlineOnGround
from mbf_mesh_nav.mesh.locate import Location
from mbf_mesh_nav.mesh.positions import position_text
from mbf_mesh_nav.mesh.surface_point import nearest_corners
from mbf_mesh_nav.search.leg_search import Leg, LegQuery, points_at

SPACING = 0.025
"""Length [m] between the poses of a path that are looked at."""
CHORD = 2.0 * ARM
"""Length [m] of the chord that stands for the robot's heading in its middle, as in controllers that keep to a path."""


class Misfits(NamedTuple):
    """Where an outline touches something on a leg.

    Attributes
    ----------
    spots : Location
        Of the robot's origin, n of them.
    ahead : (n, 3) float64
        Where it looks.
    touched, below : (n,) int32
        The vertices that it touches there, and those below the origin.
    lengths : (n,) float64
        Along the leg [m].
    length : float
        Of the leg [m].
    """

    spots: Location
    ahead: FloatArray
    touched: IntArray
    below: IntArray
    lengths: FloatArray
    length: float

    def near_start(self, reach: float) -> BoolArray:
        """Which of them are within ``reach`` [m] of the leg's begin."""
        return self.lengths <= reach

    def near_goal(self, reach: float) -> BoolArray:
        """Which of them are within ``reach`` [m] of the leg's end."""
        return self.lengths >= self.length - reach

    def text(self, mesh_map: MeshMap, chosen: BoolArray) -> str:
        """What the first of some of them touches; empty without one."""
        if not chosen.any():
            return ""
        return obstacle_text(position_text(mesh_map.vertices[self.touched[np.argmax(chosen)]]))


def misfits_of(mesh_map: MeshMap, query: LegQuery, outline: OutlineOnGround, leg: Leg) -> Misfits:
    """Where the outline touches something on a leg; not where it does from its start on, which it leaves."""
    leaves = query.start_pose is not None and outline.touches(query.start, query.start_pose)
    return misfits_along(mesh_map, outline, leg.positions, leaves_contact=leaves)


def misfits_along(
    mesh_map: MeshMap, outline: OutlineOnGround, positions: FloatArray, *, leaves_contact: bool = False
) -> Misfits:
    """The same along a line through positions (n, 3) [m] on the surface."""
    lengths = polyline_lengths(positions)
    count = max(int(np.ceil(lengths[-1] / SPACING)), 1)
    at = np.linspace(0.0, lengths[-1], count + 1)
    spots = mesh_map.locate(points_at(positions, lengths, at))
    chords = points_at(positions, lengths, at + 0.5 * CHORD) - points_at(positions, lengths, at - 0.5 * CHORD)
    upright = norm(chords[:, :2]) == 0.0
    chords[upright] = (1.0, 0.0, 0.0)
    vertices = outline.touched(spots, chords)
    touches = (vertices >= 0) & ~upright
    if leaves_contact:
        touches &= ~np.logical_and.accumulate(touches)
    below = nearest_corners(mesh_map, spots)
    chosen = chosen_of(spots, touches)
    return Misfits(chosen, chords[touches], vertices[touches], below[touches], at[touches], float(lengths[-1]))


def new_misfits(mesh_map: MeshMap, outline: OutlineOnGround, changed: FloatArray, given: FloatArray) -> IntArray:
    """Faces (k,) on which a changed line does not fit the outline, far from where the given one does not either."""
    after, before = misfits_along(mesh_map, outline, changed), misfits_along(mesh_map, outline, given)
    places = before.spots.points
    far = [not (norm(places - place) <= outline.reach).any() for place in after.spots.points]
    return np.unique(after.spots.faces[np.array(far, dtype=np.bool_)])


def chosen_of(spots: Location, chosen: BoolArray) -> Location:
    """Some of many places."""
    return Location(spots.faces[chosen], spots.barycentric[chosen], spots.points[chosen], spots.distances[chosen])


def nearer_to_what_is_touched(mesh_map: MeshMap, misfits: Misfits, reach: float) -> IntArray:
    """Vertices (k,) that are nearer to what was touched than the robot's origin was then, by an edge."""
    mesh = mesh_map.topology
    graph, step = (mesh.vertices, mesh.neighbour_offsets, mesh.neighbours), mesh.mean_edge_length
    found = [misfits.below]
    for vertex in np.unique(misfits.touched).tolist():
        place = mesh.vertices[vertex]
        nearest = float(norm(misfits.spots.points[misfits.touched == vertex] - place).min())
        found.append(vertices_in_disc(*graph, vertex, place, min(nearest + step, reach)))
    return np.unique(np.concatenate(found))
