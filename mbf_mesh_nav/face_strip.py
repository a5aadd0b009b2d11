"""Strips of neighbouring faces along a path, and shortening the path within them without raising its cost."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.kernels.funnel import pull_taut
from mbf_mesh_nav.mesh_map import MeshMap
from mbf_mesh_nav.path_cost import cost_along
from mbf_mesh_nav.snapshot import MeshSnapshot

_MIN_PIECE = 4  # faces; shorter pieces are not split further


class FaceStrip:
    """A path through faces, each sharing an edge with the next.

    Parameters
    ----------
    blocked : (V,) bool
        Faces with a blocked corner never become part of a strip.
    """

    def __init__(self, mesh_map: MeshMap, snapshot: MeshSnapshot, blocked: NDArray[np.bool_]) -> None:
        self._mesh_map = mesh_map
        self._snapshot = snapshot
        self._blocked = blocked

    def shorten(
        self, positions: NDArray[np.float64], point_faces: NDArray[np.int32]
    ) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
        """Pull a traced path taut, piece by piece; a piece keeps its old course where the taut one costs more.

        Parameters
        ----------
        positions : (n, 3) float64
            Points from start to goal [m].
        point_faces : (n,) int32
            The face in which the way to each point lies; the start's face first.

        Returns
        -------
        positions, point_faces
            The shortened path in the same form.
        """
        pieces = self._pieces(point_faces)
        points = [positions[:1]]
        faces = [point_faces[:1]]
        for first, last, strip in pieces:
            old = positions[first : last + 1], point_faces[first : last + 1]
            new = old if strip is None else self._shorten_piece(*old, strip)
            points.append(new[0][1:])
            faces.append(new[1][1:])
        return np.concatenate(points), np.concatenate(faces)

    def _pieces(self, point_faces: NDArray[np.int32]) -> list[tuple[int, int, list[int] | None]]:
        """Cut the path where no free strip of faces connects it: (first point, last point, strip or None)."""
        pieces: list[tuple[int, int, list[int] | None]] = []
        first, strip = 0, [int(point_faces[1])]
        for index in range(2, len(point_faces)):
            link = self._link(strip[-1], int(point_faces[index]))
            if link is None:
                pieces.append((first, index - 1, strip))
                first, strip = index - 1, [int(point_faces[index])]
            else:
                for face in link:
                    # Into a face and straight back out of it is no step at all.
                    if len(strip) > 1 and strip[-2] == face:
                        strip.pop()
                    else:
                        strip.append(face)
        pieces.append((first, len(point_faces) - 1, strip))
        return [(a, b, strip if strip and not self._is_blocked(strip) else None) for a, b, strip in pieces]

    def _is_blocked(self, strip: list[int]) -> bool:
        return bool(self._blocked[self._mesh_map.faces[strip]].any())

    def _link(self, face: int, following: int) -> list[int] | None:
        """Faces after ``face`` up to ``following``: none, the next one, or a free fan round their common vertex."""
        if face == following:
            return []
        mesh_map = self._mesh_map
        common = np.intersect1d(mesh_map.faces[face], mesh_map.faces[following])
        if len(common) == 2:
            return [following]
        if len(common) == 0:
            return None
        fans = [self._fan(int(common[0]), face, following, side) for side in (0, 2)]
        return min((fan for fan in fans if fan is not None), key=len, default=None)

    def _fan(self, vertex: int, face: int, following: int, side: int) -> list[int] | None:
        """Turn round ``vertex`` over its outgoing (0) or incoming (2) edges until ``following``; None if not free."""
        mesh_map = self._mesh_map
        fan: list[int] = []
        while face != following:
            corner = int(np.flatnonzero(mesh_map.faces[face] == vertex)[0])
            face = int(mesh_map.face_neighbours[face, (corner + side) % 3])
            if face < 0 or self._blocked[mesh_map.faces[face]].any():
                return None
            fan.append(face)
        return fan

    def _shorten_piece(
        self, positions: NDArray[np.float64], point_faces: NDArray[np.int32], strip: list[int]
    ) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
        """Take the taut path through the strip if it is not more expensive, else try its halves."""
        faces = np.array(strip, dtype=np.int32)
        ends = tuple(positions[0].tolist()), tuple(positions[-1].tolist())
        taut = pull_taut(self._mesh_map.vertices, self._mesh_map.faces, faces, *ends)
        taut_faces = np.concatenate([point_faces[:1], faces])
        if self._cost(taut, taut_faces) <= self._cost(positions, point_faces):
            return taut, taut_faces
        middle = len(positions) // 2
        if middle < _MIN_PIECE or point_faces[middle] not in strip:
            return positions, point_faces
        cut = strip.index(int(point_faces[middle]))
        head = self._shorten_piece(positions[: middle + 1], point_faces[: middle + 1], strip[: cut + 1])
        tail = self._shorten_piece(positions[middle:], point_faces[middle:], strip[cut:])
        return np.concatenate([head[0], tail[0][1:]]), np.concatenate([head[1], tail[1][1:]])

    def _cost(self, positions: NDArray[np.float64], point_faces: NDArray[np.int32]) -> float:
        return cost_along(self._mesh_map, self._snapshot, positions, point_faces)
