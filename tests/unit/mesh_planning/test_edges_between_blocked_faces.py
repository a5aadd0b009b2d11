"""Planners over faces where only single edges or corners are free: they take the edges there, and say so."""

import numpy as np
import pytest

from mbf_abstract.geometry import Pose
from mbf_abstract.plugins import PlanRequest
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.planners.any_angle import AnyAnglePlanner
from mbf_mesh_nav.planners.cvp import CVPPlanner
from mbf_mesh_nav.planners.dijkstra import DijkstraPlanner


@pytest.fixture(params=[CVPPlanner, AnyAnglePlanner], ids=lambda planner: planner.__name__)
def planner_class(request):
    return request.param


def bridge(vertices):
    """A wall at 2.5 < x < 3.5 with one row of free vertices through it, at y = 3."""
    inside = (vertices[:, 0] > 2.5) & (vertices[:, 0] < 3.5) & (np.abs(vertices[:, 1] - 3.0) > 0.1)
    return np.where(inside, np.inf, 0.0)


def test_a_row_of_single_free_vertices_is_passed_along_its_edges(planner_class, make_plugin, plain, paint):
    mesh_map = paint(plain(), bridge)
    result = make_plugin(planner_class, mesh_map).make_plan(PlanRequest(Pose.planar(0.5, 0.7), Pose.planar(5.5, 4.1)))
    assert result.success, result.message
    assert "lead along edges between blocked faces" in result.message
    on_bridge = np.abs(result.path.positions[:, 0] - 3.0) < 0.45
    np.testing.assert_allclose(result.path.positions[on_bridge, 1], 3.0, atol=1e-6)
    shortest = np.hypot(2.0, 2.3) + 1.0 + np.hypot(2.0, 1.1)
    assert shortest <= result.path.length < 1.02 * shortest


def test_where_a_way_over_whole_faces_exists_no_edge_is_taken(planner_class, make_plugin, plain, paint):
    mesh_map = paint(plain(), lambda v: np.where(v[:, 1] < 5.3, bridge(v), 0.0))
    result = make_plugin(planner_class, mesh_map).make_plan(PlanRequest(Pose.planar(0.5, 0.7), Pose.planar(5.5, 4.1)))
    assert result.success and result.message == ""
    assert result.path.positions[:, 1].max() > 5.3


@pytest.mark.parametrize("free_corners", [1, 2])
def test_a_goal_whose_face_has_few_free_corners_is_reached(planner_class, make_plugin, plain, paint, free_corners):
    # Only the goal's own corners, or one of them, and a row of vertices that leads away from it are free near it.
    mesh_map = plain()
    goal = np.array([3.02, 3.04, 0.0])
    corners = mesh_map.faces[mesh_map.locate_one(goal).face]
    near = mesh_map.vertices[corners[np.argsort(np.linalg.norm(mesh_map.vertices[corners] - goal, axis=1))]]

    def costs(vertices):
        around = np.linalg.norm(vertices[:, :2] - goal[:2], axis=1) < 0.9
        kept = np.zeros(len(vertices), bool)
        for corner in near[:free_corners]:
            kept |= np.linalg.norm(vertices - corner, axis=1) < 1e-6
        row = (np.abs(vertices[:, 1] - near[0, 1]) < 0.05) & (vertices[:, 0] < near[0, 0])
        return np.where(around & ~kept & ~row, np.inf, 0.0)

    paint(mesh_map, costs)
    result = make_plugin(planner_class, mesh_map).make_plan(PlanRequest(Pose.planar(0.5, 0.7), Pose(tuple(goal))))
    assert result.success, result.message
    assert result.path.positions[-1].tolist() == goal.tolist()


@pytest.mark.parametrize("seed", range(6))
def test_they_find_a_path_wherever_the_vertex_graph_has_one(planner_class, make_plugin, paint, seed):
    rng = np.random.default_rng(seed)
    mesh_map = MeshMap.from_heights(rng.uniform(0.0, 0.05, (25, 25)), 0.2, 0.2)
    paint(mesh_map, lambda v: np.where(rng.random(len(v)) < 0.3, np.inf, 0.0))
    graph, planner = make_plugin(DijkstraPlanner, mesh_map), make_plugin(planner_class, mesh_map)
    found = 0
    for _ in range(20):
        start, goal = (Pose((*end, 0.02)) for end in rng.uniform(0.1, 4.7, (2, 2)))
        expected, answer = (one.make_plan(PlanRequest(start, goal)) for one in (graph, planner))
        assert answer.outcome == expected.outcome, f"{start.position} {goal.position}: {answer.message}"
        if answer.success:
            found += 1
            if answer.message:  # else the way over whole faces, even if it is the longer one
                assert answer.path.length <= 1.02 * expected.path.length
            assert mesh_map.locate(answer.path.positions[:-1]).distances.max() < 0.1
    assert found > 2
