"""Fault table, row 27: plugins that write into what they were handed: maps, layers, requests, paths.

Everything a plugin gets is read-only or its own copy, so an attempt raises in the plugin, which is row 1. That no
installed plugin tries is checked by the contract suite (tests/contract).
"""

import dataclasses

import numpy as np
import pytest
import trimesh

from mbf_abstract.config.configuration import PluginSpec
from mbf_abstract.geometry import Path, Pose
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.goals.goal_types import ExePathGoal
from mbf_abstract.navigator import Navigator
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome
from mbf_abstract.plugins import PluginKind
from mbf_abstract.testing.loopback import LoopbackRobot
from mbf_abstract.testing.scripted import straight_plan
from mbf_abstract.testing.scripted_session import ScriptedSession
from mbf_abstract.time.sim_clock import SimClock
from mbf_costmap_nav.plugins import CostmapPlanner
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh
from mbf_mesh_nav.plugins import MeshPlanner
from promises import assert_next_goals_work, assert_stops

CONFIGS = {
    "mesh": """
backend: mesh
mesh_map: {mesh_file: floor.ply, layers: [{name: border, type: border}]}
planners: [{name: good, type: dijkstra}]
planner_max_retries: 0
""",
    "costmap": """
backend: costmap
global_costmap: {width: 4.0, height: 4.0, layers: [{name: area, type: keepout}], area: {zones: []}}
local_costmap: {width: 4.0, height: 4.0, layers: [{name: area, type: keepout}], area: {zones: []}}
planners: [{name: good, type: dijkstra}]
planner_max_retries: 0
""",
}
MESH_ARRAYS = (
    "vertices faces vertex_normals face_normals edges neighbour_offsets neighbours neighbour_lengths "
    "vertex_face_offsets vertex_faces face_neighbours components input_to_internal internal_to_input"
).split()


class MeshVandal(MeshPlanner):
    """Overwrites the array of the mesh map that the test names."""

    target = ""

    def make_plan(self, request):
        holder = self.mesh_map if hasattr(self.mesh_map, self.target) else self.mesh_map.snapshot()
        if self.target in ("border.costs", "border.lethal"):
            holder = self.mesh_map.layers["border"]
        getattr(holder, self.target.rpartition(".")[2])[...] = 0
        return straight_plan(request)


class CostmapVandal(CostmapPlanner):
    """Overwrites a costmap's snapshot."""

    target = ""

    def make_plan(self, request):
        getattr(self, self.target).snapshot().cells[...] = 0
        return straight_plan(request)


@pytest.fixture
def navigator(backend, tmp_path):
    """A robot on an empty floor of 4 m x 4 m."""
    vertices, faces = heightfield_mesh(np.zeros((21, 21)), 0.2, 0.2)
    trimesh.Trimesh(vertices, faces, process=False).export(tmp_path / "floor.ply")
    (tmp_path / "robot.yaml").write_text(CONFIGS[backend])
    clock, transforms = SimClock(), TransformBuffer()
    robot = LoopbackRobot(clock, transforms, Pose.planar(1.0, 1.0))
    with Navigator.from_file(tmp_path / "robot.yaml", robot, clock, transforms) as made:
        clock.sleep(0.5)
        yield made
    robot.close()


TARGETS = [
    *(("mesh", name) for name in MESH_ARRAYS),
    *(("mesh", name) for name in ("costs", "lethal", "edge_weights", "border.costs", "border.lethal")),
    *(("costmap", name) for name in ("global_costmap", "local_costmap", "costmap")),
]


@pytest.mark.parametrize(("backend", "target"), TARGETS)
def test_a_planner_that_writes_into_the_map_fails_and_the_map_stays_as_it_was(navigator, backend, target):
    vandal = MeshVandal if backend == "mesh" else CostmapVandal
    spec = PluginSpec(PluginKind.PLANNER, "vandal", vandal.__name__, vandal, vandal.Parameters())
    navigator.server.load_plugin(spec)
    navigator.server.plugins.find(PluginKind.PLANNER, "vandal").instance.target = target
    before = navigator.get_path(Pose.planar(3.0, 2.6), planner="good")
    assert before.success

    result = navigator.get_path(Pose.planar(3.0, 2.6), planner="vandal")

    assert result.outcome == GetPathOutcome.INTERNAL_ERROR
    assert "raised ValueError in make_plan: assignment destination is read-only" in result.message
    after = navigator.get_path(Pose.planar(3.0, 2.6), planner="good")
    assert np.array_equal(after.path.positions, before.path.positions)
    assert after.cost == before.cost


def test_a_controller_that_writes_into_its_path_stops_the_robot_and_the_senders_path_stays_as_it_was():
    with ScriptedSession() as session:
        path = session.path_to(5.0)
        before = path.positions.copy()

        def bend(request):
            session.controller.paths[-1].positions[:, 1] += 1.0

        session.controller.play(bend)
        result = session.navigator.send(ExePathGoal(path)).wait()
        assert result.outcome == ExePathOutcome.INTERNAL_ERROR
        assert "read-only" in result.message
        assert_stops(session, session.clock.now())
        assert np.array_equal(path.positions, before)
        assert_next_goals_work(session)


def test_a_planner_that_changes_its_request_fails():
    with ScriptedSession() as session:

        def move_the_goal(request):
            request.goal = Pose.planar(0.0, 0.0)

        session.planner.play(move_the_goal)
        result = session.navigator.get_path(Pose.planar(3.0, 0.0))
        assert result.outcome == GetPathOutcome.INTERNAL_ERROR
        assert dataclasses.FrozenInstanceError.__name__ in result.message
        assert_next_goals_work(session)


def test_a_path_does_not_change_with_the_arrays_it_was_made_of():
    points = np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)])
    path = Path.from_points(points)
    points[:] = 9.0
    assert path.positions.tolist() == [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]
