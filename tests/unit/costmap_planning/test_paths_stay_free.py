"""What holds for the paths of all grid planners, on random maps: exact ends, free lines, one rule at the border."""

import math

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mbf_abstract.geometry import Pose
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import PlanRequest
from mbf_costmap_nav.control.path_geometry import resample
from mbf_costmap_nav.grid.footprint import Footprint
from mbf_costmap_nav.kernels.search.padded_grid import pad_cells
from mbf_costmap_nav.kernels.search.search_cells import write_box
from mbf_costmap_nav.planners.astar import AStarPlanner
from mbf_costmap_nav.planners.dijkstra import DijkstraPlanner
from mbf_costmap_nav.planners.hybrid_astar import HybridAStarPlanner
from mbf_costmap_nav.planners.straight_line import StraightLinePlanner
from mbf_costmap_nav.planners.theta_star import ThetaStarPlanner

RESOLUTION, SIDE = 0.1, 24
POINT_ROBOT = Footprint([])
ALL = [
    pytest.param(StraightLinePlanner, {}, id="straight_line"),
    pytest.param(AStarPlanner, {}, id="astar"),
    pytest.param(AStarPlanner, {"cut_corners": True}, id="astar-cutting"),
    pytest.param(AStarPlanner, {"interpolated_potential": True}, id="astar-potential"),
    pytest.param(DijkstraPlanner, {}, id="dijkstra"),
    pytest.param(DijkstraPlanner, {"gradient_path": False}, id="dijkstra-cells"),
    pytest.param(DijkstraPlanner, {"interpolated_potential": True}, id="dijkstra-potential"),
    pytest.param(ThetaStarPlanner, {}, id="theta_star"),
    pytest.param(ThetaStarPlanner, {"allow_unknown": False, "lethal_cost": 120}, id="theta_star-careful"),
    pytest.param(HybridAStarPlanner, {"max_states": 20000, "min_turning_radius": 0.2}, id="hybrid_astar"),
]
places = st.tuples(st.floats(0.0, SIDE * RESOLUTION - 1e-9), st.floats(0.0, SIDE * RESOLUTION - 1e-9))


def inside_of_blocked_cells(cells, points, blocked):
    """(n,) bool: which points lie in a blocked cell, by more than a rounding error."""
    scaled = points / RESOLUTION
    ix, iy = np.floor(scaled).astype(int).T
    depth = np.minimum(scaled - np.floor(scaled), np.ceil(scaled) - scaled).min(axis=1)
    return np.isin(cells[iy.clip(0, SIDE - 1), ix.clip(0, SIDE - 1)], blocked) & (depth > 1e-6)


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    seed=st.integers(0, 2**32 - 1),
    density=st.sampled_from([0.03, 0.15, 0.3]),
    start=places,
    goal=places,
    tolerance=st.sampled_from([0.0, 0.0, 0.4, math.inf]),
)
@pytest.mark.parametrize(("planner_class", "parameters"), ALL)
def test_no_line_of_a_path_runs_through_a_blocked_cell(
    make_plugin, planner_class, parameters, seed, density, start, goal, tolerance
):
    rng = np.random.default_rng(seed)
    draw = rng.random((SIDE, SIDE))
    cells = np.select([draw < density, draw < density + 0.05, draw < density + 0.1], [254, 255, 150]).astype(np.uint8)
    planner = make_plugin(planner_class, cells, resolution=RESOLUTION, footprint=POINT_ROBOT, **parameters)
    result = planner.make_plan(PlanRequest(Pose.planar(*start), Pose.planar(*goal), tolerance))
    if not result.success:
        return
    blocked = [254] if parameters.get("allow_unknown", True) else [254, 255, 150]
    points = result.path.positions[:, :2]
    assert points[0].tolist() == list(start)
    assert math.dist(points[-1], goal) <= tolerance + 1e-9
    assert not inside_of_blocked_cells(cells, resample(points, 0.001), blocked).any()


@pytest.mark.parametrize(("planner_class", "parameters"), ALL)
def test_a_goal_just_off_the_map_is_met_within_the_tolerance_and_refused_without(
    make_plugin, planner_class, parameters
):
    planner = make_plugin(
        planner_class, np.zeros((SIDE, SIDE)), resolution=RESOLUTION, footprint=POINT_ROBOT, **parameters
    )
    start, goal = Pose.planar(0.55, 1.23), Pose.planar(SIDE * RESOLUTION + 0.05, 1.23)
    for tolerance in (0.0, 0.05):
        assert planner.make_plan(PlanRequest(start, goal, tolerance)).outcome == GetPathOutcome.OUT_OF_MAP
    result = planner.make_plan(PlanRequest(start, goal, 0.3))
    assert result.success and "(tolerance 0.30 m)" in result.message
    end = result.path.positions[-1, :2]
    assert planner.costmap.fixed.contains(*end) and math.dist(end, (goal.x, goal.y)) <= 0.3


@pytest.mark.parametrize(("planner_class", "parameters"), ALL)
def test_an_endless_tolerance_means_anywhere_and_one_that_is_no_number_is_misuse(
    make_plugin, planner_class, parameters
):
    cells = np.zeros((SIDE, SIDE))
    cells[:, 15:] = 254
    planner = make_plugin(planner_class, cells, resolution=RESOLUTION, footprint=POINT_ROBOT, **parameters)
    start, goal = Pose.planar(0.55, 1.23), Pose.planar(2.3, 1.23)
    result = planner.make_plan(PlanRequest(start, goal, math.inf))
    assert result.success and result.path[-1].x == pytest.approx(1.45, abs=0.06)
    for bad in (math.nan, -0.1):
        with pytest.raises(ValueError, match="dist_tolerance must be 0 m or more"):
            planner.make_plan(PlanRequest(start, goal, bad))


def test_a_set_flag_ends_the_preparation_of_a_search_before_its_first_row():
    cells = np.random.default_rng(5).integers(0, 255, (3000, 400), dtype=np.uint8)
    flag = np.ones(1, dtype=np.uint8)
    assert not np.array_equal(pad_cells(cells, 254, flag).reshape(3002, 402)[1:-1, 1:-1], cells)
    assert np.array_equal(pad_cells(cells, 254).reshape(3002, 402)[1:-1, 1:-1], cells)
    words = np.zeros(cells.shape, dtype=np.uint64)
    write_box(cells, words, flag, np.array([0, 0, cells.shape[1], cells.shape[0]]))
    assert not words.any()
