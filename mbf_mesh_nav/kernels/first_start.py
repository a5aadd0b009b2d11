"""The kernels that a first start on a mesh needs, so that a second process can compile them ahead.

Each with an example of its arguments: numba compiles for their types, and what they hold is of no matter. Arrays of the
map are read-only, those of a search are not. A test compares the types with those of a real start.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from mbf_mesh_nav.kernels.layers.edge_weights import show_changes
from mbf_mesh_nav.kernels.layers.fading_costs import set_fading_costs
from mbf_mesh_nav.kernels.layers.footprint_settling import settle_footprints
from mbf_mesh_nav.kernels.layers.inflation import repair_distances
from mbf_mesh_nav.kernels.layers.neighbourhood_layers import height_differences, mean_edge_angles, neighbourhood_means
from mbf_mesh_nav.kernels.mesh.borders import past_borders
from mbf_mesh_nav.kernels.mesh.bounding_boxes import closest_face, closest_faces
from mbf_mesh_nav.kernels.mesh.corners import build_corner_ends, write_corner_weights
from mbf_mesh_nav.kernels.mesh.defects import face_shapes, fans_at_vertices, superfluous_faces
from mbf_mesh_nav.kernels.mesh.incidence import faces_of_vertices, groups_of_pairs, neighbours_of_vertices
from mbf_mesh_nav.kernels.mesh.slopes import inclinations
from mbf_mesh_nav.kernels.mesh.surface import Surface
from mbf_mesh_nav.kernels.mesh.topology import (
    edges_of_neighbours,
    faces_across_edges,
    morton_codes,
    unit_face_normals,
    unit_vertex_normals,
)
from mbf_mesh_nav.kernels.motion.path_costs import way_cost
from mbf_mesh_nav.kernels.motion.path_poses import points_on_branch, poses_along
from mbf_mesh_nav.kernels.search.dijkstra import SearchGraph, propagate_distances
from mbf_mesh_nav.kernels.wave.corridors import FreeFaces, link_faces
from mbf_mesh_nav.kernels.wave.straight_corridors import straighten


def kernels() -> list[tuple[Any, tuple[Any, ...]]]:
    """Return each kernel with an example of its arguments, in the order in which a start needs them."""
    rows, face_rows, float_rows = _example(float, 2), _example(np.int32, 2), _example(np.float32, 2)
    reals = _example(float)
    numbers, floats, flags, octets = (_example(kind) for kind in (np.int32, np.float32, np.bool_, np.uint8))
    points, faces, listed, costs = (_fixed(array) for array in (rows, face_rows, numbers, floats))
    surface = Surface(points, faces, points, faces, listed, listed, listed, listed)
    free, point = FreeFaces(points, faces, faces, flags), (0.0, 0.0, 0.0)
    graph = SearchGraph(listed, listed, costs, flags)
    bound = (points, reals)
    return [
        (face_shapes, (rows, face_rows)),
        (faces_of_vertices, (face_rows, 1)),
        (faces_across_edges, (face_rows, numbers, numbers)),
        (superfluous_faces, (face_rows, numbers, numbers)),
        (fans_at_vertices, (face_rows, face_rows, numbers, numbers)),
        (groups_of_pairs, (face_rows, 1)),
        (morton_codes, (rows, reals, 0.0)),
        (neighbours_of_vertices, (face_rows, numbers, numbers)),
        (edges_of_neighbours, (rows, numbers, numbers)),
        (unit_face_normals, (rows, face_rows)),
        (unit_vertex_normals, (rows, numbers, numbers)),
        (show_changes, (listed, listed, costs, costs, _fixed(flags), 0.0, numbers, floats, flags, floats)),
        (settle_footprints, (surface, reals, _example(np.int64), 0.0, 0.0, True, reals)),
        (inclinations, (reals,)),
        (mean_edge_angles, (points, listed, listed)),
        (neighbourhood_means, (reals, points, listed, listed, 0.0)),
        (height_differences, (points, points, listed, listed, 0.0, 0.0)),
        (repair_distances, (surface, 0.0, flags, flags, numbers, floats, face_rows)),
        (set_fading_costs, (floats, numbers, 0, 0.0, 0.0, 0.0, 0.0, floats)),
        (build_corner_ends, (faces, listed, listed)),
        (write_corner_weights, (listed, face_rows, listed, listed, costs, numbers, float_rows, flags, octets)),
        (closest_face, (points, faces, rows, numbers, 0.0, 0.0, 0.0, 0.0, 0)),
        (propagate_distances, (graph, floats, numbers, numbers, 0.0, numbers, floats, octets, bound)),
        (points_on_branch, (numbers, 0, points, points, True)),
        (poses_along, (rows, rows, 0.0)),
        (closest_faces, (points, faces, rows, numbers, rows, _example(np.int64), 0.0)),
        (past_borders, (faces, points, faces, flags, rows, numbers, rows, rows, 0.0, 0.0)),
        (way_cost, (points, faces, costs, 0.0, rows, numbers)),
        (link_faces, (free, numbers)),
        (straighten, (free, numbers, point, point, True)),
    ]


def _example(kind: DTypeLike, dimensions: int = 1) -> NDArray[Any]:
    return np.zeros((1,) * dimensions, dtype=kind)


def _fixed(array: NDArray[Any]) -> NDArray[Any]:
    """Read-only, which is a type of its own for numba."""
    fixed = array.copy()
    fixed.flags.writeable = False
    return fixed
