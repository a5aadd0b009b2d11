"""One continuous wave from a goal, and the exact way down its field: what planners over faces share."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.arithmetic import norm
from mbf_mesh_nav.kernels.corners import build_corner_ends, write_corner_weights
from mbf_mesh_nav.kernels.cvp import ALONG_EDGE, propagate_wave
from mbf_mesh_nav.kernels.descent import trace_descent
from mbf_mesh_nav.kernels.fronts import NO_BEND
from mbf_mesh_nav.kernels.wave_directions import wave_directions
from mbf_mesh_nav.leg_search import LegQuery, seeded_arrays
from mbf_mesh_nav.mesh_map import MeshMap
from mbf_mesh_nav.snapshot import MeshSnapshot
from mbf_mesh_nav.vector_field import VectorField

NEVER = np.zeros(1, dtype=np.uint8)
"""The flag of what is not cancelled."""
STEP_SAMPLE = 64
"""The typical weight of an edge is the mean of one in so many."""


@dataclass(frozen=True, eq=False)
class Wave:
    """A wave that reached the start of its query.

    Attributes
    ----------
    distances : (V,) float32
        Weighted distance [m] to the goal, inf where the wave did not come.
    predecessors, cut_records, bends : (V,) int32
        See ``kernels.cvp.propagate_wave``.
    """

    distances: NDArray[np.float32]
    predecessors: NDArray[np.int32]
    cut_records: NDArray[np.int32]
    bends: NDArray[np.int32]


class _Weights(NamedTuple):
    """Weights of corner records at one version of the map, and the typical weight [m] of an edge."""

    version: int
    of_corners: NDArray[np.float32]
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

    def spread(self, query: LegQuery, overshoot: float) -> Wave | None:
        """Spread a wave from the goal until it is ``overshoot`` [m] past the start; None: not reached, or cancelled."""
        corners = self._mesh_map.faces[query.start.face]
        targets = np.ascontiguousarray(corners[~query.blocked[corners]])
        wave = self._propagated(query, targets, max(overshoot, 2.0 * self._mesh_map.topology.mean_edge_length))
        return wave if wave is not None and np.isfinite(wave.distances[corners]).any() else None

    def reach(self, query: LegQuery) -> NDArray[np.float32] | None:
        """Distances (V,) from the start to all that a way over free faces leads to, inf elsewhere; None: cancelled."""
        from_start = replace(query, start=query.goal, goal=query.start)
        wave = self._propagated(from_start, np.zeros(0, dtype=np.int32), 0.0)
        return None if wave is None else wave.distances

    def trace(self, query: LegQuery, wave: Wave) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
        """Positions (n, 3) from start to goal down the field, and the face (n,) the way to each of them lies in."""
        mesh_map, start, goal = self._mesh_map, query.start, query.goal
        if start.face == goal.face:
            return np.array([start.point, goal.point]), np.array([start.face, goal.face], dtype=np.int32)
        return trace_descent(
            mesh_map.vertices,
            mesh_map.faces,
            mesh_map.face_neighbours,
            mesh_map.vertex_face_offsets,
            mesh_map.vertex_faces,
            wave.distances,
            wave.predecessors,
            start.face,
            tuple(start.point.tolist()),
            goal.face,
            tuple(goal.point.tolist()),
            4 * len(mesh_map.faces),
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
        return VectorField(
            directions, wave.distances, goal.face, goal.point.copy(), query.snapshot.version, mesh_map.topology
        )

    def _propagated(self, query: LegQuery, targets: NDArray[np.int32], overshoot: float) -> Wave | None:
        """Run the kernel from the goal of a query; None if cancelled."""
        mesh_map = self._mesh_map
        weights = self._take_weights(query)
        if weights is None:
            return None
        distances, predecessors, seeds = seeded_arrays(mesh_map, query.blocked, query.goal, query.snapshot)
        if len(seeds) == 1:
            seeds = self._seed_around(query, int(seeds[0]), distances, predecessors)
        cut_records = np.full(len(distances), ALONG_EDGE, dtype=np.int32)
        bends = np.full(len(distances), NO_BEND, dtype=np.int32)
        settled = propagate_wave(
            mesh_map.vertex_face_offsets,
            self._corner_ends,
            weights.of_corners,
            query.blocked,
            distances,
            predecessors,
            cut_records,
            bends,
            seeds,
            targets,
            overshoot,
            weights.step,
            query.cancel_flag,
        )
        self._weights = weights
        return None if settled < 0 else Wave(distances, predecessors, cut_records, bends)

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
        return self._written(query.snapshot, changed, weights.of_corners, query.cancel_flag)

    def _gathered(self, snapshot: MeshSnapshot, cancel_flag: NDArray[np.uint8]) -> _Weights | None:
        of_corners = np.empty((len(self._corner_ends), 3), dtype=np.float32)
        everything = np.arange(len(snapshot.costs), dtype=np.int32)
        return self._written(snapshot, everything, of_corners, cancel_flag)

    def _written(
        self,
        snapshot: MeshSnapshot,
        changed: NDArray[np.int32],
        of_corners: NDArray[np.float32],
        cancel_flag: NDArray[np.uint8],
    ) -> _Weights | None:
        """Bring weights (3F, 3) up to date at the changed vertices."""
        mesh_map = self._mesh_map
        finished = write_corner_weights(
            mesh_map.vertex_face_offsets,
            self._corner_ends,
            mesh_map.neighbour_offsets,
            mesh_map.neighbours,
            snapshot.edge_weights,
            changed,
            of_corners,
            cancel_flag,
        )
        sample = snapshot.edge_weights[::STEP_SAMPLE]
        sample = sample[np.isfinite(sample)]
        step = float(sample.mean()) if len(sample) else mesh_map.topology.mean_edge_length
        return _Weights(snapshot.version, of_corners, step) if finished else None

    def _seed_around(
        self, query: LegQuery, center: int, distances: NDArray[np.float32], predecessors: NDArray[np.int32]
    ) -> NDArray[np.int32]:
        """Seed the ring of a goal face's only free corner too: a wave needs two known corners to enter a face."""
        mesh_map = self._mesh_map
        slots = slice(mesh_map.neighbour_offsets[center], mesh_map.neighbour_offsets[center + 1])
        ring = mesh_map.neighbours[slots]
        free = ~query.blocked[ring]
        ring = ring[free]
        distances[ring] = distances[center] + query.snapshot.edge_weights[slots][free]
        predecessors[ring] = center
        return np.concatenate([[center], ring]).astype(np.int32)
