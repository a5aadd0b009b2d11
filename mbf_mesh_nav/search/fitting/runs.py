"""Runs at the ends of a leg, straight or on an arc, and straight through a passage: pieces that fit as they are."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from mbf_abstract.geometry import Pose, quaternion_from_yaw, quaternion_multiply
from mbf_abstract.geometry.arcs import arc_poses
from mbf_abstract.geometry.arithmetic import rotated
from mbf_mesh_nav.arrays import BoolArray, FloatArray
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.map.outline_on_ground import OutlineOnGround
from mbf_mesh_nav.mesh.locate import Location, SurfacePoint
from mbf_mesh_nav.mesh.surface_point import nearest_corners
from mbf_mesh_nav.search.fitting.misfits import CHORD, SPACING, Misfits
from mbf_mesh_nav.search.leg_search import Leg, LegQuery
from mbf_mesh_nav.search.path_cost import cost_along

LENGTHS = (0.3, 0.6, 0.9)
"""Of the runs [m] that are tried at the ends."""
CURVATURES = (0.0, 0.6, -0.6, 1.2, -1.2)
"""Of these runs [1/m]."""
HEADINGS = 24
"""So many are tried in a passage."""
TURNS = np.remainder(np.arange(HEADINGS) / HEADINGS + 0.5, 1.0) * (2.0 * math.pi) - math.pi
"""Off the heading of the path [rad]."""
STEPS_A_REACH, MOST_STEPS = 4.0, 12
"""A run through a passage ends a fourth of the outline's reach after the other, three times its reach off at most."""


@dataclass(frozen=True)
class Run:
    """A piece that is driven forward, from one end to the other one, each with the heading the robot has there."""

    leg: Leg
    begin: SurfacePoint
    end: SurfacePoint
    begin_pose: Pose
    end_pose: Pose
    length: float


def run_along(
    mesh_map: MeshMap,
    query: LegQuery,
    outline: OutlineOnGround,
    pose: Pose,
    gear: float,
    length: float,
    curvature: float,
) -> Run | None:
    """The run of a length [m] that begins at a pose (gear 1) or ends there (-1); None where it does not fit."""
    local = arc_poses((0.0, 0.0, 0.0), gear, 0.0, gear * curvature, length, SPACING)
    local = np.concatenate([np.zeros((1, 3)), local])[:: int(gear)]
    offsets = np.column_stack([local[:, :2], np.zeros(len(local))])
    spots = mesh_map.locate(rotated(pose.rotation, offsets) + np.asarray(pose.position), CHORD)
    if (spots.faces < 0).any() or query.blocked[nearest_corners(mesh_map, spots)].any():
        return None
    headings = [(math.cos(yaw), math.sin(yaw), 0.0) for yaw in local[:, 2].tolist()]
    if (outline.touched(spots, rotated(pose.rotation, np.array(headings))) >= 0).any():
        return None
    cost = cost_along(mesh_map, query.snapshot, spots.points, spots.faces)
    leg = Leg(spots.points, mesh_map.face_normals[spots.faces], cost)
    ends = [SurfacePoint(int(spots.faces[k]), spots.barycentric[k], spots.points[k], 0.0) for k in (0, -1)]
    poses = [_moved(pose, spots.points[k], float(local[k, 2])) for k in (0, -1)]
    return Run(leg, ends[0], ends[1], poses[0], poses[1], length)


def _moved(pose: Pose, point: FloatArray, turn: float) -> Pose:
    x, y, z = point.tolist()
    orientation = quaternion_multiply(pose.orientation, quaternion_from_yaw(turn))
    return replace(pose, position=(x, y, z), orientation=orientation)


def runs_at(mesh_map: MeshMap, query: LegQuery, outline: OutlineOnGround, pose: Pose, gear: float) -> Iterator[Run]:
    """Runs from a pose on (gear 1), or to it (-1), along which the outline fits, the shortest first."""
    for length, curvature in itertools.product(LENGTHS, CURVATURES):
        run = run_along(mesh_map, query, outline, pose, gear, length, curvature)
        if run is not None:
            yield run


def run_through_passage(mesh_map: MeshMap, query: LegQuery, outline: OutlineOnGround, misfits: Misfits) -> Run | None:
    """The straight run through the narrowest of the places where a path does not fit, from and to where it may turn.

    Narrowest is where the outline fits with the fewest headings, but with one. Of these that next to the path's counts
    first that has room to turn before and behind.
    """
    fits = _headings_that_fit(outline, misfits.spots, misfits.ahead)
    counts = fits.sum(axis=1)
    if not counts.any():
        return None
    index = int(np.argmin(np.where(counts > 0, counts, HEADINGS + 1)))
    x, y, z = misfits.spots.points[index].tolist()
    yaw = math.atan2(misfits.ahead[index, 1], misfits.ahead[index, 0])
    for turn in sorted(TURNS[fits[index]].tolist(), key=abs):
        middle = Pose.planar(x, y, yaw + turn, z)
        before = _run_to_room(mesh_map, query, outline, middle, -1.0)
        run = None if before is None else _run_to_room(mesh_map, query, outline, middle, 1.0)
        if before is not None and run is not None:
            length = before.length + run.length
            return run_along(mesh_map, query, outline, before.begin_pose, 1.0, length, 0.0)
    return None


def _headings_that_fit(outline: OutlineOnGround, spots: Location, ahead: FloatArray) -> BoolArray:
    """With which of ``TURNS`` off the headings (n, 3) the outline fits at places, (n, ``HEADINGS``)."""
    x, y, z = ahead.T
    turned = [(math.cos(turn), math.sin(turn)) for turn in TURNS.tolist()]
    return np.column_stack(
        [outline.touched(spots, np.column_stack([c * x - s * y, s * x + c * y, z])) < 0 for c, s in turned]
    )


def _run_to_room(mesh_map: MeshMap, query: LegQuery, outline: OutlineOnGround, middle: Pose, gear: float) -> Run | None:
    """The shortest straight run from a pose on (gear 1), or to it (-1), whose other end has room to turn; or None."""
    for length in np.arange(1, MOST_STEPS + 1) * (outline.reach / STEPS_A_REACH):
        run = run_along(mesh_map, query, outline, middle, gear, float(length), 0.0)
        if run is None:
            return None
        end = -1 if gear > 0.0 else 0
        place = mesh_map.locate(run.leg.positions[[end]])
        if _headings_that_fit(outline, place, middle.rotation[None, :, 0]).all():
            # A path that is joined there has its chords' headings as far as half a chord before.
            return run_along(mesh_map, query, outline, middle, gear, float(length) + 0.5 * CHORD, 0.0) or run
    return None
