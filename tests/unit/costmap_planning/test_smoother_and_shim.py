"""The path smoother and the rotation shim."""

import math

import numpy as np
import pytest

from mbf_abstract.cancel import CancelToken
from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.outcomes import RefinePathOutcome
from mbf_abstract.plugins import ControlRequest, PlanRequest
from mbf_costmap_nav.controllers.rotation_shim import RotationShimController
from mbf_costmap_nav.costmap import Costmap
from mbf_costmap_nav.planners.astar import AStarPlanner
from mbf_costmap_nav.refiners.smoother import SmootherRefiner, curvatures

CORNER = Path.from_points([(1, 1, 0), (4, 1, 0), (4, 4, 0)], final_orientation=Pose.planar(0, 0, 0.5).orientation)
FREE = Costmap(np.zeros((120, 120), dtype=np.uint8), 0.05)


def smooth(plugin, path, token=None):
    return plugin.apply_refinement(path, token or CancelToken())


def test_a_corner_is_rounded_and_the_ends_stay(make_plugin):
    result = smooth(make_plugin(SmootherRefiner, FREE), CORNER)
    assert result.success and result.path.length < CORNER.length
    assert result.path[0].position == CORNER[0].position
    last = len(result.path) - 1
    assert result.path[last].position == CORNER[2].position and result.path[last].yaw == pytest.approx(0.5)


def test_the_curvature_limit_is_kept(make_plugin):
    loose = smooth(make_plugin(SmootherRefiner, FREE), CORNER)
    strict = smooth(make_plugin(SmootherRefiner, FREE, max_curvature=1.0), CORNER)
    assert curvatures(loose.path.positions[:, :2]).max() > 1.0
    assert curvatures(strict.path.positions[:, :2]).max() <= 1.0


def test_a_curvature_that_cannot_be_reached_is_a_failure_that_says_where(make_plugin):
    result = smooth(make_plugin(SmootherRefiner, FREE, max_curvature=0.01), CORNER)
    assert result.outcome == RefinePathOutcome.FAILURE and "curvature" in result.message


def test_the_smoothed_path_keeps_off_obstacles(make_plugin, room):
    plan = make_plugin(AStarPlanner, room).make_plan(PlanRequest(Pose.planar(1, 1), Pose.planar(7, 1)))
    result = smooth(make_plugin(SmootherRefiner, room), plan.path)
    before = max(room.cost_at(*p[:2]) for p in plan.path.positions.tolist())
    after = max(room.cost_at(*p[:2]) for p in result.path.positions.tolist())
    assert result.success and after <= max(before, 200)
    assert np.sum(np.abs(np.diff(curvatures(result.path.positions[:, :2])))) < np.sum(
        np.abs(np.diff(curvatures(plan.path.positions[:, :2])))
    )


def test_a_cancelled_refinement_says_so(make_plugin):
    token = CancelToken()
    token.cancel()
    assert smooth(make_plugin(SmootherRefiner, FREE), CORNER, token).outcome == RefinePathOutcome.CANCELED


def test_a_path_with_reversing_is_left_alone(make_plugin):
    positions = np.array([[1, 1, 0], [2, 1, 0], [3, 1, 0], [2, 1, 0], [1, 1, 0]], dtype=float)
    path = Path(positions)
    assert smooth(make_plugin(SmootherRefiner, FREE), path).path is path


@pytest.fixture
def shim(make_plugin):
    inner = "mbf_costmap_nav.controllers.regulated_pure_pursuit:RegulatedPurePursuitController"
    return make_plugin(RotationShimController, FREE, inner_type=inner, inner={"rotate_to_heading": False})


def command_at(controller, yaw, velocity=None):
    return controller.compute_velocity_commands(ControlRequest(Pose.planar(1, 1, yaw), velocity or Twist())).command


def test_the_shim_turns_first_and_then_lets_the_inner_controller_drive(shim):
    shim.set_plan(CORNER)
    assert command_at(shim, math.pi / 2).vx == 0.0 and command_at(shim, math.pi / 2).wz < 0.0
    assert command_at(shim, 0.1).vx > 0.0
    assert command_at(shim, 1.5).vx > 0.0, "aligned once, it does not interfere again on the same path"


def test_the_shim_aligns_again_for_a_new_path(shim):
    shim.set_plan(CORNER)
    command_at(shim, 0.0)
    shim.set_plan(CORNER)
    assert command_at(shim, math.pi / 2).vx == 0.0


def test_the_shim_refuses_unknown_parameters_of_the_inner_controller(make_plugin):
    with pytest.raises(ValueError, match="no_such"):
        make_plugin(RotationShimController, FREE, inner={"no_such": 1})
