"""Curves of a car, and the planner built on them."""

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from mbf_abstract.geometry import Pose, normalize_angle
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import PlanRequest
from mbf_abstract.time.cancel import CancelToken
from mbf_costmap_nav.grid.costmap import Costmap
from mbf_costmap_nav.grid.footprint import Footprint
from mbf_costmap_nav.kernels.car.curves import car_curve, sample_word
from mbf_costmap_nav.kernels.search.nearest_cell import nearest_reached
from mbf_costmap_nav.planners.hybrid_astar import HybridAStarPlanner
from tests.unit.costmap_planning.conftest import plan

coordinates, angles = st.floats(-6, 6), st.floats(-math.pi, math.pi)
CAR = Footprint([[0.4, 0.2], [-0.2, 0.2], [-0.2, -0.2], [0.4, -0.2]])


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


def test_start_walls_and_cancel_are_reported(make_plugin):
    cells = np.zeros((60, 60), dtype=np.uint8)
    cells[:, 30] = 254
    planner = make_plugin(HybridAStarPlanner, cells, resolution=0.1)
    token = CancelToken()
    token.cancel()
    assert plan(planner, (3.0, 3.0, 0), (1, 1, 0)).outcome == GetPathOutcome.BLOCKED_START
    assert plan(planner, (1, 1, 0), (5, 5, 0)).outcome == GetPathOutcome.NO_PATH_FOUND
    assert plan(planner, (1, 1, 0), (2, 2, 0), cancel_token=token).outcome == GetPathOutcome.CANCELED
    assert plan(planner, (1, 1, 0), (9, 2, 0)).outcome == GetPathOutcome.OUT_OF_MAP


def test_a_goal_whose_outline_hangs_over_the_border_says_so(make_plugin):
    planner = make_plugin(HybridAStarPlanner, np.zeros((60, 60), dtype=np.uint8), resolution=0.1, footprint=CAR)
    result = plan(planner, (3, 3, 0), (5.7, 3, 0))
    assert result.outcome == GetPathOutcome.BLOCKED_GOAL
    assert result.message.endswith("(5.70, 3.00, 0.00 rad): part of its outline would be off the map")
    assert result.permanent
    assert plan(planner, (3, 3, 0), (5.7, 3, math.pi)).success


def test_a_tolerance_that_leads_off_the_border_is_no_permanent_failure(make_plugin):
    planner = make_plugin(HybridAStarPlanner, np.zeros((60, 60), dtype=np.uint8), resolution=0.1, footprint=CAR)
    tight = plan(planner, (3, 3, 0), (5.9, 3, 0), dist_tolerance=0.1)
    assert (tight.outcome, tight.permanent) == (GetPathOutcome.BLOCKED_GOAL, True)
    assert "no place within 0.10 m" in tight.message and tight.message.endswith("would be off the map")
    assert plan(planner, (3, 3, 0), (5.7, 3, 0), dist_tolerance=1.5).success


@pytest.mark.parametrize("radius", [4.0, 12.0, 20.0])
def test_a_large_turning_circle_does_not_lead_through_a_wall(make_plugin, radius):
    cells = np.zeros((200, 200), dtype=np.uint8)
    cells[:, 100] = 254
    planner = make_plugin(HybridAStarPlanner, cells, resolution=0.1, min_turning_radius=radius, max_states=20000)
    assert not plan(planner, (5.0, 5.0, 0.0), (15.0, 5.0, 0.0)).success


@pytest.mark.parametrize("radius", [0.5, 3.0])
def test_the_path_is_free_between_its_poses_too_and_they_are_a_cell_apart(make_plugin, closed_loop, radius):
    cells = np.zeros((200, 200), dtype=np.uint8)
    cells[:120, 100] = 254
    grid = Costmap(closed_loop.inflated(cells, 0.1, 0.2, 0.6), 0.1)
    result = plan(make_plugin(HybridAStarPlanner, grid, min_turning_radius=radius), (5, 5, 0.0), (15, 5, 0.0))
    steps = np.hypot(*np.diff(result.path.positions[:, :2], axis=0).T)
    assert result.success and steps.max() <= 0.1 + 1e-9
    states = [(pose.x, pose.y, pose.yaw) for pose in result.path]
    vertices = 0.999 * np.array([[0.2, 0.2], [-0.2, 0.2], [-0.2, -0.2], [0.2, -0.2]])
    assert not any(closed_loop.lethal_under(grid, vertices, state) for state in states)


@settings(max_examples=100, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    goal=st.tuples(st.floats(-2.0, 3.0), st.floats(-2.0, 3.0)),
    tolerance=st.one_of(st.floats(0.0, 4.0), st.just(math.inf)),
)
def test_the_nearest_reached_cell_is_the_one_a_look_at_all_cells_finds(seed, goal, tolerance):
    rng = np.random.default_rng(seed)
    height, width = rng.integers(1, 12, 2)
    g = rng.choice(np.array([1.0, 2.0, np.inf, np.inf], dtype=np.float32), (height + 2, width + 2))
    cells = np.zeros((height, width), dtype=np.uint8)
    geometry, wanted = np.array([0.2, -0.4, 0.3]), np.array([*goal, 0.0])
    found = nearest_reached(
        g.reshape(-1), cells, 252, geometry, np.zeros((0, 2)), wanted, tolerance, np.zeros(1, dtype=np.uint8)
    )
    iy, ix = np.nonzero(np.isfinite(g[1:-1, 1:-1]))
    distances = np.hypot(-0.4 + (ix + 0.5) * 0.2 - goal[0], 0.3 + (iy + 0.5) * 0.2 - goal[1])
    if not (distances <= tolerance).any():
        assert found == (-1, -1)
        return
    best = np.flatnonzero(distances <= distances.min() + 1e-9)
    chosen = np.flatnonzero((ix == found[0]) & (iy == found[1]))[0]
    assert chosen in best
    assert g[1:-1, 1:-1][iy[chosen], ix[chosen]] == g[1:-1, 1:-1][iy[best], ix[best]].min()


def closet():
    """10 m x 10 m with a closed closet of 1.5 m in the middle."""
    cells = np.zeros((100, 100), dtype=np.uint8)
    cells[40:58, [40, 57]] = 254
    cells[[40, 57], 40:58] = 254
    return cells


def test_a_goal_behind_walls_is_replaced_by_the_nearest_reachable_place_within_the_tolerance(make_plugin):
    planner = make_plugin(HybridAStarPlanner, closet(), resolution=0.1)
    unreachable = plan(planner, (1, 5, 0), (4.9, 4.9, 0))
    assert unreachable.outcome == GetPathOutcome.NO_PATH_FOUND and "not even for a point robot" in unreachable.message
    assert plan(planner, (1, 5, 0), (4.9, 4.9, 0), dist_tolerance=0.5).outcome == GetPathOutcome.NO_PATH_FOUND
    result = plan(planner, (1, 5, 0), (4.9, 4.9, 0), dist_tolerance=2.0)
    assert result.success and "m from the goal (tolerance 2.00 m)" in result.message
    assert not 4.0 < result.path[-1].x < 5.8 or not 4.0 < result.path[-1].y < 5.8


def test_a_goal_in_a_thick_wall_ends_on_the_side_of_the_start(make_plugin):
    cells = np.zeros((100, 100), dtype=np.uint8)
    cells[:, 50:56] = 254
    result = plan(make_plugin(HybridAStarPlanner, cells, resolution=0.1), (1, 5, 0), (5.4, 5, 0), dist_tolerance=2.0)
    assert result.success and result.path[-1].x < 5.0


def test_where_the_car_cannot_turn_round_the_nearest_state_of_the_goals_heading_will_do(make_plugin):
    corridor = np.full((12, 120), 254, dtype=np.uint8)
    corridor[2:10, 2:100] = 0
    corridor[2:10, 100:118] = 0
    planner = make_plugin(HybridAStarPlanner, corridor, resolution=0.1, min_turning_radius=2.0, allow_reversing=False)
    assert plan(planner, (6.0, 0.6, 0.0), (4.0, 0.6, 0.0)).outcome == GetPathOutcome.NO_PATH_FOUND
    result = plan(planner, (6.0, 0.6, 0.0), (4.0, 0.6, 0.0), dist_tolerance=2.5)
    assert result.success and result.path[-1].distance_to(Pose.planar(4.0, 0.6)) <= 2.5
    assert abs(result.path[len(result.path) - 1].yaw) <= math.pi / 72


def test_giving_up_differs_from_having_tried_everything(make_plugin):
    cells = closet()
    cells[48, 57] = 0  # a hole that only a point gets through
    tired = plan(make_plugin(HybridAStarPlanner, cells, resolution=0.1, max_states=500), (1, 5, 0), (4.9, 4.9, 0))
    assert tired.outcome == GetPathOutcome.NO_PATH_FOUND and "see max_states" in tired.message
    corridor = np.full((12, 120), 254, dtype=np.uint8)
    corridor[2:10, 2:118] = 0
    forward = make_plugin(HybridAStarPlanner, corridor, resolution=0.1, min_turning_radius=2.0, allow_reversing=False)
    done = plan(forward, (6.0, 0.6, 0.0), (4.0, 0.6, 0.0))
    assert done.outcome == GetPathOutcome.NO_PATH_FOUND and "states were tried" in done.message


def test_unknown_ground_is_driven_unless_it_is_not_allowed(make_plugin):
    cells = np.zeros((60, 60), dtype=np.uint8)
    cells[:, 25:35] = 255
    assert plan(make_plugin(HybridAStarPlanner, cells, resolution=0.1), (1, 3, 0), (5, 3, 0)).success
    careful = make_plugin(HybridAStarPlanner, cells, resolution=0.1, allow_unknown=False)
    assert plan(careful, (1, 3, 0), (5, 3, 0)).outcome == GetPathOutcome.NO_PATH_FOUND


def test_the_heights_of_start_and_goal_are_kept(make_plugin):
    planner = make_plugin(HybridAStarPlanner, np.zeros((60, 60)), resolution=0.1)
    start, goal = (Pose((x, 3.0, z), (0.0, 0.0, 0.0, 1.0)) for x, z in ((1.0, 5.0), (5.0, 6.0)))
    heights = planner.make_plan(PlanRequest(start, goal)).path.positions[:, 2]
    assert (heights[0], heights[-1]) == (5.0, 6.0) and (np.diff(heights) > 0.0).all()


def office():
    """30 m x 20 m of rooms with doors of 1.2 m, and a car's inflation over the whole floor."""
    cells = np.zeros((200, 300), dtype=np.uint8)
    cells[[0, -1]] = cells[:, [0, -1]] = 254
    for number, x in enumerate(range(50, 300, 50)):
        cells[:, x] = 254
        door = 20 if number % 2 else 160
        cells[door : door + 12, x] = 0
    return cells


@pytest.mark.parametrize("goal", [(28.0, 3.0, 1.0), (28.0, 18.0, 3.1), (13.0, 18.5, 0.0)])
def test_an_ordinary_route_through_an_office_takes_few_states_although_all_cells_cost(make_plugin, closed_loop, goal):
    grid = Costmap(closed_loop.inflated(office(), 0.1, 0.2, 3.0, 1.0), 0.1)
    planner = make_plugin(HybridAStarPlanner, grid, footprint=CAR, min_turning_radius=1.0, max_states=20_000)
    result = plan(planner, (2.0, 2.0, -2.0), goal)
    assert result.success and (result.path[-1].x, result.path[-1].y) == pytest.approx(goal[:2])
    states = np.column_stack([result.path.positions[:, :2], [pose.yaw for pose in result.path]])
    assert not any(closed_loop.lethal_under(grid, 0.999 * CAR.vertices, state) for state in states)


def test_a_goal_in_a_closet_that_no_car_can_leave_is_found_by_the_few_states_around_it(make_plugin):
    cells = closet()
    cells[47:50, 57] = 0  # a point gets out, the car does not
    planner = make_plugin(HybridAStarPlanner, cells, resolution=0.1, footprint=CAR, max_states=200_000)
    result = plan(planner, (1, 5, 0), (4.9, 4.9, 0))
    assert result.outcome == GetPathOutcome.NO_PATH_FOUND and "no way there" in result.message
