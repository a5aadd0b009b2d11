"""Fault table, row 24: goals on a mesh that cannot be reached, or need no path at all."""

import numpy as np
import pytest
import trimesh

from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.navigator import Navigator
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.testing.loopback import LoopbackRobot
from mbf_abstract.time.sim_clock import SimClock
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh

CONFIG = """
backend: mesh
planner_max_retries: 0
planner_patience: 60.0
planners: [{name: astar, type: astar}, {name: dijkstra, type: dijkstra}, {name: cvp, type: cvp}]
mesh_map:
  mesh_file: two_floors.ply
  layers: [{name: slopes, type: steepness}]
  slopes: {threshold: 0.5}
"""
PLANNERS = ("astar", "dijkstra", "cvp")


@pytest.fixture
def navigator(tmp_path):
    """Two level floors of 4 x 4 m with a gap of 2 m between them; a block of 1 m stands on the first."""
    heights = np.zeros((21, 21))
    heights[8:13, 8:13] = 1.0
    vertices, faces = heightfield_mesh(heights, 0.2, 0.2)
    both = np.vstack([vertices, vertices + np.array([6.0, 0.0, 0.0])]), np.vstack([faces, faces + len(vertices)])
    trimesh.Trimesh(*both, process=False).export(tmp_path / "two_floors.ply")
    (tmp_path / "mesh.yaml").write_text(CONFIG)
    clock, transforms = SimClock(), TransformBuffer()
    robot = LoopbackRobot(clock, transforms, Pose.planar(0.45, 0.45))
    with Navigator.from_file(tmp_path / "mesh.yaml", robot, clock, transforms) as made:
        clock.sleep(0.1)
        yield made
    robot.close()


@pytest.mark.parametrize("planner", PLANNERS)
def test_a_goal_on_another_piece_names_both_pieces_at_once(navigator, planner):
    before = navigator.server.runtime.clock.now()
    result = navigator.get_path(Pose.planar(6.5, 0.5), planner=planner)
    assert result.outcome == GetPathOutcome.NO_PATH_FOUND
    assert result.message.count("component") >= 2 or "components" in result.message
    assert navigator.server.runtime.clock.now() == before, "no patience was spent"


@pytest.mark.parametrize("planner", PLANNERS)
def test_a_goal_on_a_wall_is_blocked_and_says_by_what(navigator, planner):
    result = navigator.get_path(Pose.planar(1.5, 2.0, z=0.5), planner=planner)
    assert result.outcome == GetPathOutcome.BLOCKED_GOAL
    assert "slopes" in result.message


@pytest.mark.parametrize("planner", PLANNERS)
def test_start_and_goal_in_one_face_give_a_path_of_both(navigator, planner):
    result = navigator.get_path(Pose.planar(0.47, 0.46, 1.0), planner=planner)
    assert result.success
    assert len(result.path) >= 2
    assert result.path[-1].yaw == pytest.approx(1.0, abs=1e-6)
    assert result.path.length < 0.1


@pytest.mark.parametrize("planner", PLANNERS)
def test_a_goal_off_the_surface_reports_the_distance(navigator, planner):
    result = navigator.get_path(Pose.planar(0.5, 0.5, z=1.2), planner=planner)
    assert result.outcome in (GetPathOutcome.OUT_OF_MAP, GetPathOutcome.INVALID_GOAL)
    assert "1.20 m" in result.message
