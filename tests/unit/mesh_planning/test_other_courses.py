"""Geodesics on coarse meshes: on the right side of peaks, against exact ones, and never over blocked faces."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pygeodesic import geodesic

from mbf_abstract.geometry import Pose
from mbf_abstract.plugins import PlanRequest
from mbf_mesh_nav.kernels.wave.corridor_detours import pass_vertices
from mbf_mesh_nav.kernels.wave.corridors import FreeFaces, link_faces
from mbf_mesh_nav.kernels.wave.straight_corridors import straighten
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.planners.any_angle import AnyAnglePlanner
from mbf_mesh_nav.planners.cvp import CVPPlanner


def coarse_map(seed, side=9):
    """Peaks and pits as high as the edges are long."""
    return MeshMap.from_heights(np.random.default_rng(seed).uniform(0.0, 1.5, (side, side)), 1.0, 1.0)


def length_of(points):
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


def test_paths_on_coarse_rough_meshes_are_within_three_percent_of_exact_ones(make_plugin):
    errors = []
    for seed in range(6):
        mesh_map = coarse_map(seed)
        solver = geodesic.PyGeodesicAlgorithmExact(mesh_map.vertices, mesh_map.faces)
        for planner in (make_plugin(CVPPlanner, mesh_map), make_plugin(AnyAnglePlanner, mesh_map)):
            for source in (10, 40):
                exact, _ = solver.geodesicDistances(np.array([source]), None)
                for target in np.flatnonzero(exact > 4.0)[::4]:
                    ends = (Pose(tuple(mesh_map.vertices[end])) for end in (target, source))
                    errors.append(planner.make_plan(PlanRequest(*ends)).path.length / exact[target] - 1.0)
    assert min(errors) > -1e-6
    assert max(errors) < 0.03
    assert np.mean(errors) < 0.005


def other_sides(mesh_map, blocked, corridor):
    """Naive: the corridor led round the other side of every vertex it passes, where free faces lead round it."""
    for vertex in np.unique(mesh_map.faces[corridor]).tolist():
        at = [index for index, face in enumerate(corridor) if vertex in mesh_map.faces[face]]
        runs = np.split(at, np.flatnonzero(np.diff(at) > 1) + 1)
        for run in (run for run in runs if len(run) > 1 and corridor[run[0]] != corridor[run[-1]]):
            way, previous = [corridor[run[0]]], corridor[run[1]]
            while way[-1] != corridor[run[-1]]:
                around = [f for f in mesh_map.face_neighbours[way[-1]] if f >= 0 and vertex in mesh_map.faces[f]]
                following = [face for face in around if face != previous]
                if not following or blocked[mesh_map.faces[following[0]]].any() or len(way) > 30:
                    break
                previous = way[-1]
                way.append(following[0])
            else:
                yield np.array([*corridor[: run[0]], *way, *corridor[run[-1] + 1 :]], np.int32)


@given(seed=st.integers(0, 10**6))
@settings(max_examples=20, deadline=None)
def test_no_single_vertex_passed_on_its_other_side_makes_a_path_shorter(seed):
    mesh_map, rng = coarse_map(seed), np.random.default_rng(seed)
    blocked = rng.random(len(mesh_map.vertices)) < 0.05
    mesh = FreeFaces(mesh_map.vertices, mesh_map.faces, mesh_map.face_neighbours, blocked)
    free = np.flatnonzero(~blocked[mesh_map.faces].any(axis=1))
    walk = [int(rng.choice(free))]
    for _ in range(60):  # a random walk over free faces is a poor corridor
        around = [f for f in mesh_map.face_neighbours[walk[-1]] if f >= 0 and f in free]
        walk += [int(rng.choice(around))] if around else []
    corridor, pieces = link_faces(mesh, np.array(walk, np.int32))
    if len(pieces) != 1 or len(corridor) < 2:
        return
    ends = [tuple(mesh_map.vertices[mesh_map.faces[face]].mean(axis=0).tolist()) for face in corridor[[0, -1]]]
    before, _ = straighten(mesh, corridor, *ends, True)
    points, found = pass_vertices(mesh, corridor, *ends)
    assert length_of(points) <= length_of(before)
    assert not blocked[mesh_map.faces[found]].any()
    assert all(following in mesh_map.face_neighbours[face] for face, following in itertools.pairwise(found))
    for other in other_sides(mesh_map, blocked, found):
        assert length_of(straighten(mesh, other, *ends, True)[0]) > (1.0 - 2e-6) * length_of(points)


@pytest.mark.parametrize("planner_class", [CVPPlanner, AnyAnglePlanner])
def test_other_courses_do_not_lead_over_lethal_faces(make_plugin, paint, planner_class):
    for seed in range(6):
        rng, mesh_map = np.random.default_rng(seed), coarse_map(seed)
        lethal = rng.random(len(mesh_map.vertices)) < 0.15
        lethal[[0, 80]] = False
        mesh_map = paint(mesh_map, lambda v, lethal=lethal: np.where(lethal, np.inf, 0.0))
        ends = (Pose(tuple(mesh_map.vertices[end])) for end in (0, 80))
        result = make_plugin(planner_class, mesh_map).make_plan(PlanRequest(*ends))
        if not result.success or result.message:  # along edges, said so
            continue
        middles = 0.5 * (result.path.positions[1:] + result.path.positions[:-1])
        assert not lethal[mesh_map.faces[mesh_map.locate(middles).faces]].any()
