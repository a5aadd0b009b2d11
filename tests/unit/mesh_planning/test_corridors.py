"""Geodesics from corridors of faces: against exact geodesics, and what may not be part of a corridor."""

import itertools

import numpy as np
import pytest
import trimesh
from pygeodesic import geodesic

from mbf_abstract.geometry import Pose
from mbf_abstract.plugins import PlanRequest
from mbf_mesh_nav.kernels.wave.corridors import FreeFaces, link_faces
from mbf_mesh_nav.kernels.wave.straight_corridors import straighten
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh
from mbf_mesh_nav.planners.any_angle import AnyAnglePlanner
from mbf_mesh_nav.planners.cvp import CVPPlanner


def faces_along(mesh_map, curve):
    """Faces below the points (n, 2) of a curve, each once in a row."""
    faces = mesh_map.locate(np.column_stack([curve, np.zeros(len(curve))])).faces
    return faces[np.concatenate([[True], np.diff(faces) != 0])]


@pytest.mark.parametrize("seed", range(10))
def test_on_flat_free_ground_a_winding_corridor_becomes_the_straight_line(seed):
    mesh_map = MeshMap.from_heights(np.zeros((21, 31)), 0.2, 0.3)
    waves, phase = np.random.default_rng(seed).uniform(0.5, 2.5, 2)
    x = np.linspace(0.7, 5.3, 2000)
    none = np.zeros(len(mesh_map.vertices), np.bool_)
    mesh = FreeFaces(mesh_map.vertices, mesh_map.faces, mesh_map.face_neighbours, none)
    winding = faces_along(mesh_map, np.column_stack([x, 3.0 + 1.2 * np.sin(waves * x + phase)]))
    corridor, _ = link_faces(mesh, winding)
    start, goal = mesh_map.vertices[mesh_map.faces[corridor[[0, -1]]]].mean(axis=1)
    points, faces = straighten(mesh, corridor, tuple(start), tuple(goal), True)
    assert np.linalg.norm(np.diff(points, axis=0), axis=1).sum() == pytest.approx(np.linalg.norm(goal - start))
    assert len(points) == len(faces) + 1
    neighbours = [following in mesh_map.face_neighbours[face] for face, following in itertools.pairwise(faces)]
    assert all(neighbours)


def test_a_corridor_is_not_turned_over_blocked_faces():
    mesh_map = MeshMap.from_heights(np.zeros((9, 9)), 0.5, 0.5)
    blocked = np.linalg.norm(mesh_map.vertices - [2.0, 2.0, 0.0], axis=1) < 0.1
    angles = np.linspace(np.pi, 0.0, 500)
    arc = 2.0 + 1.1 * np.column_stack([np.cos(angles), np.sin(angles)])
    mesh = FreeFaces(mesh_map.vertices, mesh_map.faces, mesh_map.face_neighbours, blocked)
    linked, pieces = link_faces(mesh, faces_along(mesh_map, arc))
    assert len(pieces) == 1
    ends = tuple(mesh_map.vertices[mesh_map.faces[linked[[0, -1]]]].mean(axis=1).tolist())
    points, faces = straighten(mesh, linked, tuple(ends[0]), tuple(ends[1]), True)
    assert not blocked[mesh_map.faces[faces]].any()
    assert np.linalg.norm(points[:, :2] - 2.0, axis=1).min() > 0.3  # round the faces of the blocked vertex


def test_faces_that_touch_in_a_vertex_of_two_fans_are_not_linked():
    # Two pyramids that stand tip on tip: the tip, vertex 0, has two closed fans.
    upper = [(0, 1 + k, 1 + (k + 1) % 4) for k in range(4)]
    faces = np.array([*upper, *((0, b + 4, a + 4) for _, a, b in upper)], np.int32)
    neighbours = np.array([[(f - 1) % 4, -1, (f + 1) % 4] for f in range(4)], np.int32)
    neighbours = np.vstack([neighbours, np.where(neighbours < 0, -1, neighbours + 4)[:, ::-1]])
    mesh = FreeFaces(np.zeros((9, 3)), faces, neighbours, np.zeros(9, np.bool_))
    _, pieces = link_faces(mesh, np.array([0, 0, 5, 5], np.int32))
    assert len(pieces) == 2


def irregular(count, seed):
    """Hills with vertices anywhere: long, thin and large triangles in a row."""
    from scipy.spatial import Delaunay

    rng = np.random.default_rng(seed)
    places = np.vstack([rng.uniform(0.0, 10.0, (count, 2)), [(0, 0), (0, 10), (10, 0), (10, 10)]])
    heights = 0.8 * np.sin(1.3 * places[:, 0]) * np.cos(1.1 * places[:, 1])
    faces = Delaunay(places).simplices
    a, b, c = (places[faces[:, k]] for k in range(3))
    turned = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0] < 0.0
    faces[turned] = faces[turned][:, ::-1]
    return np.column_stack([places, heights]), faces


def stretched():
    x, y = np.meshgrid(np.arange(20) * 0.4, np.arange(60) * 0.1)
    return heightfield_mesh(0.4 * np.sin(x) * np.cos(0.8 * y), 0.4, 0.1)


def torus():
    made = trimesh.creation.torus(2.0, 0.8, major_sections=32, minor_sections=16)
    return made.vertices, made.faces


@pytest.mark.parametrize("make", [lambda: irregular(250, 2), stretched, torus], ids=["irregular", "stretched", "torus"])
@pytest.mark.parametrize("planner_class", [CVPPlanner, AnyAnglePlanner])
def test_paths_are_exact_geodesics_but_for_three_percent(make_plugin, planner_class, make):
    mesh_map = MeshMap.from_arrays(*make())
    solver = geodesic.PyGeodesicAlgorithmExact(mesh_map.vertices, mesh_map.faces)
    planner, rng, ratios = make_plugin(planner_class, mesh_map), np.random.default_rng(3), []
    for source in rng.choice(len(mesh_map.vertices), 3, replace=False):
        exact, _ = solver.geodesicDistances(np.array([source]), None)
        far = np.flatnonzero(exact > 5.0 * mesh_map.neighbour_lengths.mean())
        for target in rng.choice(far, 20, replace=False):
            ends = (Pose(tuple(mesh_map.vertices[vertex])) for vertex in (target, source))
            ratios.append(planner.make_plan(PlanRequest(*ends)).path.length / exact[target])
    assert min(ratios) > 0.9999 and np.mean(ratios) < 1.005 and max(ratios) < 1.03
