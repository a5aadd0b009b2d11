"""Paths of the planners over cells fit the robot's outline: all along, at their ends, and where it must manoeuvre."""

import math

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mbf_abstract.geometry import Pose
from mbf_abstract.maps.queries import PADDED, CellState
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import PlanRequest
from mbf_abstract.time.cancel import CancelToken
from mbf_costmap_nav.grid.costmap import CellBox, Costmap
from mbf_costmap_nav.grid.footprint import Footprint
from mbf_costmap_nav.grid.footprint_check import FootprintCheck
from mbf_costmap_nav.planners.astar import AStarPlanner
from mbf_costmap_nav.planners.dijkstra import DijkstraPlanner
from mbf_costmap_nav.planners.straight_line import StraightLinePlanner
from mbf_costmap_nav.planners.theta_star import ThetaStarPlanner
from mbf_costmap_nav.planning.outline_course import Course, stretches, turn_poses

LONG_ROBOT = Footprint([[-0.5, -0.25], [0.5, -0.25], [0.5, 0.25], [-0.5, 0.25]])
RESOLUTION = 0.05
PLANNERS = [AStarPlanner, DijkstraPlanner, ThetaStarPlanner]


def walled(*boxes):
    """A map of 6 m x 6 m about the origin, lethal in boxes (x from, to, y from, to) [m], inscribed around them."""
    cells = np.zeros((120, 120), dtype=np.uint8)
    for x0, x1, y0, y1 in boxes:
        columns, rows = (slice(*(round((end + 3.0) / RESOLUTION) for end in ends)) for ends in ((x0, x1), (y0, y1)))
        cells[rows, columns] = 254
    return Costmap(inscribed_around(cells), RESOLUTION, -3.0, -3.0)


def inscribed_around(cells):
    from scipy.ndimage import distance_transform_edt

    distances = distance_transform_edt(cells != 254) * RESOLUTION
    return np.where((distances > 0.0) & (distances <= LONG_ROBOT.inscribed_radius), 253, cells).astype(np.uint8)


NICHE = walled((-0.6, 0.7, 0.35, 0.45), (-0.6, 0.7, -0.45, -0.35), (0.6, 0.7, -0.45, 0.45))
"""The robot at the origin can only back out of it, to the left."""


def plan(make_plugin, planner_class, costmap, start, goal, token=None, **request):
    planner = make_plugin(planner_class, costmap, footprint=LONG_ROBOT)
    token = CancelToken() if token is None else token
    return planner.make_plan(PlanRequest(Pose.planar(*start), Pose.planar(*goal), cancel_token=token, **request))


def misfits(path, costmap):
    """Indices of the poses at which a lethal cell lies under the outline, and of the same between two poses."""
    check = FootprintCheck(LONG_ROBOT, costmap.resolution)
    return [index for index, pose in enumerate(path) if check.collides(costmap, pose.x, pose.y, pose.yaw)]


@pytest.mark.parametrize("planner_class", PLANNERS)
def test_a_robot_in_a_niche_backs_out(make_plugin, planner_class):
    result = plan(make_plugin, planner_class, NICHE, (0.0, 0.0, 0.0), (0.0, 1.5, 0.0))
    assert result.success and misfits(result.path, NICHE) == []
    first = result.path[3]
    assert first.x < -0.05 and abs(first.yaw) < 0.5  # backward, looking ahead


@pytest.mark.parametrize("planner_class", PLANNERS)
def test_a_goal_in_a_niche_is_entered_with_its_heading(make_plugin, planner_class):
    result = plan(make_plugin, planner_class, NICHE, (0.0, 1.5, 0.0), (0.0, 0.0, 0.0))
    assert result.success and misfits(result.path, NICHE) == []
    assert (result.path[-1].x, result.path[-1].y, result.path[-1].yaw) == pytest.approx((0.0, 0.0, 0.0))


def test_where_the_outline_fits_the_path_is_what_the_search_has_found(make_plugin):
    costmap = walled((-0.2, 0.2, -2.0, -1.0), (-0.2, 0.2, 1.0, 2.0))
    request = PlanRequest(Pose.planar(-2.0, 0.0, 0.3), Pose.planar(2.0, 0.0, 0.2))
    answers = [
        make_plugin(AStarPlanner, costmap, footprint=LONG_ROBOT, check_footprint=check).make_plan(request)
        for check in (True, False)
    ]
    assert np.array_equal(answers[0].path.positions, answers[1].path.positions)
    assert np.array_equal(answers[0].path.orientations, answers[1].path.orientations)


def test_a_robot_that_touches_something_hears_how_it_gets_away(make_plugin):
    costmap = walled((0.45, 0.6, -0.1, 0.1))
    result = plan(make_plugin, AStarPlanner, costmap, (0.0, 0.0, 0.0), (-2.0, 0.0, 0.0))
    assert result.outcome == GetPathOutcome.BLOCKED_START
    assert "touches the lethal cell at (0." in result.message and "it gets away by backing up" in result.message


def test_a_goal_that_fits_at_another_heading_only_is_blocked_and_says_at_which(make_plugin):
    corridor = walled((-3.0, 3.0, 0.35, 0.45), (-3.0, 3.0, -0.45, -0.35))
    result = plan(make_plugin, AStarPlanner, corridor, (-2.0, 0.0, 0.0), (1.0, 0.0, 1.57))
    assert result.outcome == GetPathOutcome.BLOCKED_GOAL
    assert "would touch the lethal cell at" in result.message and "it fits there with the heading" in result.message


def test_a_goal_is_moved_within_its_tolerances_to_where_the_outline_fits(make_plugin):
    costmap = walled((1.45, 1.6, -0.1, 0.1))
    result = plan(make_plugin, AStarPlanner, costmap, (-2.0, 0.0, 0.0), (1.0, 0.0, 0.0), dist_tolerance=0.3)
    assert result.success and misfits(result.path, costmap) == []
    assert 0.0 < math.dist(result.path.positions[-1][:2], (1.0, 0.0)) <= 0.3
    assert "from the goal" in result.message


def test_the_straight_line_is_straight_or_nothing(make_plugin):
    result = plan(make_plugin, StraightLinePlanner, NICHE, (0.0, 0.0, 0.0), (-2.0, 0.0, 0.0))
    assert result.outcome == GetPathOutcome.BLOCKED_START
    assert "turning from the start" in result.message and "backing up" in result.message


def test_a_canceled_plan_searches_no_manoeuvre(make_plugin):
    class AfterSearch(CancelToken):
        """Set as soon as the search is over."""

    token = AfterSearch()
    planner = make_plugin(AStarPlanner, NICHE, footprint=LONG_ROBOT)
    found = planner.search

    def search(*arguments):
        leg = found(*arguments)
        token.cancel("enough")
        return leg

    planner.search = search
    result = planner.make_plan(PlanRequest(Pose.planar(0, 0), Pose.planar(0, 1.5), cancel_token=token))
    assert result.outcome == GetPathOutcome.CANCELED and result.message == "enough"


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(seed=st.integers(0, 2**32 - 1))
def test_the_outline_fits_at_every_pose_of_a_path_on_random_maps(make_plugin, seed):
    rng = np.random.default_rng(seed)
    corners, sizes = rng.uniform(-2.8, 2.6, (8, 2)), rng.uniform(0.1, 0.9, (8, 2))
    costmap = walled(*((x, min(x + w, 3.0), y, min(y + h, 3.0)) for (x, y), (w, h) in zip(corners, sizes, strict=True)))
    start, goal = rng.uniform(-2.4, 2.4, (2, 2))
    yaws = rng.uniform(-math.pi, math.pi, 2).tolist()
    for planner_class in (AStarPlanner, ThetaStarPlanner):
        result = plan(make_plugin, planner_class, costmap, (*start, yaws[0]), (*goal, yaws[1]))
        if result.success:
            assert misfits(result.path, costmap) == []
            planner = make_plugin(planner_class, costmap, footprint=LONG_ROBOT)
            check = planner.costmap.pose_check(PADDED)
            assert all(check(pose).state is not CellState.LETHAL for pose in (result.path[0], result.path[-1]))


def test_the_collisions_of_many_poses_are_those_of_each(make_plugin):
    rng = np.random.default_rng(3)
    poses = np.column_stack([rng.uniform(-3.2, 3.2, (300, 2)), rng.uniform(-4.0, 4.0, 300)])
    check = FootprintCheck(LONG_ROBOT, RESOLUTION)
    found = check.collisions(NICHE, poses)
    assert found.tolist() == [check.collides(NICHE, *pose) for pose in poses.tolist()] and found.any()
    for pose, collides in zip(poses.tolist(), found.tolist(), strict=True):
        place = check.touched(NICHE, *pose)
        assert (place is not None) == collides
        assert place is None or NICHE.cost_at(*place) == 254


def test_a_course_looks_along_its_path_and_turns_at_its_ends():
    course = Course.along(np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]), 0.1, 0.5, 2.0)
    assert course.poses[0, 2] == 0.0 and course.poses[-1, 2] == pytest.approx(0.5 * math.pi)
    assert course.poses[10, 2] == pytest.approx(0.25 * math.pi)  # in the corner
    assert (np.diff(course.lengths) <= 0.1 + 1e-9).all()


def test_a_course_passes_every_point_of_its_path():
    points = np.array([[0.0, 0.0], [0.07, 0.0], [0.07, 0.03], [0.4, 0.03]])
    course = Course.along(points, 0.05, None, None)
    assert all((np.hypot(*(course.poses[:, :2] - point).T) < 1e-12).any() for point in points)
    assert (np.diff(course.lengths) <= 0.05 + 1e-9).all()


def test_a_turn_takes_the_shorter_side_in_small_steps():
    poses = turn_poses(np.array([1.0, 2.0, 3.0]), -3.0, 0.05)
    assert poses[-1, 2] == pytest.approx(2.0 * math.pi - 3.0) and (np.diff(poses[:, 2]) <= 0.05 + 1e-9).all()
    assert len(turn_poses(np.array([1.0, 2.0, 3.0]), 3.0, 0.05)) == 0


def test_stretches_around_misfits_are_joined_where_they_meet():
    lengths = np.arange(11) * 1.0
    wrong = np.zeros(11, dtype=bool)
    wrong[[2, 3, 9]] = True
    assert stretches(wrong, lengths, 1.0) == [(1, 4), (8, 10)]
    assert stretches(wrong, lengths, 4.0) == [(0, 10)]


def test_a_part_of_a_costmap_keeps_its_places():
    part = NICHE.part(CellBox(40, 50, 80, 75))
    assert (part.width, part.height) == (40, 25)
    assert part.cell_to_world(0, 0) == pytest.approx(NICHE.cell_to_world(40, 50))
    assert part.cost(3, 2) == NICHE.cost(43, 52)
