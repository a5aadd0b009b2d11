"""Curves of a car, and the planner built on them."""

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from mbf_abstract.cancel import CancelToken
from mbf_abstract.geometry import Pose, normalize_angle
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import PlanRequest
from mbf_costmap_nav.footprint import Footprint
from mbf_costmap_nav.kernels.car_curves import car_curve, sample_word
from mbf_costmap_nav.planners.hybrid_astar import HybridAStarPlanner

coordinates, angles = st.floats(-6, 6), st.floats(-math.pi, math.pi)
CAR = Footprint([[0.4, 0.2], [-0.2, 0.2], [-0.2, -0.2], [0.4, -0.2]])


def plan(planner, start, goal, **request):
    return planner.make_plan(PlanRequest(Pose.planar(*start), Pose.planar(*goal), **request))


@settings(max_examples=200, deadline=None)
@given(x=coordinates, y=coordinates, yaw=angles, reversing=st.booleans())
@example(x=0.0, y=0.0, yaw=5e-324, reversing=False)
def test_every_curve_ends_at_its_pose(x, y, yaw, reversing):
    word = car_curve(x, y, yaw, reversing)
    poses = sample_word(0.0, 0.0, 0.0, word, 1.0, 0.1)
    end = poses[-1] if len(poses) else np.zeros(3)
    assert end[:2] == pytest.approx((x, y), abs=1e-6)
    assert abs(normalize_angle(end[2] - yaw)) < 1e-6
    assert reversing or (word[:, 1] >= 0.0).all()


@settings(max_examples=100, deadline=None)
@given(x=coordinates, y=coordinates, yaw=angles)
def test_reversing_never_makes_a_curve_longer(x, y, yaw):
    forward, both = (np.abs(car_curve(x, y, yaw, reversing)[:, 1]).sum() for reversing in (False, True))
    assert math.hypot(x, y) - 1e-9 <= both <= forward + 1e-6


def length_of(x, y, yaw):
    return np.abs(car_curve(x, y, yaw, True)[:, 1]).sum()


@settings(max_examples=200, deadline=None)
@given(x=coordinates, y=coordinates, yaw=angles)
def test_a_reeds_shepp_curve_is_as_long_mirrored_reversed_and_driven_the_other_way_round(x, y, yaw):
    length = length_of(x, y, yaw)
    assert length_of(x, -y, -yaw) == pytest.approx(length, abs=1e-7)
    assert length_of(-x, y, -yaw) == pytest.approx(length, abs=1e-7)
    back_x, back_y = -x * math.cos(yaw) - y * math.sin(yaw), x * math.sin(yaw) - y * math.cos(yaw)
    assert length_of(back_x, back_y, -yaw) == pytest.approx(length, abs=1e-7)


@settings(max_examples=200, deadline=None)
@given(x=coordinates, y=coordinates, yaw=angles, data=st.data())
def test_no_detour_over_a_third_pose_shortens_a_reeds_shepp_curve(x, y, yaw, data):
    """What a shortest length must obey; with families missing some detour is shorter (it was 0.4 radii for parking)."""
    u, v, turn = data.draw(coordinates), data.draw(coordinates), data.draw(angles)
    c, s = math.cos(turn), math.sin(turn)
    onward = length_of(c * (x - u) + s * (y - v), c * (y - v) - s * (x - u), yaw - turn)
    assert length_of(x, y, yaw) <= length_of(u, v, turn) + onward + 1e-6


@pytest.mark.parametrize(
    ("pose", "length"),
    [((4, 0, 0), 4.0), ((0, 2, math.pi), math.pi), ((1, 1, math.pi / 2), math.pi / 2), ((-4, 0, 0), 2 * math.pi + 4)],
)
def test_known_dubins_lengths(pose, length):
    assert np.abs(car_curve(*map(float, pose), False)[:, 1]).sum() == pytest.approx(length)


def test_f169_a_goal_straight_behind_is_reached_by_reversing(make_plugin):
    planner = make_plugin(HybridAStarPlanner, np.zeros((100, 100)), resolution=0.1)
    result = plan(planner, (8.0, 5.0, 0.0), (2.0, 5.0, 0.0))
    assert result.success
    assert max(abs(pose.yaw) for pose in result.path) < 1e-3


def test_the_path_around_a_block_is_drivable_and_free(make_plugin, closed_loop):
    cells = np.zeros((100, 100), dtype=np.uint8)
    cells[40:61, 40:61] = 254
    planner = make_plugin(
        HybridAStarPlanner, cells, resolution=0.1, footprint=CAR, allow_reversing=False, min_turning_radius=0.8
    )
    result = plan(planner, (1.0, 1.0, 0.0), (8.0, 8.0, math.radians(200)))
    points = result.path.positions[:, :2]
    yaws = np.unwrap([pose.yaw for pose in result.path])
    steps = np.hypot(*np.diff(points, axis=0).T)
    assert result.success and (result.path[-1].x, result.path[-1].y) == pytest.approx((8.0, 8.0))
    assert normalize_angle(result.path[len(result.path) - 1].yaw - math.radians(200)) == pytest.approx(0.0, abs=1e-6)
    assert (np.abs(np.diff(yaws)) <= steps / 0.8 * 1.02 + 1e-6).all()
    costmap = planner.costmap.snapshot()
    states = np.column_stack([points, yaws])
    assert not any(closed_loop.lethal_under(costmap, CAR.vertices, state) for state in states)


def test_the_goal_tolerance_moves_a_goal_that_does_not_fit(make_plugin):
    cells = np.zeros((60, 60), dtype=np.uint8)
    cells[25:30, 40:45] = 254
    planner = make_plugin(HybridAStarPlanner, cells, resolution=0.1)
    assert plan(planner, (1, 2.75, 0), (4.25, 2.75, 0)).outcome == GetPathOutcome.BLOCKED_GOAL
    result = plan(planner, (1, 2.75, 0), (4.25, 2.75, 0), dist_tolerance=1.0)
    assert result.success and result.path[-1].distance_to(Pose.planar(4.25, 2.75)) <= 1.0


def test_start_walls_and_cancel_are_told(make_plugin):
    cells = np.zeros((60, 60), dtype=np.uint8)
    cells[:, 30] = 254
    planner = make_plugin(HybridAStarPlanner, cells, resolution=0.1)
    token = CancelToken()
    token.cancel()
    assert plan(planner, (3.0, 3.0, 0), (1, 1, 0)).outcome == GetPathOutcome.BLOCKED_START
    assert plan(planner, (1, 1, 0), (5, 5, 0)).outcome == GetPathOutcome.NO_PATH_FOUND
    assert plan(planner, (1, 1, 0), (2, 2, 0), cancel_token=token).outcome == GetPathOutcome.CANCELED
    assert plan(planner, (1, 1, 0), (9, 2, 0)).outcome == GetPathOutcome.OUT_OF_MAP
