"""One robot, one clock, one process: a costmap server and a mesh server side by side behind the same interface."""

import contextlib

import numpy as np
import trimesh

from mbf_abstract.geometry import Pose
from mbf_abstract.navigator import Navigator
from mbf_abstract.sim_clock import SimClock
from mbf_abstract.testing.loopback import LoopbackRobot
from mbf_abstract.transforms import TransformBuffer
from mbf_mesh_nav.heightfield_mesh import heightfield_mesh

CONFIGS = {
    "mesh": """
backend: mesh
mesh_map: {mesh_file: floor.ply, layers: [{name: border, type: border}]}
planners: [{name: shortest, type: dijkstra}]
""",
    "costmap": """
backend: costmap
global_costmap: {width: 4.0, height: 4.0, layers: [{name: area, type: keepout}], area: {zones: []}}
local_costmap: {width: 4.0, height: 4.0, layers: [{name: area, type: keepout}], area: {zones: []}}
planners: [{name: shortest, type: dijkstra}]
""",
}


def test_the_same_goal_is_planned_on_both_maps_by_two_servers_of_one_robot(tmp_path):
    trimesh.Trimesh(*heightfield_mesh(np.zeros((21, 21)), 0.2, 0.2), process=False).export(tmp_path / "floor.ply")
    clock, transforms = SimClock(), TransformBuffer()
    robot = LoopbackRobot(clock, transforms, Pose.planar(1.0, 1.0))
    goal = Pose.planar(3.0, 2.0)
    with contextlib.ExitStack() as stack:
        navigators = {}
        for backend, config in CONFIGS.items():
            (tmp_path / f"{backend}.yaml").write_text(config)
            made = Navigator.from_file(tmp_path / f"{backend}.yaml", robot, clock, transforms)
            navigators[backend] = stack.enter_context(made)
        clock.sleep(0.5)
        found = {backend: navigator.get_path(goal, planner="shortest") for backend, navigator in navigators.items()}
    robot.close()
    assert {backend: result.success for backend, result in found.items()} == {"mesh": True, "costmap": True}
    for result in found.values():
        assert result.path[-1].distance_to(goal) < 0.1
        assert result.path.length < 3.1  # along edges at worst
