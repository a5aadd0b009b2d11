"""Walls that stay end a goal at once; what may move away is waited for."""

import numpy as np
import pytest
from scipy import ndimage

from mbf_abstract.geometry import Pose
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import PlanRequest
from mbf_costmap_nav.grid.costmap import INSCRIBED, Costmap
from mbf_costmap_nav.grid.footprint import Footprint
from mbf_costmap_nav.map.costmap_config import CostmapParameters, build_layered_costmap
from mbf_costmap_nav.planners.astar import AStarPlanner
from mbf_costmap_nav.planners.dijkstra import DijkstraPlanner
from mbf_costmap_nav.planners.hybrid_astar import HybridAStarPlanner
from mbf_costmap_nav.planners.theta_star import ThetaStarPlanner
from mbf_costmap_nav.planning.permanent_walls import is_permanently_unreachable

PLANNERS = [AStarPlanner, DijkstraPlanner, ThetaStarPlanner, HybridAStarPlanner]
OBSTACLES = {"sources": {"scan": {"obstacle_max_range": 20.0}}}


def two_rooms(gap=0):
    """Two rooms of 5 m x 5 m at 0.1 m, and a gap of some cells in the wall between them."""
    cells = np.zeros((50, 101), dtype=np.uint8)
    cells[:, 50] = 254
    cells[20 : 20 + gap, 50] = 0
    return Costmap(cells, 0.1)


@pytest.fixture
def rooms():
    """Make a layered map of two rooms with whatever layers, a box of sensed obstacles over the wall's gap."""

    def make(gap, sensed, layers=("static", "obstacle", "inflation"), **obstacle):
        parameters = CostmapParameters.model_validate(
            {"robot_radius": 0.2, "layers": [{"name": name, "type": name} for name in layers]}
        )
        blocks = {"obstacle": {**OBSTACLES, **obstacle}} if "obstacle" in layers else {}
        costmap = build_layered_costmap(parameters, blocks, static_map=two_rooms(gap))
        if sensed:
            points = [(5.05, 0.05 + 0.1 * k, 0.2) for k in range(50)]
            costmap.insert_points("scan", points, (1.0, 2.5, 0.2), 0.0)
        costmap.update(Pose.planar(1.0, 2.5), 0.0)
        return costmap

    return make


def plan(make_plugin, planner_class, costmap, **request):
    planner = make_plugin(planner_class, two_rooms(), costmap=costmap)
    return planner.make_plan(PlanRequest(Pose.planar(1.0, 2.5), Pose.planar(9.0, 2.5), **request))


@pytest.mark.parametrize("planner_class", PLANNERS)
def test_a_goal_behind_a_wall_is_a_permanent_failure(make_plugin, rooms, planner_class):
    result = plan(make_plugin, planner_class, rooms(gap=0, sensed=False))
    assert (result.outcome, result.permanent) == (GetPathOutcome.NO_PATH_FOUND, True)
    assert "walls of the static map separate them" in result.message


@pytest.mark.parametrize("planner_class", PLANNERS)
def test_a_goal_behind_a_gap_too_narrow_for_the_robot_is_a_permanent_failure(make_plugin, rooms, planner_class):
    assert plan(make_plugin, planner_class, rooms(gap=3, sensed=False)).permanent


def test_limits_of_the_speed_leave_walls_as_permanent_as_they_are(make_plugin, rooms):
    layers = ("static", "obstacle", "speed_limit", "inflation")
    assert plan(make_plugin, AStarPlanner, rooms(gap=0, sensed=False, layers=layers)).permanent


@pytest.mark.parametrize("planner_class", PLANNERS)
def test_a_goal_behind_sensed_obstacles_may_become_free(make_plugin, rooms, planner_class):
    result = plan(make_plugin, planner_class, rooms(gap=10, sensed=True))
    assert (result.outcome, result.permanent) == (GetPathOutcome.NO_PATH_FOUND, False)


@pytest.mark.parametrize(
    ("layers", "obstacle"),
    [
        (("static", "obstacle", "inflation"), {"combination_method": "overwrite"}),
        (("static", "obstacle", "denoise", "inflation"), {}),
    ],
)
def test_no_wall_is_permanent_where_a_layer_may_free_it(make_plugin, rooms, layers, obstacle):
    costmap = rooms(0, True, layers, **obstacle)
    assert costmap.permanent_costmap() is None


def test_a_tolerance_that_reaches_this_side_of_the_wall_is_no_permanent_failure(make_plugin, rooms):
    walled = rooms(gap=0, sensed=False)
    assert plan(make_plugin, AStarPlanner, walled, dist_tolerance=3.0).permanent
    assert plan(make_plugin, AStarPlanner, walled, dist_tolerance=5.0).success


def test_asking_for_permanent_walls_changes_nothing_of_the_map(rooms):
    asked, left = rooms(gap=10, sensed=True), rooms(gap=10, sensed=True)
    assert not np.array_equal(asked.permanent_costmap().cells, asked.snapshot().cells)
    for costmap in (asked, left):
        costmap.insert_points("scan", [(3.05, 3.05, 0.2)], (1.0, 2.5, 0.2), 1.0)
        costmap.update(Pose.planar(1.0, 2.5), 1.0)
    assert np.array_equal(asked.snapshot().cells, left.snapshot().cells)


def separated_by_hand(costmap, start, goal, tolerance):
    """The twin: every cell of the start's piece of free space is looked at."""
    walls = costmap.permanent_costmap()
    pieces, _ = ndimage.label(walls.cells < INSCRIBED, np.ones((3, 3)))
    (ix, iy), (goal_x, goal_y) = walls.world_to_cell(start.x, start.y), walls.world_to_cell(goal.x, goal.y)
    rows, columns = np.nonzero(pieces == pieces[iy, ix])
    reach = tolerance / walls.resolution + 1.0 if tolerance > 0.0 else 0.0
    return bool(pieces[iy, ix]) and not (np.hypot(columns - goal_x, rows - goal_y) <= reach).any()


def test_walls_separate_what_they_separate_when_every_cell_is_looked_at(rooms):
    rng, answers = np.random.default_rng(2), []
    costmap = rooms(gap=0, sensed=False)
    for tolerance in (0.0, 0.3, 1.05, 2.5, 7.0, np.inf):
        for ends in rng.uniform((0.1, 0.1), (10.0, 4.9), (60, 2, 2)):
            start, goal = (Pose.planar(*end) for end in ends.tolist())
            answers.append(is_permanently_unreachable(costmap, start, goal, tolerance))
            assert answers[-1] == separated_by_hand(costmap, start, goal, tolerance)
    assert 0.1 < np.mean(answers) < 0.9


def test_permanent_walls_are_computed_once_however_often_sensors_change_the_map(make_plugin, rooms):
    costmap = rooms(gap=0, sensed=True)
    walls = costmap.permanent_costmap()
    for number in range(3):
        assert plan(make_plugin, AStarPlanner, costmap).permanent
        costmap.insert_points("scan", [(3.05, 3.05 + 0.1 * number, 0.2)], (1.0, 2.5, 0.2), 1.0 + number)
        box = costmap.update(Pose.planar(1.0, 2.5), 1.0 + number)
        assert number == 0 or box != costmap.geometry.box  # the first one follows what was computed before
    assert costmap.permanent_costmap() is walls


def disabled(costmap, name):
    costmap.set_layer_parameters(name, costmap.layers[name].parameters.model_copy(update={"enabled": False}))


def wider(costmap):
    usual = costmap.layers["inflation"].parameters
    costmap.set_layer_parameters("inflation", usual.model_copy(update={"inflation_radius": 0.9}), until=5.0)


CHANGES = [
    lambda costmap: disabled(costmap, "inflation"),
    lambda costmap: disabled(costmap, "static"),
    wider,
    lambda costmap: costmap.set_footprint(Footprint.circle(0.4)),
    lambda costmap: costmap.clear_area(Pose.planar(5.05, 2.5), 2.0, ["static"]),
]


@pytest.mark.parametrize("change", CHANGES, ids=["inflation off", "static off", "override", "outline", "cleared"])
def test_permanent_walls_follow_every_change_that_no_sensor_makes(rooms, change):
    costmap, fresh = rooms(gap=0, sensed=True), rooms(gap=0, sensed=True)
    before = costmap.permanent_costmap()
    for one in (costmap, fresh):
        change(one)
        one.update(Pose.planar(1.0, 2.5), 1.0)
    after, expected = costmap.permanent_costmap(), fresh.permanent_costmap()
    assert np.array_equal(after.cells, expected.cells) and not np.array_equal(after.cells, before.cells)
    if change is wider:  # until its time is over
        costmap.update(Pose.planar(1.0, 2.5), 6.0)
        assert np.array_equal(costmap.permanent_costmap().cells, before.cells)


def test_a_permanent_layer_that_reports_a_change_by_itself_is_looked_at_again(rooms):
    costmap = rooms(gap=0, sensed=False)
    before = costmap.permanent_costmap()
    costmap.update(Pose.planar(1.0, 2.5), 1.0)
    costmap.layers["static"].cells[:, 50] = 0
    costmap.layers["static"]._changed = costmap.geometry.box
    costmap.update(Pose.planar(1.0, 2.5), 2.0)
    assert before.cells.max() == 254 and costmap.permanent_costmap().cells.max() == 0


LONG = Footprint([[0.8, 0.25], [-0.2, 0.25], [-0.2, -0.25], [0.8, -0.25]])


@pytest.mark.parametrize("planner_class", PLANNERS)
@pytest.mark.parametrize(
    ("walls", "request_", "permanent"),
    [
        (True, {}, True),
        (True, {"dist_tolerance": 0.3}, True),
        (True, {"dist_tolerance": 1.5}, None),
        (False, {"dist_tolerance": 0.3}, False),
    ],
)
def test_a_goal_where_walls_leave_the_outline_no_place_is_blocked_for_good(
    make_plugin, planner_class, walls, request_, permanent
):
    """The middle fits at (4.4, 2.5), but not the robot ahead of it, which reaches into the wall at 5 m."""
    layers = [{"name": name, "type": name} for name in ("static", "obstacle", "inflation")]
    parameters = CostmapParameters(footprint=LONG.vertices.tolist(), footprint_padding=0.0, layers=layers)
    static = two_rooms(0) if walls else Costmap(np.zeros((50, 101), dtype=np.uint8), 0.1)
    costmap = build_layered_costmap(parameters, {"obstacle": OBSTACLES}, static_map=static)
    if not walls:
        costmap.insert_points("scan", [(5.05, 0.05 + 0.1 * k, 0.2) for k in range(50)], (1.0, 2.5, 0.2), 0.0)
    costmap.update(Pose.planar(1.0, 2.5), 0.0)
    planner = make_plugin(planner_class, static, costmap=costmap)
    result = planner.make_plan(PlanRequest(Pose.planar(1.0, 2.5), Pose.planar(4.6, 2.5), **request_))
    if permanent is None:
        assert result.success
    else:
        assert (result.outcome, result.permanent) == (GetPathOutcome.BLOCKED_GOAL, permanent)
        assert ("walls of the static map are there" in result.message) == permanent
