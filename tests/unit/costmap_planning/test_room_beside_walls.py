"""A long robot that stands close beside a wall gets away on a path that its inscribed circle fits on."""

import math

import pytest

from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.geometry.arcs import arc_poses
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.plugins import ControlRequest
from mbf_costmap_nav.controllers.regulated_pure_pursuit import RegulatedPurePursuitController
from mbf_costmap_nav.grid.footprint_check import FootprintCheck
from unit.costmap_planning.long_robot import LONG_ROBOT, RESOLUTION, walled

PERIOD = 0.05


def drive(controller, costmap, pose, path, seconds=40.0):
    """Follow a path without inertia; the end, the last outcome, and the poses where the outline touched something."""
    assert controller.set_plan(path)
    check, velocity, touched = FootprintCheck(LONG_ROBOT, RESOLUTION), Twist(), []
    outcome = ExePathOutcome.SUCCESS
    for _ in range(round(seconds / PERIOD)):
        if controller.is_goal_reached(pose, 0.15, math.pi):
            break
        result = controller.compute_velocity_commands(ControlRequest(pose, velocity))
        outcome, velocity = result.outcome, result.command or Twist()
        state = arc_poses((pose.x, pose.y, pose.yaw), velocity.vx, 0.0, velocity.wz, PERIOD, PERIOD)[-1]
        pose = Pose.planar(*state.tolist())
        if check.collides(costmap, *state.tolist()):
            touched.append(pose)
    return pose, outcome, touched


WALL_ON_THE_RIGHT = (-5.0, 5.0, -0.6, -0.4)  # 7 cm beside the outline of a robot at the origin


@pytest.mark.parametrize("bend", [0.3, 0.45, 0.6], ids=lambda bend: f"{bend} rad")
@pytest.mark.parametrize("post_at", [-0.5, -0.3, 0.2], ids=lambda x: f"post at {x} m")
def test_a_path_away_from_a_wall_is_driven_although_the_rear_would_swing_into_it(make_plugin, bend, post_at):
    costmap = walled(WALL_ON_THE_RIGHT, (post_at, post_at + 0.1, -0.45, -0.35))
    path = Path.from_points([(0, 0, 0), (0.1, 0, 0), (3 * math.cos(bend), 3 * math.sin(bend), 0)])
    controller = make_plugin(RegulatedPurePursuitController, costmap, footprint=LONG_ROBOT)
    end, outcome, touched = drive(controller, costmap, Pose.planar(0, 0), path)
    assert touched == [] and outcome == ExePathOutcome.SUCCESS
    assert math.dist((end.x, end.y), path.positions[-1][:2]) <= 0.15


def test_without_room_to_make_it_stands_as_before(make_plugin):
    costmap = walled(WALL_ON_THE_RIGHT, (-0.3, -0.2, -0.45, -0.35))
    path = Path.from_points([(0, 0, 0), (0.1, 0, 0), (3 * math.cos(0.6), 3 * math.sin(0.6), 0)])
    controller = make_plugin(RegulatedPurePursuitController, costmap, footprint=LONG_ROBOT, make_room_dist=0.0)
    end, outcome, _ = drive(controller, costmap, Pose.planar(0, 0), path, seconds=5.0)
    assert outcome == ExePathOutcome.BLOCKED_PATH and math.hypot(end.x, end.y) < 0.3


def test_a_boxed_in_robot_stands_and_says_why(make_plugin):
    costmap = walled((0.5, 0.6, -0.5, 0.5), (-0.6, -0.5, -0.5, 0.5), (-0.6, 0.6, 0.4, 0.5), (-0.6, 0.6, -0.5, -0.4))
    controller = make_plugin(RegulatedPurePursuitController, costmap, footprint=LONG_ROBOT, allow_reversing=False)
    end, outcome, touched = drive(controller, costmap, Pose.planar(0, 0), Path.from_points([(0, 0, 0), (-2.5, 0, 0)]))
    assert touched == [] and outcome == ExePathOutcome.BLOCKED_PATH and math.hypot(end.x, end.y) < 0.2
