"""The relax recovery widens for a time what planning and driving insist on; the clock alone takes it back."""

import math

import numpy as np
import pytest

from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.maps.relaxation import NO_SLACK, Relaxation, Slack
from mbf_abstract.navigator import Navigator
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome
from mbf_abstract.plugins import ControlRequest, PluginKind
from mbf_abstract.testing.loopback import LoopbackRobot
from mbf_abstract.time.sim_clock import SimClock
from mbf_costmap_nav.controllers.regulated_pure_pursuit import RegulatedPurePursuitController

CONFIG = """
backend: costmap
planner_max_retries: 0
shutdown_costmaps: true
planners: [{name: astar, type: astar}]
controllers: [{name: pursuit, type: regulated_pure_pursuit}]
recovery_behaviors: [{name: relax, type: relax}]
relax: {planner_tolerance: 1.5, dist_tolerance: 0.6, angle_tolerance: 3.2, duration: 10.0}
global_costmap: &map
  width: 10.0
  height: 10.0
  origin_x: -5.0
  origin_y: -5.0
  robot_radius: 0.2
  layers: [{name: keepout, type: keepout}, {name: inflation, type: inflation}]
  keepout: {zones: [{name: box, polygon: [[2.0, 2.0], [3.0, 2.0], [3.0, 3.0], [2.0, 3.0]]}]}
  inflation: {inflation_radius: 1.0, cost_scaling_factor: 1.0}
local_costmap: *map
"""
IN_THE_BOX = Pose.planar(2.5, 2.5)
BESIDE_THE_BOX = Pose.planar(1.2, 2.5)


@pytest.fixture
def server(tmp_path):
    """A server on simulated time whose robot stands at the origin."""
    file = tmp_path / "relax.yaml"
    file.write_text(CONFIG)
    clock, transforms = SimClock(), TransformBuffer()
    robot = LoopbackRobot(clock, transforms, Pose.planar(0.0, 0.0))
    with Navigator.from_file(file, robot, clock, transforms) as navigator:
        clock.sleep(0.5)
        yield navigator
    robot.close()


def sleep(navigator, seconds):
    navigator.server.runtime.clock.sleep(seconds)


def cost_beside_the_box(navigator):
    return navigator.server.queries.check_point(BESIDE_THE_BOX).cost


def test_the_planner_may_end_near_a_blocked_goal_until_the_time_is_over(server):
    assert server.get_path(IN_THE_BOX).outcome == GetPathOutcome.BLOCKED_GOAL
    assert server.recover("relax").success
    assert server.get_path(IN_THE_BOX).success
    sleep(server, 10.0)
    assert server.get_path(IN_THE_BOX).outcome == GetPathOutcome.BLOCKED_GOAL


def test_the_inflation_comes_back_although_the_maps_stood_still_and_the_plugin_is_gone(server):
    before = cost_beside_the_box(server)
    assert server.recover("relax").success
    assert cost_beside_the_box(server) < before
    server.cancel_all()
    server.server.unload_plugin(PluginKind.RECOVERY, "relax")
    sleep(server, 5.0)
    assert cost_beside_the_box(server) < before
    sleep(server, 5.0)
    assert cost_beside_the_box(server) == before
    assert server.get_path(IN_THE_BOX).outcome == GetPathOutcome.BLOCKED_GOAL


def test_relaxing_again_prolongs_it(server):
    before = cost_beside_the_box(server)
    for _ in range(2):
        assert server.recover("relax").success
        sleep(server, 6.0)
    assert cost_beside_the_box(server) < before and server.get_path(IN_THE_BOX).success


def test_arrival_is_wider_until_the_time_is_over(server):
    path = Path.from_points([(0.0, 0.0, 0.0), (-1.0, 0.0, 0.0), (-2.0, 0.0, 0.0)])
    assert server.recover("relax").success
    early = server.exe_path(path)
    assert early.success and 0.3 < early.dist_to_goal <= 0.6
    sleep(server, 10.0)
    late = server.exe_path(path)
    assert late.success and late.dist_to_goal <= 0.1


def test_a_controller_tolerates_twice_the_distance_from_its_path_while_relaxed(make_plugin):
    controller = make_plugin(RegulatedPurePursuitController, np.zeros((60, 60)), resolution=0.1, max_path_distance=0.5)
    controller.set_plan(Path.from_points([(1.0, 2.0, 0.0), (5.0, 2.0, 0.0)]))
    request = ControlRequest(Pose.planar(2.0, 2.8), Twist())
    outcomes = []
    for time in (0.0, 1.0, 6.0):
        controller.clock.time = time
        outcomes.append(controller.compute_velocity_commands(request).outcome)
        controller.relaxation.grant("relax", Slack(controller_factor=2.0), until=5.0)
    assert outcomes == [ExePathOutcome.MISSED_PATH, ExePathOutcome.SUCCESS, ExePathOutcome.MISSED_PATH]


def test_a_controller_looks_half_as_far_ahead_for_obstacles_while_relaxed(make_plugin):
    cells = np.zeros((60, 60))
    cells[:, 28:30] = 254  # a wall 0.4 m before the front of the robot, which drives 0.5 m in a second
    controller = make_plugin(RegulatedPurePursuitController, cells, resolution=0.1, check_ahead_time=1.0)
    controller.set_plan(Path.from_points([(1.0, 2.0, 0.0), (5.0, 2.0, 0.0)]))
    request = ControlRequest(Pose.planar(2.2, 2.0), Twist.planar(0.5))
    assert controller.compute_velocity_commands(request).outcome == ExePathOutcome.BLOCKED_PATH
    controller.relaxation.grant("relax", Slack(controller_factor=2.0), until=5.0)
    assert controller.compute_velocity_commands(request).success


def test_the_widest_of_all_grants_that_have_not_ended_counts():
    relaxation = Relaxation()
    relaxation.grant("planner", Slack(plan_distance=0.5), until=2.0)
    relaxation.grant("controller", Slack(plan_distance=0.1, arrival_angle=1.0), until=4.0)
    assert relaxation.slack(1.0) == Slack(plan_distance=0.5, arrival_angle=1.0)
    assert relaxation.slack(2.0) == Slack(plan_distance=0.1, arrival_angle=1.0)
    assert relaxation.slack(4.0) == NO_SLACK


@pytest.mark.parametrize("wrong", [{"controller_factor": 0.5}, {"plan_distance": -0.1}, {"arrival_angle": math.nan}])
def test_slack_never_makes_anything_stricter(wrong):
    with pytest.raises(ValueError, match="slack"):
        Slack(**wrong)
