"""One continuous wave from a goal, and the exact descent of its field: shared by planners over faces."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np

from mbf_abstract.geometry.arithmetic import norm
from mbf_mesh_nav.arrays import BoolArray, FlagArray, Float32Array, FloatArray, IntArray
from mbf_mesh_nav.kernels.mesh.corners import build_corner_ends, write_corner_weights
from mbf_mesh_nav.kernels.wave.cvp import ALONG_EDGE, propagate_wave
from mbf_mesh_nav.kernels.wave.descent import Field, trace_descent
from mbf_mesh_nav.kernels.wave.directions import wave_directions
from mbf_mesh_nav.kernels.wave.fronts import NO_BEND
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.map.snapshot import MeshSnapshot
from mbf_mesh_nav.mesh.locate import SurfacePoint
from mbf_mesh_nav.motion.vector_field import VectorField
from mbf_mesh_nav.search.corridor import Corridor, Piece
from mbf_mesh_nav.search.leg_search import LegQuery, seeded_arrays
from mbf_mesh_nav.search.other_courses import OtherCourses, is_worth_a_search, reversed_query

NEVER = np.zeros(1, dtype=np.uint8)
"""The flag of what is not cancelled."""
STEP_SAMPLE = 64
"""The typical weight of an edge is the mean of one in so many."""
COURSE_LOST = 0.005
"""A path so much costlier than its field, as a share, is looked for once more. Fields are right to 0.3 %."""
AS_PREDICTED = 5e-4
"""A path that differs by no more from the distance of its field, as a share, is the one along which the wave came."""


@dataclass(frozen=True, eq=False)
class Wave:
    """A wave that reached the start of its query.

    Attributes
    ----------
    distances : (V,) float32
        Weighted distance [m] to the goal, inf where the wave did not come.
    predecessors, cut_records, bends : (V,) int32
        See ``kernels.wave.cvp.propagate_wave``.
    along_edges : bool
        Whether no path over free faces leads to the start, so that the wave also walked along edges.
    """

    distances: Float32Array
    predecessors: IntArray
    cut_records: IntArray
    bends: IntArray
    along_edges: bool


class _Weights(NamedTuple):
    """Weights of corner records at one version of the map, what is obtuse, and the typical weight [m] of an edge."""

    version: int
    of_corners: Float32Array
    obtuse_around: BoolArray
    step: float


class WaveSearch:
    """Waves over one mesh; keeps the corner records of the mesh and their weights. Several threads may use it."""

    def __init__(self, mesh_map: MeshMap) -> None:
        self._mesh_map = mesh_map
        self._corner_ends = build_corner_ends(mesh_map.faces, mesh_map.vertex_face_offsets, mesh_map.vertex_faces)
        self._weights: _Weights | None = self._gathered(mesh_map.snapshot(), NEVER)

    @property
    def nbytes(self) -> int:
        """Bytes of the corner records and their weights."""
        return self._corner_ends.nbytes + (self._weights.of_corners.nbytes if self._weights is not None else 0)

    def propagate(self, query: LegQuery, overshoot: float) -> Wave | None:
        """Propagate a wave from the goal until it is ``overshoot`` [m] past the start; None: not reached, or cancelled.

        Where no path over free faces leads to the start, the wave also walks along single edges of free vertices.
        """
        corners = self._mesh_map.faces[query.start.face]
        targets = np.ascontiguousarray(corners[~query.blocked[corners]])
        at_least = max(overshoot, 2.0 * self._mesh_map.topology.mean_edge_length)
        for along_edges in (False, True):
            wave = self._propagated(query, targets, at_least, along_edges)
            if wave is None or np.isfinite(wave.distances[corners]).any():
                return wave
        return None

    def edges_text(self, query: LegQuery, wave: Wave, positions: FloatArray, point_faces: IntArray) -> str:
        """Note that a path follows edges where no whole face is free, with the length; empty if it does not."""
        if not wave.along_edges:
            return ""
        between_ends = (point_faces[1:] != query.start.face) & (point_faces[1:] != query.goal.face)
        blocked = query.blocked[self._mesh_map.faces[point_faces[1:]]].any(axis=1) & between_ends
        length = math.fsum(math.dist(positions[index], positions[index + 1]) for index in np.flatnonzero(blocked))
        return f"no path over whole free faces: {length:.2f} m lead along edges between blocked faces"

    def path(self, query: LegQuery, wave: Wave, pull_over_costs: bool) -> tuple[FloatArray, IntArray]:
        """Positions (n, 3) from start to goal, and the face (n,) the segment to each of them lies in.

        The descent of the field, shortened to a geodesic. Where that is longer than the field's distance, it has lost
        its course between two fronts: then the chain of predecessors is shortened, too, and the shorter one taken.
        Where it leads through few large faces, other courses are looked for. Over costs the cheapest path is no
        geodesic: there the descent of the field stays, or is shortened as far as that costs no more
        (``pull_over_costs``).
        """
        start, goal = query.start, query.goal
        if start.face == goal.face:
            return np.array([start.point, goal.point]), np.array([start.face, goal.face], dtype=np.int32)
        corridor = Corridor(self._mesh_map, query.snapshot, query.blocked)
        traced = self._trace(query, wave, along_edges=False)
        if corridor.has_costs(traced[1]):
            return corridor.shorten(*traced) if pull_over_costs else traced
        best = corridor.shorten(*traced)
        predicted = min(
            float(wave.distances[corner]) + math.dist(self._mesh_map.vertices[corner], start.point)
            for corner in self._mesh_map.faces[start.face].tolist()
        )
        if corridor.cost(*best) > (1.0 + COURSE_LOST) * predicted:
            other = corridor.shorten(*self._trace(query, wave, along_edges=True))
            best = min(best, other, key=lambda path: corridor.cost(*path))
        if wave.along_edges or abs(corridor.cost(*best) - predicted) <= AS_PREDICTED * predicted:
            return best
        return self._other_course(query, wave, corridor, best)

    def _other_course(self, query: LegQuery, wave: Wave, corridor: Corridor, best: Piece) -> Piece:
        """A shorter path than the best so far through few large faces, see ``other_courses``; else that one."""
        if not is_worth_a_search(query, best, corridor):
            return best
        back = reversed_query(query)
        wave_back = self.propagate(back, overshoot=0.0)
        if wave_back is None or wave_back.along_edges:
            return best
        to_goal, to_start = partial(self._trace_from, query, wave), partial(self._trace_from, back, wave_back)
        courses = OtherCourses(self._mesh_map, query, corridor, to_goal, to_start)
        return courses.best(best, wave.distances, wave_back.distances)

    def _trace_from(self, query: LegQuery, wave: Wave, place: SurfacePoint) -> Piece:
        """Descent of the field from any place the wave reached."""
        if place.face == query.goal.face:
            return np.array([place.point, query.goal.point]), np.array([place.face] * 2, dtype=np.int32)
        return self._trace(replace(query, start=place), wave, along_edges=False)

    def _trace(self, query: LegQuery, wave: Wave, along_edges: bool) -> tuple[FloatArray, IntArray]:
        """Descent of the field, see ``kernels.wave.descent``."""
        start, goal = query.start, query.goal
        return trace_descent(
            self._mesh_map.topology.surface,
            Field(query.snapshot.edge_weights, wave.distances, wave.predecessors, wave.bends),
            start.face,
            tuple(start.point.tolist()),
            goal.face,
            tuple(goal.point.tolist()),
            along_edges,
        )

    def field(self, query: LegQuery, wave: Wave) -> VectorField | None:
        """Directions towards the goal wherever the wave came; None if cancelled."""
        mesh_map, goal = self._mesh_map, query.goal
        weights = self._take_weights(query)
        if weights is None:
            return None
        directions = wave_directions(
            mesh_map.vertices,
            mesh_map.faces,
            mesh_map.vertex_faces,
            self._corner_ends,
            weights.of_corners,
            wave.distances,
            wave.predecessors,
            wave.cut_records,
            wave.bends,
        )
        self._weights = weights
        corners = mesh_map.faces[goal.face]
        towards_goal = goal.point - mesh_map.vertices[corners]
        directions[corners] = towards_goal / np.maximum(norm(towards_goal)[..., None], 1e-9)
        return VectorField(directions, wave.distances, goal.face, goal.point.copy(), mesh_map.topology)

    def _propagated(self, query: LegQuery, targets: IntArray, overshoot: float, along_edges: bool) -> Wave | None:
        """Run the kernel from the goal of a query; None if cancelled."""
        mesh_map, weights = self._mesh_map, self._take_weights(query)
        if weights is None:
            return None
        distances, predecessors, seeds = seeded_arrays(mesh_map, query.blocked, query.goal, query.snapshot)
        cut_records = np.full(len(distances), ALONG_EDGE, dtype=np.int32)
        bends = np.full(len(distances), NO_BEND, dtype=np.int32)
        records = self._corner_ends.reshape(-1), weights.of_corners.reshape(-1), weights.obtuse_around
        settled = propagate_wave(
            mesh_map.vertex_face_offsets, *records, query.blocked, distances, predecessors, cut_records, bends,
            seeds, targets, overshoot, weights.step, query.cancel_flag, along_edges,
        )  # fmt: skip
        self._weights = weights
        return None if settled < 0 else Wave(distances, predecessors, cut_records, bends, along_edges)

    def _take_weights(self, query: LegQuery) -> _Weights | None:
        """Take the weights, brought up to date for a query; give them back after use. None if cancelled meanwhile.

        Another thread that comes in between finds none and gathers its own.
        """
        weights, self._weights = self._weights, None
        if weights is None:
            return self._gathered(query.snapshot, query.cancel_flag)
        if weights.version == query.snapshot.version:
            return weights
        changed = self._mesh_map.changes_between(weights.version, query.snapshot.version)
        if changed is None:
            return self._gathered(query.snapshot, query.cancel_flag)
        return self._written(query.snapshot, changed, weights, query.cancel_flag)

    def _gathered(self, snapshot: MeshSnapshot, cancel_flag: FlagArray) -> _Weights | None:
        everything = np.arange(len(snapshot.costs), dtype=np.int32)
        of_corners = np.empty((len(self._corner_ends), 3), dtype=np.float32)
        weights = _Weights(-1, of_corners, np.empty(len(everything), dtype=np.bool_), 0.0)
        return self._written(snapshot, everything, weights, cancel_flag)

    def _written(
        self, snapshot: MeshSnapshot, changed: IntArray, weights: _Weights, cancel_flag: FlagArray
    ) -> _Weights | None:
        """Bring weights up to date at the changed vertices, in place."""
        mesh_map = self._mesh_map
        finished = write_corner_weights(
            mesh_map.vertex_face_offsets,
            self._corner_ends,
            mesh_map.neighbour_offsets,
            mesh_map.neighbours,
            snapshot.edge_weights,
            changed,
            weights.of_corners,
            weights.obtuse_around,
            cancel_flag,
        )
        sample = snapshot.edge_weights[::STEP_SAMPLE]
        sample = sample[np.isfinite(sample)]
        step = float(sample.mean()) if len(sample) else mesh_map.topology.mean_edge_length
        return weights._replace(version=snapshot.version, step=step) if finished else None
