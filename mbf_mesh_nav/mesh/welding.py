"""Finding vertices that stand for one point: at the same position, or nearly so at the boundaries of parts that meet.

Parts of a scene are moved into place by matrices, and files hold four bytes a coordinate: two tiles laid edge to edge
then miss each other by a rounding error. Only vertices at a boundary are compared with a tolerance, so the
inside of a surface never changes, however fine it is.
"""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry.arithmetic import norm
from mbf_mesh_nav.arrays import FloatArray, IntArray
from mbf_mesh_nav.mesh.topology import group_of_each

ROUNDING_SHARE = 1e-6
"""Default distance for joining, in diagonals of the mesh: some twenty times what four-byte numbers lose."""


def same_position(vertices: FloatArray) -> IntArray:
    """First vertex at the same position, for every vertex (V,)."""
    order = np.lexsort(vertices.T)
    in_order = vertices[order]
    is_first = np.ones(len(order), dtype=np.bool_)
    is_first[1:] = (in_order[1:] != in_order[:-1]).any(axis=1)
    # The sort is stable, so the first of a run has the smallest number.
    target = np.zeros(len(order), dtype=np.int32)
    target[order] = order[is_first][np.cumsum(is_first) - 1]
    return target


def join_boundaries(vertices: FloatArray, face_neighbours: IntArray, faces: IntArray, distance: float) -> IntArray:
    """Vertex that stands for each vertex (V,) when the ones at boundaries within ``distance`` [m] are joined.

    Parameters
    ----------
    vertices : (V, 3) float64
    face_neighbours, faces : (F, 3) int32
        -1 = no face across the edge from corner k to corner k+1.
    distance : float
        [m]; chains of vertices that are each as close to the next become one.
    """
    target = np.arange(len(vertices), dtype=np.int32)
    face, corner = np.nonzero(face_neighbours < 0)
    boundary = np.unique(np.concatenate([faces[face, corner], faces[face, (corner + 1) % 3]]))
    pairs = _pairs_within(vertices[boundary], distance)
    if not len(pairs):
        return target
    target[boundary] = boundary[first_of_group(pairs, len(boundary))]
    # Corners of one face that are this close are a fine detail and no seam: leave all of them where they are.
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    detail = target[start[(target[start] == target[end]) & (start != end)]]
    return np.where(np.isin(target, detail), np.arange(len(target), dtype=np.int32), target)


def _pairs_within(points: FloatArray, distance: float) -> NDArray[np.integer]:
    """Pairs (n, 2) of points (P, 3) that are at most ``distance`` [m] apart."""
    if not _may_be_near(points, distance):
        return np.empty((0, 2), dtype=np.intp)
    from scipy.spatial import cKDTree  # slow to import, and most meshes have no such points

    return np.asarray(cKDTree(points).query_pairs(distance, output_type="ndarray"))


def _may_be_near(points: FloatArray, distance: float) -> bool:
    """Whether any two points (P, 3) may be at most ``distance`` [m] apart; False is certain.

    Two such points share a cell of a grid with cells of four times the distance, or of one moved by half a cell along
    some axes, as at most one of both grids parts them along an axis.
    """
    if not distance > 0.0:
        return True
    for shift in product((0.0, 0.5), repeat=3):
        cells = np.floor(points / (4.0 * distance) + np.array(shift))
        in_order = cells[np.lexsort(cells.T)]
        if (in_order[1:] == in_order[:-1]).all(axis=1).any():
            return True
    return False


def first_of_group(pairs: NDArray[np.integer], count: int) -> IntArray:
    """First member (count,) of the group of each of ``count`` things, groups as in ``group_of_each``."""
    groups = group_of_each(pairs, count)
    return np.unique(groups, return_index=True)[1][groups].astype(np.int32)


def rounding_distance(vertices: FloatArray) -> float:
    """Distance [m] within which boundaries of vertices (V, 3) [m] are joined unless the user gives another."""
    extent = np.ptp(vertices, axis=0) if len(vertices) else np.zeros(3)
    return ROUNDING_SHARE * float(norm(extent))
