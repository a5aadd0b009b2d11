"""A goal area is reached with every controller of both maps: the robot stops inside, not just outside of it."""

import numpy as np
import pytest
import trimesh

from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.goals.goal_area import DiscArea, PolygonArea, PoseSetArea
from mbf_abstract.goals.goal_types import MoveBaseGoal
from mbf_abstract.navigator import Navigator
from mbf_abstract.testing.loopback import LoopbackRobot
from mbf_abstract.time.sim_clock import SimClock
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh

CONFIGS = {
    "costmap": """
backend: costmap
global_costmap: {width: 6.0, height: 6.0, robot_radius: 0.2, layers: []}
local_costmap: {width: 6.0, height: 6.0, robot_radius: 0.2, layers: []}
planners: [{name: planner, type: theta_star}]
controllers:
  - {name: pursuit, type: regulated_pure_pursuit}
  - {name: mppi, type: mppi}
  - {name: dwa, type: dwa}
  - {name: shim, type: rotation_shim}
mppi: {batch_size: 500}
shim: {inner_type: regulated_pure_pursuit}
""",
    "mesh": """
backend: mesh
mesh_map: {mesh_file: floor.ply, layers: []}
planners: [{name: planner, type: cvp}]
controllers:
  - {name: follower, type: path_follower}
  - {name: mppi, type: mppi}
  - {name: field, type: vector_field}
""",
}
CONTROLLERS = {"costmap": ["pursuit", "mppi", "dwa", "shim"], "mesh": ["follower", "mppi", "field"]}


def square(side, x=4.0, y=3.5):
    half = side / 2.0
    return PolygonArea(tuple((x + a * half, y + b * half, 0.0) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))))


AREAS = {
    "disc of 0.3 m": DiscArea(Pose.planar(4.0, 3.5), 0.3),
    "disc of 0.9 m": DiscArea(Pose.planar(4.0, 3.5), 0.9),
    "square of 0.4 m": square(0.4),
    "one of two poses": PoseSetArea((Pose.planar(4.0, 3.5, 2.0), Pose.planar(1.0, 5.0)), 0.05, 0.3),
}


def drive_to(tmp_path, backend, goal, **parameters):
    """Drive to a goal on a level floor of 6 m x 6 m; the result and the robot's last pose."""
    trimesh.Trimesh(*heightfield_mesh(np.zeros((31, 31)), 0.2, 0.2), process=False).export(tmp_path / "floor.ply")
    (tmp_path / "server.yaml").write_text(CONFIGS[backend])
    clock, transforms = SimClock(), TransformBuffer()
    robot = LoopbackRobot(clock, transforms, Pose.planar(1.0, 1.0))
    with Navigator.from_file(tmp_path / "server.yaml", robot, clock, transforms) as navigator:
        navigator.server.set_parameters(**parameters)
        clock.sleep(0.5)
        result = navigator.send(goal).wait(timeout=100.0)
    robot.close()
    return result, robot.pose


@pytest.mark.parametrize("area", AREAS.values(), ids=AREAS)
@pytest.mark.parametrize(("backend", "controller"), [(b, c) for b, names in CONTROLLERS.items() for c in names])
def test_a_robot_comes_to_stand_inside_the_area(tmp_path, backend, controller, area):
    goal = MoveBaseGoal(Pose.planar(0.0, 0.0), controller=controller, goal_area=area, recovery_behaviors=())
    result, pose = drive_to(tmp_path, backend, goal)
    assert result.success, result
    assert area.contains(pose)


@pytest.mark.parametrize("backend", CONFIGS)
@pytest.mark.parametrize("who_decides", ["the area", "the tolerances alone"])
def test_a_goal_given_above_the_floor_is_reached_below_it(tmp_path, backend, who_decides):
    above = Pose.planar(4.0, 3.5, z=0.3)
    area = DiscArea(above, 0.25) if who_decides == "the area" else None
    goal = MoveBaseGoal(above, goal_area=area, recovery_behaviors=())
    result, pose = drive_to(tmp_path, backend, goal, mbf_tolerance_exclusive=area is None)
    assert result.success, result
    assert pose.distance_to(Pose.planar(4.0, 3.5)) < 0.25
