"""One robot, one clock, one process: a costmap server and a mesh server side by side behind the same interface."""

import contextlib

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

SPOT = "[[2.8, 2.8], [3.2, 2.8], [3.2, 3.2], [2.8, 3.2]]"
CONFIGS = {
    "mesh": """
backend: mesh
dist_tolerance: 0.6
mesh_map: {mesh_file: floor.ply, layers: [{name: area, type: keepout}], area: {regions: [{polygon: SPOT}]}}
planners: [{name: shortest, type: dijkstra}]
""",
    "costmap": """
backend: costmap
dist_tolerance: 0.6
global_costmap:
  width: 4.0
  height: 4.0
  robot_radius: 0.2
  layers: [{name: area, type: keepout}]
  area: {zones: [{name: spot, polygon: SPOT}]}
local_costmap: {width: 4.0, height: 4.0, robot_radius: 0.2, layers: [{name: area, type: keepout}], area: {zones: []}}
planners: [{name: shortest, type: dijkstra}]
""",
}


@pytest.fixture
def navigators(tmp_path):
    """Navigators of a robot at (1, 1) by backend; both maps have a blocked spot of 0.4 m x 0.4 m at (3, 3)."""
    trimesh.Trimesh(*heightfield_mesh(np.zeros((21, 21)), 0.2, 0.2), process=False).export(tmp_path / "floor.ply")
    clock, transforms = SimClock(), TransformBuffer()
    robot = LoopbackRobot(clock, transforms, Pose.planar(1.0, 1.0))
    with contextlib.ExitStack() as stack:
        made = {}
        for backend, config in CONFIGS.items():
            (tmp_path / f"{backend}.yaml").write_text(config.replace("SPOT", SPOT))
            navigator = Navigator.from_file(tmp_path / f"{backend}.yaml", robot, clock, transforms)
            made[backend] = stack.enter_context(navigator)
        clock.sleep(0.5)
        yield made
    robot.close()


def test_the_same_goal_is_planned_on_both_maps_by_two_servers_of_one_robot(navigators):
    goal = Pose.planar(3.0, 2.0)
    found = {backend: navigator.get_path(goal, planner="shortest") for backend, navigator in navigators.items()}
    assert {backend: result.success for backend, result in found.items()} == {"mesh": True, "costmap": True}
    for result in found.values():
        assert result.path[-1].distance_to(goal) < 0.1
        assert result.path.length < 3.1  # along edges at worst


@pytest.mark.parametrize("backend", ["mesh", "costmap"])
def test_the_configured_tolerance_lets_a_plan_end_beside_a_blocked_goal(navigators, backend):
    goal = Pose.planar(3.02, 3.02)
    exact = navigators[backend].get_path(goal, dist_tolerance=0.0)
    assert exact.plugin_outcome == GetPathOutcome.BLOCKED_GOAL
    beside = navigators[backend].get_path(goal)
    assert beside.success, beside.message
    assert 0.1 < beside.path[-1].distance_to(goal) <= 0.6
    assert "from the goal" in beside.message
