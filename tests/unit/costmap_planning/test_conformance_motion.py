"""Facts about motion among obstacles that the tests of Nav2 and base_local_planner publish; the number is in the id."""

import math

import numpy as np
import pytest

from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.geometry.arcs import arc_poses
from mbf_abstract.plugins import ControlRequest, PlanRequest
from mbf_costmap_nav.controllers.dwa import DWAController
from mbf_costmap_nav.controllers.mppi import MPPIController
from mbf_costmap_nav.controllers.regulated_pure_pursuit import RegulatedPurePursuitController
from mbf_costmap_nav.grid.costmap import Costmap
from mbf_costmap_nav.grid.footprint import Footprint
from mbf_costmap_nav.grid.footprint_check import FootprintCheck
from mbf_costmap_nav.grid.motion_check import blocked_cells, obstacle_ahead
from mbf_costmap_nav.kernels.search.grid_search import search
from mbf_costmap_nav.kernels.search.padded_grid import PaddedGrid, pad_cells
from mbf_costmap_nav.planners.astar import AStarPlanner
from mbf_costmap_nav.planners.dijkstra import DijkstraPlanner
from mbf_costmap_nav.planners.theta_star import ThetaStarPlanner
from mbf_costmap_nav.planning.search_grid import traversal_table

SQUARE = Footprint([[0.5, 0.5], [0.5, -0.5], [-0.5, -0.5], [-0.5, 0.5]])
RESOLUTION, COARSE = 0.01, 0.05


# ------------------------------------------------------------------------------------------------ collision monitor
def points_at(*points):
    """A map of 4 m x 4 m around the origin with a lethal cell at each point."""
    cells = np.zeros((400, 400), dtype=np.uint8)
    for x, y in points:
        cells[int((y + 2.0) / RESOLUTION), int((x + 2.0) / RESOLUTION)] = 254
    return Costmap(cells, RESOLUTION, -2.0, -2.0)


def ahead(costmap, velocity, seconds):
    return obstacle_ahead(costmap, SQUARE, Pose.planar(0.0, 0.0), Twist.planar(*velocity), seconds)


@pytest.mark.parametrize(
    ("points", "velocity", "seconds"),
    [
        pytest.param(((0.7, -0.01), (0.7, 0.01)), (0.5, 0.0), 0.4, id="F151-ahead"),
        pytest.param(((-0.7, -0.01), (-0.7, 0.01)), (-0.5, 0.0), 0.4, id="F151-behind"),
        pytest.param(((-0.01, 0.6), (0.01, 0.6)), (0.0, 0.5), 0.2, id="F152-beside"),
    ],
)
def test_a_collision_is_foreseen_from_its_time_on_and_not_before(points, velocity, seconds):
    costmap, tolerance = points_at(*points), 1.5 * RESOLUTION / 0.5
    assert ahead(costmap, velocity, seconds - tolerance) == ""
    assert "the robot would touch it" in ahead(costmap, velocity, seconds + tolerance)


@pytest.mark.parametrize("depth", [0.02, 0.05, 0.15, 0.3])
def test_f153_from_a_collision_only_what_leads_deeper_is_refused(depth):
    # Nav2 reports a time of 0 s, whatever the velocity. Ours lets the robot out of the collision it is in.
    pole, wall = points_at((0.5 - depth, 0.0)), points_at(*((0.5 - depth, 0.01 * i) for i in range(-60, 60)))
    for costmap in (pole, wall):
        assert ahead(costmap, (-0.5, 0.0), 1.0) == ""
        assert "the robot would touch it at (0.0" in ahead(costmap, (0.5, 0.0), 1.0), "one cell counts one all along"
    behind = points_at((0.5 - depth, 0.0), *((0.55, 0.01 * i) for i in range(-10, 10)))
    assert "the robot would touch it at (0.0" in ahead(behind, (0.5, 0.0), 1.0)


def test_f154_what_lies_beyond_the_time_looked_ahead_is_no_obstacle_yet():
    costmap = points_at((1.1, -0.01), (1.1, 0.01))
    assert ahead(costmap, (0.5, 0.0), 1.0) == ""
    assert ahead(costmap, (0.5, 0.0), 1.3) != ""


def test_f155_one_point_is_an_obstacle():
    # Nav2 acts from a number of points on. Ours takes single points out of the map, by a denoise layer, or not at all.
    assert ahead(points_at((0.7, 0.0)), (0.5, 0.0), 1.0) != ""


def test_where_planners_and_controllers_see_no_collision_a_motion_is_free():
    rng, refused, clipped = np.random.default_rng(0), 0, 0
    check = FootprintCheck(SQUARE, COARSE)
    for _ in range(400):
        cells = np.where(rng.random((80, 80)) < 0.001, 254, 0).astype(np.uint8)
        costmap, yaw = Costmap(cells, COARSE, -2.0, -2.0), rng.uniform(-math.pi, math.pi)
        if blocked_cells(costmap, SQUARE, 0.0, 0.0, yaw)[0]:
            continue
        poses = arc_poses((0.0, 0.0, yaw), 0.5, 0.0, 0.0, 0.4, 0.05)
        obstacle = obstacle_ahead(costmap, SQUARE, Pose.planar(0.0, 0.0, yaw), Twist.planar(0.5), 0.4)
        assert bool(obstacle) == (check.first_collision(costmap, poses) >= 0)
        refused += bool(obstacle)
        clipped += not obstacle and any(blocked_cells(costmap, SQUARE, *pose)[0] for pose in poses.tolist())
    assert refused > 0 and clipped > 0  # by less than a quarter of a cell, which counts for none of them


def test_a_motion_that_is_free_touches_nothing_where_the_next_commands_are_asked_for():
    rng, free, long = np.random.default_rng(0), 0, Footprint([[0.5, 0.25], [-0.5, 0.25], [-0.5, -0.25], [0.5, -0.25]])
    check = FootprintCheck(long, 0.05)
    for _ in range(1000):
        cells = np.where(rng.random((80, 80)) < 0.003, 254, 0).astype(np.uint8)
        costmap, yaw = Costmap(cells, 0.05, -2.0, -2.0), rng.uniform(-math.pi, math.pi)
        vx, wz = rng.uniform(-0.1, 0.1), rng.uniform(-0.3, 0.3)
        if blocked_cells(costmap, long, 0.0, 0.0, yaw)[0]:
            continue
        if not obstacle_ahead(costmap, long, Pose.planar(0.0, 0.0, yaw), Twist.planar(vx, 0.0, wz), 1.0):
            free += 1
            poses = arc_poses((0.0, 0.0, yaw), vx, 0.0, wz, 1.0, 0.05)
            assert check.first_collision(costmap, poses) < 0
    assert free > 300


def test_on_a_path_the_footprint_may_reach_over_the_border_and_the_base_may_not():
    costmap, wall = points_at(), points_at((1.95, 0.0))
    there, forward = Pose.planar(1.3, 0.0), Twist.planar(0.5)
    assert obstacle_ahead(costmap, SQUARE, there, forward, 1.0) != ""
    assert obstacle_ahead(costmap, SQUARE, there, forward, 1.0, may_overhang=True) == ""
    assert obstacle_ahead(wall, SQUARE, there, forward, 1.0, may_overhang=True) != "", "what stands there counts"
    assert "(2.0" in obstacle_ahead(costmap, SQUARE, there, forward, 1.5, may_overhang=True), "the base would leave"
    outside = Pose.planar(2.1, 0.0, math.pi)
    assert obstacle_ahead(costmap, SQUARE, outside, forward, 1.0, may_overhang=True) == "", "it may come back"


# ------------------------------------------------------------------------------------------------ velocity smoother
@pytest.mark.parametrize(
    ("controller_class", "more"),
    [
        pytest.param(RegulatedPurePursuitController, {}, id="F145-pursuit"),
        pytest.param(DWAController, {"window_time": 0.05}, id="F145-dwa"),
        pytest.param(MPPIController, {"acc_lim_x": 2.5}, id="F145-mppi"),
    ],
)
def test_from_one_command_to_the_next_the_speed_changes_within_the_acceleration(make_plugin, controller_class, more):
    free = Costmap(np.zeros((200, 200), dtype=np.uint8), 0.05, -5.0, -5.0)
    controller, x, speed, speeds = make_plugin(controller_class, free, **more), 0.0, 0.0, []
    xs = np.linspace(0.0, 2.0, 41)
    assert controller.set_plan(Path(np.column_stack([xs, 0 * xs, 0 * xs])))
    for _ in range(40):
        result = controller.compute_velocity_commands(ControlRequest(Pose.planar(x, 0.0), Twist.planar(speed)))
        controller.clock.time += 0.05
        x, speed = x + 0.05 * result.command.vx, result.command.vx
        speeds.append(speed)
    assert max(speeds) > 0.4, "it drives"
    assert np.abs(np.diff([0.0, *speeds])).max() <= 2.5 / 20.0 + 1e-6


# ---------------------------------------------------------------------------------------------------------- wave
def distances(lethal, start):
    """Lengths of the shortest paths from a cell, of all cells [iy, ix] of a map of 10 x 10."""
    cells = np.zeros((10, 10), dtype=np.uint8)
    for x, y in lethal:
        cells[y, x] = 254
    origin = (start[1] + 1) * 12 + start[0] + 1
    table = traversal_table(0.0, 254, True)
    grid = PaddedGrid(pad_cells(cells, 254), 12, table)
    _, g, _ = search(grid, origin, -1, 0.0, False, False, np.zeros(1, dtype=np.uint8))
    return np.asarray(g).reshape(12, 12)[1:-1, 1:-1]


SQRT2 = math.sqrt(2.0)


def test_f068_a_wave_over_a_free_map():
    # base_local_planner steps to four neighbours: (1, 1) is 2 away and (9, 9) is 18. Ours step to eight.
    field = distances((), (0, 0))
    assert (field[4, 0], field[0, 4]) == (4.0, 4.0)
    assert (field[1, 1], field[9, 9]) == pytest.approx((SQRT2, 9 * SQRT2))


def test_f069_a_wave_round_obstacles():
    # Upstream gives blocked cells a value of 100; ours are not reached. Where upstream's path is straight ours is as
    # long; elsewhere a diagonal step, which never passes the side of a blocked cell, saves 2 - sqrt(2).
    ring = [(1, 0), (1, 1), (1, 2), (2, 0), (3, 0), (3, 1), (3, 2), (2, 2)]
    field = distances([(4, 6), (7, 1), *((7, y) for y in range(3, 8)), *ring], (4, 9))
    assert (field[8, 4], field[7, 4]) == (1.0, 2.0)
    assert np.isinf(field[6, 4]) and np.isinf(field[2, 2])
    assert field[5, 4] == pytest.approx(6 - (2 - SQRT2)) and field[4, 4] == pytest.approx(7 - 2 * (2 - SQRT2))
    assert field[0, 4] == pytest.approx(11 - 2 * (2 - SQRT2)) and field[8, 5] == pytest.approx(SQRT2)
    assert field[4, 9] == pytest.approx(10 - 2 * (2 - SQRT2))
    assert np.isinf(field[1, 2]), "the ring is closed"


# ------------------------------------------------------------------------------------------------------ third dimension
@pytest.mark.parametrize("planner_class", [AStarPlanner, DijkstraPlanner, ThetaStarPlanner])
def test_f167_a_plan_between_heights_rises_evenly(make_plugin, planner_class):
    # Nav2's 2D search refuses a third index, which is a heading there. The third number of ours is a height.
    planner = make_plugin(planner_class, np.zeros((10, 10)))
    request = PlanRequest(Pose.planar(1.5, 1.5, z=0.2), Pose.planar(8.5, 1.5, z=0.9))
    path = planner.make_plan(request).path
    assert path.positions[:, 2] == pytest.approx(0.2 + 0.1 * (path.positions[:, 0] - 1.5))
