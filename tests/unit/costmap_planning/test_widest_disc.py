"""Where the widest disc within an outline does not get, no car gets, and the planner says so soon."""

import math

import numpy as np
import pytest

from mbf_abstract.geometry import Pose
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import PlanRequest
from mbf_costmap_nav.grid.costmap import Costmap
from mbf_costmap_nav.grid.footprint import Footprint
from mbf_costmap_nav.map.costmap_config import CostmapParameters, build_layered_costmap
from mbf_costmap_nav.planners.hybrid_astar import HybridAStarPlanner
from mbf_costmap_nav.planning.widest_disc import disc_gets_there, widest_disc

CAR = Footprint([[0.75, 0.29], [-0.17, 0.29], [-0.17, -0.29], [0.75, -0.29]])
ARROW = Footprint([[0.7, 0.0], [0.3, 0.25], [-0.2, 0.25], [-0.2, -0.25], [0.3, -0.25]])


@pytest.mark.parametrize(
    ("footprint", "radius", "x"),
    [(CAR, 0.29, (0.12, 0.46)), (ARROW, 0.25, (0.05, 0.17)), (Footprint([]), 0.0, (0.0, 0.0))],
)
def test_the_widest_disc_of_an_outline(footprint, radius, x):
    centre_x, centre_y, found = widest_disc(footprint)
    assert found == pytest.approx(radius) and centre_y == pytest.approx(0.0) and x[0] <= centre_x <= x[1]


def wall_with_gap(width, angle, resolution=0.05):
    """6 m x 6 m around (0, 0) with a wall, at an angle, whose gap in the middle is ``width`` [m] wide."""
    centres = (np.arange(round(6.0 / resolution)) + 0.5) * resolution - 3.0
    x, y = np.meshgrid(centres, centres)
    along, across = x * math.cos(angle) + y * math.sin(angle), y * math.cos(angle) - x * math.sin(angle)
    wall = (np.abs(along) <= 0.75 * resolution) & (np.abs(across) > 0.5 * width)
    return Costmap(np.where(wall, 254, 0).astype(np.uint8), resolution, -3.0, -3.0)


def through(angle):
    """Poses before and behind the gap."""
    return [Pose.planar(x * math.cos(angle), x * math.sin(angle), angle) for x in (-1.8, 1.5)]


@pytest.mark.parametrize("footprint", [CAR, ARROW])
@pytest.mark.parametrize("angle", [0.0, 0.3, 0.5 * math.pi, 2.2, 3.0])
def test_the_disc_gets_wherever_a_path_leads(make_plugin, footprint, angle):
    width, answers = 2.0 * widest_disc(footprint)[2], []
    for spare in (-0.15, -0.06, -0.03, 0.0, 0.03, 0.06, 0.15):
        grid, (start, goal) = wall_with_gap(width + spare, angle), through(angle)
        planner = make_plugin(HybridAStarPlanner, grid, footprint=footprint, min_turning_radius=0.5, max_states=60_000)
        found = planner.make_plan(PlanRequest(start, goal)).success
        answers.append((found, disc_gets_there(grid, footprint, start, goal, 0.0)))
    assert (True, False) not in answers
    assert answers[0] == (False, False) and answers[-1] == (True, True)


def rooms(door):
    """12 m x 6 m, two rooms of 6 m x 6 m with a door of so many cells between them."""
    cells = np.zeros((120, 240), dtype=np.uint8)
    cells[[0, -1]] = cells[:, [0, -1]] = cells[:, 119:121] = 254
    cells[60 : 60 + door, 119:121] = 0
    return Costmap(cells, 0.05)


def planner_in(grid, make_plugin, footprint=CAR):
    """The planner on a map whose walls stay."""
    layers = [{"name": "walls", "type": "static"}]
    parameters = CostmapParameters(footprint=footprint.vertices.tolist(), footprint_padding=0.0, layers=layers)
    costmap = build_layered_costmap(parameters, {}, static_map=grid)
    costmap.update(None, 0.0)
    return make_plugin(HybridAStarPlanner, grid, costmap=costmap, min_turning_radius=1.06)


@pytest.mark.parametrize("tolerance", [0.0, 0.4])
def test_a_door_narrower_than_the_car_ends_the_search_soon_and_for_good(make_plugin, tolerance):
    planner = planner_in(rooms(9), make_plugin)
    start, goal = Pose.planar(3.0, 3.0), Pose.planar(9.0, 3.0)
    result = planner.make_plan(PlanRequest(start, goal, dist_tolerance=tolerance))
    assert result.outcome == GetPathOutcome.NO_PATH_FOUND and result.permanent
    assert "no way there is as wide as the robot, 0.58 m between the walls of the static map" in result.message


def test_through_a_door_that_is_wide_enough_and_within_a_tolerance_that_reaches_out_the_car_gets(make_plugin):
    start, goal = Pose.planar(3.0, 3.2), Pose.planar(9.0, 3.3)
    assert planner_in(rooms(16), make_plugin).make_plan(PlanRequest(start, goal)).success
    beside = planner_in(rooms(9), make_plugin).make_plan(PlanRequest(start, goal, dist_tolerance=5.0))
    assert beside.success and beside.path[-1].x < 6.0


def test_the_disc_is_no_reason_where_it_is_in_an_obstacle_at_the_start_or_the_robot_is_a_point():
    grid = rooms(9)
    assert disc_gets_there(grid, CAR, Pose.planar(5.6, 3.0), Pose.planar(9.0, 3.0), 0.0)
    assert disc_gets_there(grid, Footprint([]), Pose.planar(3.0, 3.0), Pose.planar(9.0, 3.0), 0.0)
    assert not disc_gets_there(grid, CAR, Pose.planar(3.0, 3.0), Pose.planar(9.0, 3.0), 0.0)
    assert disc_gets_there(grid, CAR, Pose.planar(3.0, 3.0), Pose.planar(9.0, 3.0), math.inf)
