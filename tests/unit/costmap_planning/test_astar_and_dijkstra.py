"""The grid planners as a client sees them: outcomes, messages, exact ends, tolerance, via poses."""

import json
import math
import re

import numpy as np
import pytest

from mbf_abstract.geometry import Pose
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.time.cancel import CancelToken
from mbf_costmap_nav.grid.footprint import Footprint
from mbf_costmap_nav.planners.astar import AStarPlanner
from mbf_costmap_nav.planners.dijkstra import DijkstraPlanner
from mbf_costmap_nav.planners.straight_line import StraightLinePlanner
from mbf_costmap_nav.planners.theta_star import ThetaStarPlanner
from tests.unit.costmap_planning.conftest import plan

POINT_ROBOT = Footprint([])
PLANNERS = [AStarPlanner, DijkstraPlanner, ThetaStarPlanner]
CODES = {"o": 0, "u": 127, "i": 253, "x": 254, "n": 255}
# shortest octile length without | with corner cutting, from (1, 1) to (8, 8)
F171_LENGTHS = {
    "open_space": (9.8995, 9.8995),
    "bounded": (9.8995, 9.8995),
    "bottom_left_obstacle": (10.4853, 9.8995),
    "top_left_obstacle": (12.2426, 11.6569),
    "maze1": (14.0, 12.8284),
    "maze2": (14.0, 12.2426),
}


def grid(*rows):
    """Map drawn with the top row first: '.' free, '#' lethal, '?' unknown."""
    return np.array([[{".": 0, "#": 254, "?": 255}[c] for c in row] for row in reversed(rows)], dtype=np.uint8)


WALLED = grid(
    ".....#...",
    ".....#...",
    ".....#...",
)


@pytest.mark.parametrize("planner_class", PLANNERS)
def test_start_and_goal_poses_are_kept_exactly(make_plugin, planner_class):
    result = plan(make_plugin(planner_class, np.zeros((10, 10))), (1.2, 1.7, 0.5), (8.9, 8.1, -2.0))
    assert result.outcome == GetPathOutcome.SUCCESS
    assert (result.path[0].x, result.path[0].y) == (1.2, 1.7)
    assert result.path[0].yaw == pytest.approx(0.5)
    assert (result.path[-1].x, result.path[-1].y) == (8.9, 8.1)
    assert result.path[-1].yaw == pytest.approx(-2.0)


@pytest.mark.parametrize("planner_class", PLANNERS)
def test_start_and_goal_in_one_cell_give_two_poses(make_plugin, planner_class):
    result = plan(make_plugin(planner_class, np.zeros((4, 4))), (1.2, 1.2), (1.29, 1.2))
    assert result.success and len(result.path) == 2


@pytest.mark.parametrize("planner_class", PLANNERS)
@pytest.mark.parametrize(
    ("start", "goal", "outcome", "text"),
    [
        (
            (5.5, 1.5),
            (1.5, 1.5),
            GetPathOutcome.BLOCKED_START,
            r"start \(5.50, 1.50\) lies in cell \(5, 1\) of cost 254",
        ),
        ((1.5, 1.5), (5.5, 1.5), GetPathOutcome.BLOCKED_GOAL, r"goal \(5.50, 1.50\) lies in cell \(5, 1\) of cost 254"),
        ((1.5, 1.5), (7.5, 1.5), GetPathOutcome.NO_PATH_FOUND, "6.00 m away"),
        ((-1.0, 1.5), (7.5, 1.5), GetPathOutcome.OUT_OF_MAP, "start .* is outside"),
        ((1.5, 1.5), (7.5, 9.5), GetPathOutcome.OUT_OF_MAP, "goal .* is outside"),
    ],
)
def test_failures_say_what_and_where(make_plugin, planner_class, start, goal, outcome, text):
    result = plan(make_plugin(planner_class, WALLED), start, goal)
    assert result.outcome == outcome
    assert re.search(text, result.message), result.message


@pytest.mark.parametrize("planner_class", PLANNERS)
def test_goal_in_a_wall_is_replaced_by_the_nearest_reachable_cell(make_plugin, planner_class):
    result = plan(make_plugin(planner_class, WALLED), (1.5, 1.5), (5.6, 1.5), dist_tolerance=1.5)
    assert result.success
    assert (result.path[-1].x, result.path[-1].y) == (4.5, 1.5)
    assert "1.10 m from the goal" in result.message


@pytest.mark.parametrize("planner_class", PLANNERS)
def test_unreachable_free_goal_uses_the_tolerance_too(make_plugin, planner_class):
    result = plan(make_plugin(planner_class, WALLED), (1.5, 1.5), (6.5, 1.5), dist_tolerance=2.1)
    assert result.success and (result.path[-1].x, result.path[-1].y) == (4.5, 1.5)


@pytest.mark.parametrize("planner_class", PLANNERS)
def test_no_reachable_cell_within_the_tolerance_is_a_blocked_goal(make_plugin, planner_class):
    result = plan(make_plugin(planner_class, WALLED), (1.5, 1.5), (5.6, 1.5), dist_tolerance=0.5)
    assert result.outcome == GetPathOutcome.BLOCKED_GOAL


@pytest.mark.parametrize("planner_class", PLANNERS)
def test_via_poses_are_passed_in_order(make_plugin, planner_class):
    via = (Pose.planar(1.3, 8.2), Pose.planar(8.6, 8.7))
    result = plan(make_plugin(planner_class, np.zeros((10, 10))), (1.5, 1.5), (8.5, 1.5), via=via)
    points = [tuple(p) for p in result.path.positions[:, :2].tolist()]
    assert points.index((1.3, 8.2)) < points.index((8.6, 8.7))


@pytest.mark.parametrize("planner_class", PLANNERS)
def test_a_token_set_before_is_honoured(make_plugin, planner_class):
    token = CancelToken()
    token.cancel()
    result = plan(make_plugin(planner_class, np.zeros((10, 10))), (1.5, 1.5), (8.5, 1.5), cancel_token=token)
    assert result.outcome == GetPathOutcome.CANCELED


def test_unknown_cells_block_only_on_request(make_plugin):
    cells = grid(".?.")
    assert plan(make_plugin(AStarPlanner, cells), (0.5, 0.5), (2.5, 0.5)).success
    strict = make_plugin(AStarPlanner, cells, allow_unknown=False)
    assert plan(strict, (0.5, 0.5), (2.5, 0.5)).outcome == GetPathOutcome.NO_PATH_FOUND


def test_costs_push_the_path_away(make_plugin):
    cells = np.zeros((9, 9), dtype=np.uint8)
    cells[4, 3:6] = 252
    result = plan(make_plugin(AStarPlanner, cells), (0.5, 4.5), (8.5, 4.5))
    assert abs(result.path.positions[:, 1] - 4.5).max() >= 1.0


@pytest.mark.parametrize("name", F171_LENGTHS)
@pytest.mark.parametrize("cut_corners", [False, True], ids=["no-cutting", "cutting"])
def test_f171_nav2_system_test_maps(make_plugin, shared_data, name, cut_corners):
    maps = json.loads((shared_data / "maps" / "nav2_test_costmaps.json").read_text())["maps"]
    cells = np.array([[CODES[c] for c in row] for row in maps[name]], dtype=np.uint8)
    planner = make_plugin(
        AStarPlanner, cells, footprint=POINT_ROBOT, cost_factor=0.0, allow_unknown=False, cut_corners=cut_corners
    )
    result = plan(planner, (1.5, 1.5), (8.5, 8.5))
    assert result.path.length == pytest.approx(F171_LENGTHS[name][cut_corners], abs=1e-4)


def test_f165_blocked_goal_ends_at_the_nearest_free_cell(make_plugin):
    cells = np.zeros((100, 100), dtype=np.uint8)
    cells[40:61, 40:61] = 254
    result = plan(make_plugin(AStarPlanner, cells, cut_corners=True), (20.5, 20.5), (50.5, 50.5), dist_tolerance=20.0)
    end = result.path.positions[-1]
    assert math.dist(end[:2], (50.5, 50.5)) == pytest.approx(11.0)


def test_dijkstra_can_give_the_exact_cell_path(make_plugin):
    cells = np.zeros((20, 20), dtype=np.uint8)
    cells[5:15, 10] = 254
    exact = plan(make_plugin(DijkstraPlanner, cells, gradient_path=False), (2.5, 9.5), (17.5, 9.5))
    astar = plan(make_plugin(AStarPlanner, cells), (2.5, 9.5), (17.5, 9.5))
    assert exact.cost == pytest.approx(astar.cost, rel=1e-5)
    assert exact.path.length == pytest.approx(astar.path.length)


def block_map():
    cells = np.zeros((50, 50), dtype=np.uint8)
    cells[7:15, 7:15] = 253
    return cells


def test_f160_theta_star_finds_a_path_around_the_block(make_plugin):
    result = plan(make_plugin(ThetaStarPlanner, block_map()), (5.5, 5.5), (18.5, 18.5))
    assert result.success and len(result.path) > 0
    assert result.path.length == pytest.approx(math.hypot(10, 1) + math.hypot(3, 12), abs=1e-3)


def test_f161_start_inside_the_block_gives_no_path(make_plugin):
    result = plan(make_plugin(ThetaStarPlanner, block_map()), (10.5, 10.5), (18.5, 18.5))
    assert result.outcome == GetPathOutcome.BLOCKED_START and result.path is None


def test_f162_goal_on_a_lethal_cell_is_blocked(make_plugin):
    result = plan(make_plugin(ThetaStarPlanner, block_map()), (5.5, 5.5), (10.5, 10.5))
    assert result.outcome == GetPathOutcome.BLOCKED_GOAL


def test_theta_star_in_the_open_is_one_straight_line(make_plugin):
    result = plan(make_plugin(ThetaStarPlanner, np.zeros((60, 90)), spacing=0.0), (3.5, 5.5), (80.5, 41.5))
    assert len(result.path) == 2
    assert result.cost == pytest.approx(math.hypot(77, 36), rel=1e-5)


@pytest.mark.parametrize("seed", range(8))
def test_theta_star_is_never_longer_than_the_octile_path(make_plugin, seed):
    cells = np.where(np.random.default_rng(seed).random((40, 40)) < 0.25, 254, 0).astype(np.uint8)
    cells[0, 0] = cells[-1, -1] = 0
    octile = plan(make_plugin(AStarPlanner, cells, footprint=POINT_ROBOT), (0.5, 0.5), (39.5, 39.5))
    theta = plan(make_plugin(ThetaStarPlanner, cells, footprint=POINT_ROBOT), (0.5, 0.5), (39.5, 39.5))
    assert theta.outcome == octile.outcome
    assert not octile.success or theta.path.length <= octile.path.length + 1e-9


@pytest.mark.parametrize("planner_class", [AStarPlanner, DijkstraPlanner])
def test_the_interpolated_potential_bends_smoothly_around_the_block(make_plugin, planner_class):
    planner = make_plugin(planner_class, block_map(), interpolated_potential=True)
    result = plan(planner, (5.5, 5.5), (18.5, 18.5))
    shortest = math.hypot(10, 1) + math.hypot(3, 12)
    assert result.success and shortest - 1e-6 <= result.path.length <= 1.08 * shortest
    assert result.cost == pytest.approx(shortest, rel=0.06)


def test_the_interpolated_potential_honours_the_goal_tolerance(make_plugin):
    planner = make_plugin(AStarPlanner, WALLED, interpolated_potential=True)
    assert plan(planner, (1.5, 1.5), (5.6, 1.5), dist_tolerance=1.5).path[-1].x == 4.5


def test_a_cell_path_down_the_interpolated_potential_is_refused():
    with pytest.raises(ValueError, match="gradient_path"):
        DijkstraPlanner.Parameters(interpolated_potential=True, gradient_path=False)


def test_straight_line_is_straight_or_nothing(make_plugin):
    free = plan(make_plugin(StraightLinePlanner, np.zeros((10, 10))), (1.2, 1.7), (8.1, 6.6))
    assert free.path.length == pytest.approx(math.hypot(6.9, 4.9))
    blocked = plan(make_plugin(StraightLinePlanner, block_map()), (5.5, 5.5), (18.5, 18.5))
    assert blocked.outcome == GetPathOutcome.NO_PATH_FOUND


def test_straight_line_may_end_before_an_obstacle_within_the_tolerance(make_plugin):
    result = plan(make_plugin(StraightLinePlanner, WALLED), (0.5, 1.5), (5.6, 1.5), dist_tolerance=1.5)
    assert result.success and 4.0 < result.path[-1].x < 5.0
