"""Shortening a path through faces to a geodesic, without raising its cost."""

from __future__ import annotations

import numpy as np

from mbf_mesh_nav.arrays import BoolArray, FloatArray, IntArray
from mbf_mesh_nav.kernels.wave.corridor_detours import pass_vertices
from mbf_mesh_nav.kernels.wave.corridors import FreeFaces, link_faces, straighten
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.map.snapshot import MeshSnapshot
from mbf_mesh_nav.search.path_cost import cost_along

_MIN_PIECE = 10  # points; shorter pieces are not split further

Piece = tuple[FloatArray, IntArray]
"""Points (n, 3) [m], and the face (n,) in which the segment to each lies."""


class Corridor:
    """Paths through faces, each sharing an edge with the next.

    Parameters
    ----------
    blocked : (V,) bool
        Faces with a blocked corner never become part of a corridor.
    """

    def __init__(self, mesh_map: MeshMap, snapshot: MeshSnapshot, blocked: BoolArray) -> None:
        self._mesh_map = mesh_map
        self._snapshot = snapshot
        self._free = FreeFaces(mesh_map.vertices, mesh_map.faces, mesh_map.face_neighbours, blocked)

    def shorten(self, positions: FloatArray, point_faces: IntArray) -> Piece:
        """Shorten a traced path by string pulling; a piece keeps its old course where the shorter one costs more.

        Where nothing along the path has a cost the corridors are changed, too, and the path becomes a geodesic.

        Parameters
        ----------
        positions : (n, 3) float64
            Points from start to goal [m].
        point_faces : (n,) int32
            The face in which the segment to each point lies; the start's face first.

        Returns
        -------
        positions, point_faces
            The shortened path in the same form.
        """
        corridor, pieces = link_faces(self._free, point_faces)
        points, faces, has_costs = [positions[:1]], [point_faces[:1]], self.has_costs(point_faces)
        for first, last, begin, end in pieces.tolist():
            old = positions[first : last + 1], point_faces[first : last + 1]
            new = self._shorten_piece(*old, corridor[begin:end], not has_costs) if end > begin else old
            points.append(new[0][1:])
            faces.append(new[1][1:])
        return np.concatenate(points), np.concatenate(faces)

    def _shorten_piece(self, positions: FloatArray, point_faces: IntArray, corridor: IntArray, turn: bool) -> Piece:
        """Take the geodesic near the corridor if it is not more expensive, else try its halves."""
        ends = tuple(positions[0].tolist()), tuple(positions[-1].tolist())
        shortened, faces = straighten(self._free, corridor, *ends, turn)
        pulled_faces = np.concatenate([point_faces[:1], faces])
        if self.cost(shortened, pulled_faces) <= self.cost(positions, point_faces):
            return shortened, pulled_faces
        middle = len(positions) // 2
        cut = np.flatnonzero(corridor == point_faces[middle])
        if middle < _MIN_PIECE or len(cut) == 0:
            return positions, point_faces
        head = self._shorten_piece(positions[: middle + 1], point_faces[: middle + 1], corridor[: cut[0] + 1], turn)
        tail = self._shorten_piece(positions[middle:], point_faces[middle:], corridor[cut[0] :], turn)
        return np.concatenate([head[0], tail[0][1:]]), np.concatenate([head[1], tail[1][1:]])

    def pass_vertices(self, positions: FloatArray, point_faces: IntArray) -> Piece:
        """The shortest geodesic found by passing single vertices on their other side; all costs apart.

        A path that leads along edges between blocked faces stays as it is.
        """
        corridor, pieces = link_faces(self._free, point_faces)
        if len(pieces) != 1 or len(corridor) == 0:
            return positions, point_faces
        ends = tuple(positions[0].tolist()), tuple(positions[-1].tolist())
        points, faces = pass_vertices(self._free, corridor, *ends)
        return points, np.concatenate([point_faces[:1], faces])

    def has_costs(self, faces: IntArray) -> bool:
        """Whether costs on faces (n,) make some paths over them longer than others; infinite ones do not count."""
        costs = self._snapshot.costs[self._mesh_map.faces[faces]]
        return self._snapshot.edge_cost_factor > 0.0 and bool((np.isfinite(costs) & (costs > 0.0)).any())

    def cost(self, positions: FloatArray, point_faces: IntArray) -> float:
        """Length plus collected cost [m] of a path, see ``path_cost``."""
        return cost_along(self._mesh_map, self._snapshot, positions, point_faces)
