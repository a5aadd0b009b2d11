"""What a robot may drive straight from vertex to vertex: along the edges of a mesh, and across two faces.

Edges alone leave few headings: six on a regular grid. A *stride* leads from a vertex over the opposite side of one of
its faces to the far corner of the face beyond, straight in the plan view; with strides there are twelve. A place where
the tilt allows few headings is often passed by a stride and by no edge.

When to use: by searches that look at headings. When not: by searches that do not; to them a stride saves nothing that
pulling the path straight would not, and they pay for it at each vertex.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry.arithmetic import arctan2, norm
from mbf_mesh_nav.arrays import BoolArray, Float32Array, FloatArray, IntArray, sorted_once
from mbf_mesh_nav.kernels.search.goal_bound import Arrivals
from mbf_mesh_nav.kernels.search.heading_astar import HEADING_STEP, HEADINGS, Moves
from mbf_mesh_nav.kernels.search.move_weights import weights_of_moves
from mbf_mesh_nav.map.snapshot import MeshSnapshot
from mbf_mesh_nav.mesh.topology import MeshTopology

PASSES_CORNER = 0.02
"""A stride that crosses an edge nearer to one of its ends than this share of the edge is driven along edges as well."""
NO_STRIDE = -1


class DriveGraph:
    """Edges and strides of one mesh, by their first vertex; of each vertex the edges come first.

    Attributes
    ----------
    moves : Moves
        As kernels take them, m in all.
    """

    def __init__(self, mesh: MeshTopology) -> None:
        self._mesh = mesh
        edge_starts = np.repeat(np.arange(mesh.vertex_count), np.diff(mesh.neighbour_offsets))
        strides, left, right, shares = strides_of(mesh)
        starts = np.concatenate([edge_starts, strides[:, 0]])
        order = np.argsort(starts, kind="stable")
        self._starts, edges = starts[order], np.arange(len(edge_starts))
        ends = np.concatenate([mesh.neighbours, strides[:, 1]])[order].astype(np.int32)
        no_strides = np.full(len(edges), NO_STRIDE)
        self._edges = np.concatenate([edges, np.full(len(strides), -1)])[order].astype(np.int32)
        self._left, self._right = (np.concatenate([no_strides, side])[order].astype(np.int32) for side in (left, right))
        offsets = np.concatenate([[0], np.cumsum(np.bincount(starts, minlength=mesh.vertex_count))])
        steps = mesh.vertices[ends] - mesh.vertices[self._starts]
        headings = np.rint(arctan2(steps[:, 1], steps[:, 0]) / HEADING_STEP).astype(np.int64) % HEADINGS
        of_edges = np.full(len(edges), np.nan)
        shares = np.concatenate([of_edges, shares])[order]
        self.moves = Moves(offsets.astype(np.int32), ends, headings.astype(np.uint8), shares)

    @cached_property
    def arrivals(self) -> Arrivals:
        """The moves by the vertex they lead to."""
        order = np.argsort(self.moves.ends, kind="stable").astype(np.int32)
        counts = np.bincount(self.moves.ends, minlength=self._mesh.vertex_count)
        offsets = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
        origins = self._starts[order].astype(np.int32)
        for array in (offsets, origins):  # read-only as a mesh's own: kernels of searches are compiled for one kind
            array.setflags(write=False)
        return Arrivals(offsets, origins, order)

    @property
    def is_edge(self) -> BoolArray:
        """Which moves (m,) are edges; these are in the order of the mesh's ``neighbours``."""
        return np.asarray(self._edges >= 0)

    def ends_from(self, vertices: IntArray) -> IntArray:
        """Vertices (n,) that moves from some vertices (k,) lead to, ascending."""
        offsets = self.moves.offsets
        return sorted_once(
            np.concatenate([self.moves.ends[offsets[one] : offsets[one + 1]] for one in vertices.tolist()])
        )

    def weights(self, snapshot: MeshSnapshot, blocked: BoolArray) -> Float32Array:
        """Length plus collected cost (m,) float32 [m] of all moves.

        Edges weigh what they do in the snapshot. Along strides costs are those of their faces; a stride beside a
        ``blocked`` (V,) vertex is infinite.
        """
        costs = snapshot.edge_weights, snapshot.costs, snapshot.edge_cost_factor
        return weights_of_moves(self._mesh.vertices, self.moves, self._edges, self._left, self._right, *costs, blocked)

    def along(self, chain: IntArray) -> tuple[FloatArray, FloatArray]:
        """Positions and surface normals (n, 3) along moves from vertex to vertex of a chain (k,), on the surface.

        Between the two ends of a stride comes the place where it crosses an edge.
        """
        mesh, offsets = self._mesh, self.moves.offsets
        positions, normals = [mesh.vertices[chain[:1]]], [mesh.vertex_normals[chain[:1]]]
        for vertex, following in zip(chain[:-1].tolist(), chain[1:].tolist(), strict=True):
            begin, end = offsets[vertex : vertex + 2]
            slot = int(begin + np.argmax(self.moves.ends[begin:end] == following))
            if self._edges[slot] < 0:
                left, right, share = self._left[slot], self._right[slot], self.moves.shares[slot]
                positions.append(((1.0 - share) * mesh.vertices[left] + share * mesh.vertices[right])[None])
                normal = (1.0 - share) * mesh.vertex_normals[left] + share * mesh.vertex_normals[right]
                normals.append((normal / norm(normal))[None])
            positions.append(mesh.vertices[[following]])
            normals.append(mesh.vertex_normals[[following]])
        return np.concatenate(positions), np.concatenate(normals)


def strides_of(mesh: MeshTopology) -> tuple[IntArray, IntArray, IntArray, FloatArray]:
    """All strides of a mesh.

    Returns
    -------
    vertices : (s, 2) int32
        First and last vertex.
    left, right : (s,) int32
        Ends of the edge that is crossed, in the winding of the first face.
    shares : (s,) float64
        Where it is crossed in the plan view, 0 at ``left``, 1 at ``right``.
    """
    faces, corners = np.arange(len(mesh.faces)), []
    for corner in range(3):
        beyond = mesh.face_neighbours[faces, (corner + 1) % 3]
        start, left, right = (mesh.faces[:, (corner + step) % 3] for step in range(3))
        far = mesh.faces[beyond].sum(axis=1) - left - right
        there = beyond >= 0
        corners.append(np.stack([start, far, left, right], axis=1)[there])
    start, far, left, right = np.concatenate(corners).T
    ahead, across, aside = (
        mesh.vertices[second, :2] - mesh.vertices[first, :2]
        for first, second in ((start, far), (left, right), (start, left))
    )
    turn = _cross(across, ahead)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = _cross(ahead, aside) / turn
        reached = _cross(across, aside) / turn
    crosses = (share > PASSES_CORNER) & (share < 1.0 - PASSES_CORNER) & (reached > 0.0) & (reached < 1.0)
    # One move from a vertex to another: an edge if there is one, else the first stride.
    edge_starts = np.repeat(np.arange(mesh.vertex_count, dtype=np.int32), np.diff(mesh.neighbour_offsets))
    pairs = np.concatenate([_pair(mesh, edge_starts, mesh.neighbours), _pair(mesh, start, far)[crosses]])
    first = np.unique(pairs, return_index=True)[1] - len(edge_starts)
    kept = np.flatnonzero(crosses)[np.sort(first[first >= 0])]
    return np.stack([start, far], axis=1)[kept].astype(np.int32), left[kept], right[kept], share[kept]


def _pair(mesh: MeshTopology, start: IntArray, end: IntArray) -> NDArray[np.int64]:
    """One number for each pair of vertices."""
    return np.asarray(mesh.vertex_count * start.astype(np.int64) + end)


def _cross(first: FloatArray, second: FloatArray) -> FloatArray:
    """Third component of the cross products of vectors (n, 2)."""
    return np.asarray(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])
