"""Leading a corridor round the other side of the vertices beside it, as long as its path becomes shorter.

A geodesic is shortest among its neighbours only: where the surface has a peak, one passes it on the left and another on
the right. ``straighten`` turns a corridor where its path bends; here it is turned where the path passes a vertex
straight, one vertex at a time, and the geodesic on the other side is taken where it is shorter.
"""

from __future__ import annotations

from mbf_mesh_nav.arrays import FloatArray, IntArray
from mbf_mesh_nav.kernels.compiled import Count, kernel
from mbf_mesh_nav.kernels.mesh.corners import corner_of
from mbf_mesh_nav.kernels.mesh.vectors import Vector
from mbf_mesh_nav.kernels.wave.corridor_windows import faces_round, path_length, turned_corridor
from mbf_mesh_nav.kernels.wave.corridors import FreeFaces
from mbf_mesh_nav.kernels.wave.straight_corridors import other_side, straighten

_SHORTER = 1.0 - 1e-6
"""Only what makes a path shorter by more than rounding is another path."""
_MAX_TRIES_A_FACE = 50


@kernel
def pass_vertices(mesh: FreeFaces, corridor: IntArray, start: Vector, goal: Vector) -> tuple[FloatArray, IntArray]:
    """Shortest geodesic that vertices passed on their other side lead to; arguments and result of ``straighten``."""
    may_turn = bool(Count(1))  # a plain True makes numba compile ``straighten`` for this constant, too
    points, corridor = straighten(mesh, corridor, start, goal, may_turn)
    length, index, tries = path_length(points, Count(0), len(corridor)), Count(0), _MAX_TRIES_A_FACE * len(corridor)
    while index < len(corridor) - 1 and tries > 0:
        is_shorter = False
        for corner in range(3):
            # Every vertex once: at the first face of the corridor that has it, if the next one has it, too.
            vertex = Count(mesh.faces[corridor[index], corner])
            begins = index == 0 or corner_of(mesh.faces[corridor[index - 1]], vertex) < 0
            if not begins or corner_of(mesh.faces[corridor[index + 1]], vertex) < 0:
                continue
            last = index + 1
            while last < len(corridor) - 1 and corner_of(mesh.faces[corridor[last + 1]], vertex) >= 0:
                last += 1
            side = other_side(mesh, corridor, vertex, index, last)
            if side < 0:
                continue
            tries -= 1
            fan = faces_round(mesh, corridor, vertex, index, last, side)
            other = turned_corridor(corridor, fan, index, last)
            found, found_corridor = straighten(mesh, other, start, goal, may_turn)
            found_length = path_length(found, Count(0), len(found_corridor))
            if found_length < _SHORTER * length:
                points, corridor, length, is_shorter = found, found_corridor, found_length, True
                break
        index = Count(0) if is_shorter else index + 1
    return points, corridor
