"""Shortening a path through faces to a geodesic, without raising its cost."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mbf_mesh_nav.arrays import BoolArray, FlagArray, FloatArray, IntArray
from mbf_mesh_nav.kernels.wave.corridor_detours import pass_vertices
from mbf_mesh_nav.kernels.wave.corridors import FreeFaces, link_faces
from mbf_mesh_nav.kernels.wave.straight_corridors import straighten
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
        turn = not self.has_costs(point_faces)
        return self._by_pieces(positions, point_faces, lambda old, corridor: self._shorten_piece(*old, corridor, turn))

    def cheapest(self, positions: FloatArray, point_faces: IntArray, cancel_flag: FlagArray) -> Piece:
        """Of the path as it is, the geodesic near it, the string in its own faces and its pulled halves the cheapest.

        Unlike ``shorten`` it also looks for geodesics over costs, for paths that no wave has led over them.

        Parameters
        ----------
        positions, point_faces
            See ``shorten``.
        cancel_flag : (1,) uint8
            Nonzero: what is left stays as it is.
        """
        return self._by_pieces(
            positions, point_faces, lambda old, corridor: self._cheapest_piece(old, corridor, cancel_flag)
        )

    def string(self, points: FloatArray, point_faces: IntArray) -> Piece:
        """The shortest path through the faces (n,) in which points (n, 3) lie, and what links them."""

        def pull(piece: Piece, corridor: IntArray) -> Piece:
            ends = tuple(piece[0][0].tolist()), tuple(piece[0][-1].tolist())
            pulled, faces = straighten(self._free, corridor, *ends, False)
            return pulled, np.concatenate([piece[1][:1], faces])

        return self._by_pieces(points, point_faces, pull)

    def _by_pieces(
        self, positions: FloatArray, point_faces: IntArray, pull: Callable[[Piece, IntArray], Piece]
    ) -> Piece:
        """The path with each of its pieces among free faces replaced by what ``pull`` makes of it and its corridor."""
        corridor, pieces = link_faces(self._free, point_faces)
        points, faces = [positions[:1]], [point_faces[:1]]
        for first, last, begin, end in pieces.tolist():
            old = positions[first : last + 1], point_faces[first : last + 1]
            new = pull(old, corridor[begin:end]) if end > begin else old
            points.append(new[0][1:])
            faces.append(new[1][1:])
        return np.concatenate(points), np.concatenate(faces)

    def _cheapest_piece(self, piece: Piece, corridor: IntArray, cancel_flag: FlagArray) -> Piece:
        """See ``cheapest``; of equal cost the piece as it is."""
        if cancel_flag[0]:
            return piece
        positions, point_faces = piece
        ends = tuple(positions[0].tolist()), tuple(positions[-1].tolist())
        candidates = [piece]
        for turn in (True, False):
            pulled, faces = straighten(self._free, corridor, *ends, turn)
            candidates.append((pulled, np.concatenate([point_faces[:1], faces])))
        middle = len(positions) // 2
        cut = np.flatnonzero(corridor == point_faces[middle])
        if middle >= _MIN_PIECE and len(cut):
            head = positions[: middle + 1], point_faces[: middle + 1]
            tail = positions[middle:], point_faces[middle:]
            halves = (
                self._cheapest_piece(head, corridor[: cut[0] + 1], cancel_flag),
                self._cheapest_piece(tail, corridor[cut[0] :], cancel_flag),
            )
            candidates.append(joined(*halves))
        return min(candidates, key=lambda candidate: self.cost(*candidate))

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
        return joined(head, tail)

    def pass_vertices(self, positions: FloatArray, point_faces: IntArray) -> Piece:
        """The shortest geodesic found by passing single vertices on their other side; all costs apart.

        ``positions`` (n, 3) [m] and ``point_faces`` (n,) int32 are those of the path to begin with.

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
        """Length plus collected cost [m] of a path of positions (n, 3) [m] in faces (n,), see ``path_cost``."""
        return cost_along(self._mesh_map, self._snapshot, positions, point_faces)


def joined(head: Piece, tail: Piece) -> Piece:
    """One path of two, the second of which begins where the first ends."""
    return np.concatenate([head[0], tail[0][1:]]), np.concatenate([head[1], tail[1][1:]])
