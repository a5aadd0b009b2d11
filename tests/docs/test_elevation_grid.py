"""The backend of the guide: a configuration chooses it, and the same navigator plans, drives and asks on it."""

import importlib
from pathlib import Path as FilePath

import numpy as np
import pytest

from mbf_abstract.geometry import Path, Pose
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.maps.graph.graph_planner import GraphPlanner
from mbf_abstract.maps.map_plugin import MapContext
from mbf_abstract.maps.queries import CellState, PlaceQuery
from mbf_abstract.navigator import Navigator
from mbf_abstract.outcomes import GetPathOutcome, RecoveryOutcome
from mbf_abstract.testing.contract import check_planner
from mbf_abstract.testing.loopback import LoopbackRobot
from mbf_abstract.time.sim_clock import SimClock

CONFIG = """\
backend: elevation_grid:ElevationGridServer
planner_max_retries: 0
dist_tolerance: 0.2
planners:
  - {name: shortest, type: "mbf_abstract.maps.graph.graph_planner:GraphPlanner"}
controllers:
  - {name: follower, type: follow_path}
recovery_behaviors:
  - {name: ahead, type: drive_on_heading}
  - {name: back_up, type: back_up}
  - {name: move_away, type: move_away}
  - {name: rotate, type: rotate}
  - {name: clear, type: clear}
  - {name: relax, type: relax}
ahead: {distance: 8.0, speed: 0.5, time_limit: 60.0}
back_up: {distance: 3.0}
move_away: {clearance: 1.5}
elevation_grid: {file: hill.npy, resolution: 0.25, max_slope: 0.6, robot_radius: 0.3}
"""
START, GOAL = Pose.planar(1.0, 5.0), Pose.planar(9.0, 5.0)
HILL_TOP = Pose.planar(5.0, 5.0)
FLANK = Pose.planar(5.0, 4.0)


def hill():
    """10 m x 10 m with a steep hill of 2 m in the middle and an unknown corner."""
    x, y = np.meshgrid(np.arange(41) * 0.25, np.arange(41) * 0.25)
    heights = 2.0 * np.exp(-((x - 5.0) ** 2 + (y - 5.0) ** 2) / 1.5)
    heights[-5:, -5:] = np.nan
    return heights


@pytest.fixture
def navigator(tmp_path):
    np.save(tmp_path / "hill.npy", hill())
    file = tmp_path / "navigation.yaml"
    file.write_text(CONFIG)
    clock, transforms = SimClock(), TransformBuffer()
    robot = LoopbackRobot(clock, transforms, START)
    with Navigator.from_file(file, robot, clock, transforms) as made:
        yield made
    robot.close()
    clock.sleep(1.0)


def test_the_robot_drives_around_the_hill(navigator):
    result = navigator.go_to(GOAL)

    assert result.success, result.message
    assert navigator.robot_pose().distance_to(GOAL) < 0.25


def test_the_plan_keeps_to_free_ground_and_costs_its_length_and_the_slope(navigator):
    plan = navigator.get_path(GOAL)

    assert plan.success and plan.path.length < plan.cost < 1.6 * plan.path.length
    assert plan.path.length > 8.2, "the straight line is 8 m and goes over the hill"
    assert navigator.server.queries.check_path(plan.path).state is CellState.FREE


def test_a_goal_on_the_flank_is_blocked(navigator):
    plan = navigator.get_path(FLANK)

    assert plan.outcome == GetPathOutcome.BLOCKED_GOAL
    assert "(5.00, 4.00) is LETHAL" in plan.message


def test_ground_without_a_height_is_none_and_what_is_beside_it_a_wall(navigator):
    queries = navigator.server.queries

    assert queries.check_point(Pose.planar(9.8, 9.8)).state is CellState.OUTSIDE
    assert queries.check_point(Pose.planar(8.75, 9.25)).state is CellState.LETHAL
    assert queries.check_point(Pose.planar(12.0, 5.0)).state is CellState.OUTSIDE
    assert queries.check_pose(None).state is CellState.FREE


def test_the_worst_state_along_a_path_counts_and_can_end_the_search(navigator):
    over = Path.from_points(np.linspace(START.position, GOAL.position, 33))
    whole = navigator.server.queries.check_path(over)
    early = navigator.server.queries.check_path(over, return_on=CellState.LETHAL)

    assert (whole.state, whole.last_checked) == (CellState.LETHAL, 32)
    assert early.state is CellState.LETHAL and early.last_checked < 16


def test_a_valid_pose_is_found_within_the_tolerance_only(navigator):
    queries = navigator.server.queries
    near = queries.find_valid_pose(FLANK, 3.0, 0.0, PlaceQuery(safety_dist=0.1))

    assert near.state is CellState.INSCRIBED and 0.5 < near.pose.distance_to(FLANK) < 3.1
    assert queries.find_valid_pose(FLANK, 0.3, 0.0).pose is None


def test_the_recoveries_of_the_core_know_the_hill_and_the_end_of_the_grid(navigator):
    behind = navigator.recover("back_up")
    assert behind.outcome == RecoveryOutcome.IMPASSABLE and "an obstacle is in the way" in behind.message
    assert 0.0 < navigator.robot_pose().x < 0.5
    ahead = navigator.recover("ahead")
    assert ahead.outcome == RecoveryOutcome.IMPASSABLE and "an obstacle is in the way" in ahead.message
    stopped_at = navigator.robot_pose().x
    assert 2.0 < stopped_at < 4.5, "the flank is steep from 4.5 m on at the latest"
    assert navigator.recover("move_away").success
    assert navigator.robot_pose().x < stopped_at - 0.5
    for name in ("rotate", "clear"):
        assert navigator.recover(name).success
    assert "inflation at 0.3 m" in navigator.recover("relax").message


def test_the_planner_keeps_the_contract():
    module = importlib.import_module("elevation_grid")
    parameters = module.ElevationGridParameters(file="none", resolution=0.25, max_slope=0.6)
    grid = module.ElevationGrid(hill(), parameters, "map")

    check_planner(
        GraphPlanner,
        [(START, GOAL)],
        unreachable=[(START, FLANK), (START, HILL_TOP)],
        make_context=lambda base: MapContext(**vars(base), navigation_map=grid),
        watched=[grid.heights, grid.nodes, grid.state.clearance],
        cancel_within=1.0,
    )


def test_the_whole_backend_is_shorter_than_a_page():
    source = importlib.import_module("elevation_grid").__file__
    assert len(FilePath(source).read_text("utf-8").splitlines()) < 120
