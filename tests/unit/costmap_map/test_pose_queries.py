"""The four queries, and the facts of MBF's free pose search (F291-F299)."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mbf_abstract.geometry import Path, Pose
from mbf_abstract.maps.map_queries import check_path
from mbf_abstract.maps.queries import CellState, PlaceQuery
from mbf_costmap_nav.grid.collision import footprint_costs
from mbf_costmap_nav.grid.costmap import Costmap
from mbf_costmap_nav.grid.footprint import Footprint
from mbf_costmap_nav.map.pose_checks import cells_by_distance, check_point, find_valid_pose, pose_check

UNIT_SQUARE = Footprint([(0.5, 0.5), (0.5, -0.5), (-0.5, -0.5), (-0.5, 0.5)])
RECTANGLE = Footprint([(0.75, 0.4), (0.75, -0.4), (-0.75, -0.4), (-0.75, 0.4)])
DEGREE = math.pi / 180.0


@pytest.fixture
def costmap():
    return Costmap(np.zeros((10, 10), dtype=np.uint8), 1.0)


def state_at(costmap, x, y, degrees=0.0, footprint=UNIT_SQUARE):
    return footprint_costs(costmap, footprint, x, y, degrees * DEGREE).state


@pytest.mark.parametrize(
    ("cell", "count"), [((0, 0), 3), ((9, 9), 3), ((5, 5), 8), ((0, 5), 5), ((5, 0), 5)], ids=lambda v: f"F291-{v}"
)
def test_f291_neighbours_come_nearest_first_then_by_x_and_y(costmap, cell, count):
    cells = cells_by_distance(costmap, cell, 1).tolist()
    assert cells[0] == list(cell) and len(cells) == count + 1
    straight = [c for c in cells[1:] if c[0] == cell[0] or c[1] == cell[1]]
    assert cells[1 : len(straight) + 1] == sorted(straight)


@pytest.mark.parametrize("place", [(5.0, 5.0), (4.6, 5.0), (4.6, 4.6), (4.5, 4.5)], ids=lambda v: f"F293-{v}")
@pytest.mark.parametrize(("value", "state"), [(254, CellState.LETHAL), (255, CellState.UNKNOWN)])
def test_f293_a_square_touches_the_blocked_cell(costmap, place, value, state):
    costmap.cells[5, 5] = value
    assert state_at(costmap, *place) is state


@pytest.mark.parametrize("place", [(4.4, 4.4), (3.0, 5.0), (4.5, 4.5, 45.0)], ids=lambda v: f"F294-{v}")
def test_f294_a_square_misses_the_lethal_cell(costmap, place):
    costmap.cells[5, 5] = 254
    assert state_at(costmap, *place) is CellState.FREE


def test_f295_a_footprint_over_the_border_is_outside(costmap):
    assert state_at(costmap, 0.0, 0.0) is CellState.OUTSIDE


def test_f296_inscribed_cells_around_the_centre(costmap):
    for x, y in ((4, 5), (6, 5), (5, 4), (5, 6)):
        costmap.cells[y, x] = 253
    assert state_at(costmap, 5.0, 5.0) is CellState.INSCRIBED


def test_f297_the_heading_search_finds_the_first_turn_that_fits(costmap):
    costmap.cells[5, 5] = 254
    pose = Pose.planar(4.6, 4.6)
    found = find_valid_pose(costmap, UNIT_SQUARE, pose, 0.0, math.pi, angle_increment=22.5 * DEGREE)
    assert found.state is CellState.FREE and found.pose.yaw == pytest.approx(22.5 * DEGREE)
    nothing = find_valid_pose(costmap, UNIT_SQUARE, pose, 0.0, 2 * math.pi, angle_increment=math.pi)
    assert nothing.state is CellState.LETHAL and nothing.pose is None


@pytest.mark.parametrize(("start", "expected"), [(0.0, 90.0), (-90.0, -90.0)], ids=["F298-turned", "F298-kept"])
def test_f298_a_rectangle_beside_an_obstacle(costmap, start, expected):
    costmap.cells[5, 5] = 254
    pose = Pose.planar(4.5, 5.5, start * DEGREE)
    found = find_valid_pose(costmap, RECTANGLE, pose, 0.0, math.pi, angle_increment=45.0 * DEGREE)
    assert found.state is CellState.FREE and found.pose.yaw == pytest.approx(expected * DEGREE)


def inscribed(cells):
    """The map with every free side neighbour of a lethal cell inscribed, as F299's inflation does."""
    grown = cells.copy()
    for iy, ix in np.argwhere(cells == 254):
        for x, y in ((ix + 1, iy), (ix - 1, iy), (ix, iy + 1), (ix, iy - 1)):
            if 0 <= x < 10 and 0 <= y < 10 and grown[y, x] == 0:
                grown[y, x] = 253
    return Costmap(grown, 1.0)


def test_f299_growing_obstacles_push_the_solution_away(ten_by_ten):
    cells = ten_by_ten.cells.copy()
    cells[5, 5] = 254
    for x, y in ((6.5, 4.5), (5.5, 7.5), (3.5, 4.5), (3.5, 7.5)):
        found = find_valid_pose(
            inscribed(cells), UNIT_SQUARE, Pose.planar(5.5, 5.5), 5.0, math.pi, angle_increment=math.pi / 4
        )
        assert (found.pose.x, found.pose.y) == (x, y)
        assert footprint_costs(inscribed(cells), UNIT_SQUARE, x, y, found.pose.yaw).lethal == 0
        cells[int(y), int(x)] = 254


def test_a_free_goal_is_returned_to_the_bit(costmap):
    pose = Pose((1.345, 6.66, 0.5), (0.0, 0.0, 0.6, 0.8), "map", 3.0)
    found = find_valid_pose(costmap, UNIT_SQUARE, pose, 0.0, 0.0)
    assert found.state is CellState.FREE and found.pose == pose


def test_only_cells_within_the_tolerance_are_tried(costmap):
    costmap.cells[6, 5] = 254
    found = find_valid_pose(costmap, UNIT_SQUARE, Pose.planar(5.5, 7.1), 0.1, 0.0)
    assert found.state is CellState.LETHAL and found.pose is None


def test_a_goal_off_the_map_is_searched_from_the_border(costmap):
    goal = Pose.planar(-1.0, -1.0)
    nothing = find_valid_pose(costmap, UNIT_SQUARE, goal, 0.5, 0.0)
    assert nothing.state is CellState.OUTSIDE and nothing.pose is None
    border = find_valid_pose(costmap, UNIT_SQUARE.offset(0.1), goal, 2.13, 0.0)
    assert border.state is CellState.OUTSIDE and (border.pose.x, border.pose.y) == (0.5, 0.5)


@pytest.mark.parametrize(
    ("value", "state"),
    [
        (0, CellState.FREE),
        (252, CellState.FREE),
        (253, CellState.INSCRIBED),
        (254, CellState.LETHAL),
        (255, CellState.UNKNOWN),
    ],
)
def test_the_state_of_a_point_follows_its_cell(costmap, value, state):
    costmap.cells[3, 2] = value
    answer = check_point(costmap, 2.5, 3.5)
    assert (answer.state, answer.cost) == (state, value)


def test_a_point_off_the_map_is_outside(costmap):
    answer = check_point(costmap, -0.1, 3.5)
    assert (answer.state, answer.cost) == (CellState.OUTSIDE, 0.0)


def test_the_cost_of_a_pose_counts_every_cell_once_with_its_multiplier(costmap):
    costmap.cells[:] = 10
    costmap.cells[5, 4:7] = (254, 253, 255)
    footprint = Footprint([(1.4, 1.4), (-1.4, 1.4), (-1.4, -1.4), (1.4, -1.4)])  # covers 3 x 3 cells
    query = PlaceQuery(lethal_cost_mult=2.0, inscrib_cost_mult=3.0, unknown_cost_mult=0.5)
    answer = pose_check(costmap, footprint, query)(Pose.planar(5.5, 5.5))
    assert (answer.state, answer.known) == (CellState.UNKNOWN, CellState.LETHAL)
    assert answer.cost == 6 * 10 + 2 * 254 + 3 * 253 + 0.5 * 255


def test_a_safety_distance_keeps_that_far_from_a_corner(costmap):
    costmap.cells[8, 8] = 254  # its nearest corner is (8, 8); the square's is (6, 6), 2.83 m away
    pose = Pose.planar(5.5, 5.5)
    assert pose_check(costmap, UNIT_SQUARE, PlaceQuery(safety_dist=1.9))(pose).state is CellState.FREE
    assert pose_check(costmap, UNIT_SQUARE, PlaceQuery(safety_dist=2.9))(pose).state is CellState.LETHAL


@pytest.fixture
def path():
    return Path.from_points([(x + 0.5, 5.5, 0.0) for x in range(1, 9)])


def test_a_path_check_accumulates_over_all_poses(costmap, path):
    costmap.cells[5, 3] = 254
    costmap.cells[5, 6] = 100
    answer = check_path(pose_check(costmap, Footprint([])), path)
    assert (answer.last_checked, answer.state, answer.cost) == (7, CellState.LETHAL, 354.0)


def test_a_path_check_stops_at_the_given_state(costmap, path):
    costmap.cells[5, 3] = 254
    answer = check_path(pose_check(costmap, Footprint([])), path, return_on=CellState.LETHAL)
    assert (answer.last_checked, answer.state) == (2, CellState.LETHAL)


def test_a_path_check_skips_poses(costmap, path):
    costmap.cells[5, 2] = 254
    answer = check_path(pose_check(costmap, Footprint([])), path, skip_poses=1)
    assert (answer.last_checked, answer.state) == (6, CellState.FREE)


@given(st.integers(0, 2**32 - 1), st.tuples(st.floats(0.5, 11.5), st.floats(0.5, 11.5)), st.floats(-3.0, 3.0))
@settings(max_examples=25, deadline=None)
def test_no_cell_nearer_than_the_one_found_fits(seed, place, yaw):
    rng = np.random.default_rng(seed)
    grid = Costmap(rng.choice([0, 100, 254, 255], (12, 12), p=[0.7, 0.1, 0.15, 0.05]).astype(np.uint8), 1.0)
    outline = Footprint(rng.uniform(0.2, 1.2, (4, 2)) * [[1, 1], [-1, 1], [-1, -1], [1, -1]])
    asked = Pose.planar(*place, yaw)
    found = find_valid_pose(grid, outline, asked, 4.0, 0.0)

    def fits(x, y):
        return pose_check(grid, outline)(Pose.planar(x, y, yaw)).state in (CellState.FREE, CellState.INSCRIBED)

    home = grid.world_to_cell(*place)
    fitting = {
        math.dist(home, (ix, iy))
        for iy, ix in np.ndindex(12, 12)
        if math.dist(place, grid.cell_to_world(ix, iy)) <= 4.0 and fits(*grid.cell_to_world(ix, iy))
    }
    if fits(*place):
        assert found.pose == asked
    elif fitting:
        assert fits(found.pose.x, found.pose.y)
        assert math.dist(home, grid.world_to_cell(found.pose.x, found.pose.y)) == min(fitting)
    else:
        assert found.state not in (CellState.FREE, CellState.INSCRIBED)


@pytest.mark.parametrize("x", [30.0, 199.5, 250.0])
def test_an_endless_tolerance_looks_at_the_whole_map(x):
    """Far beyond the first ring of cells, and from a place off the map."""
    grid = Costmap(np.full((3, 200), 254, dtype=np.uint8), 1.0)
    grid.cells[1, 2] = grid.cells[1, 10] = 0
    for tolerance in (math.inf, 1e6, x - 10.5):
        found = find_valid_pose(grid, Footprint([]), Pose.planar(x, 1.5), tolerance, math.inf)
        assert found.state is CellState.FREE and (found.pose.x, found.pose.y) == (10.5, 1.5)
    assert find_valid_pose(grid, Footprint([]), Pose.planar(x, 1.5), x - 11.0, 0.0).pose is None


def test_a_place_that_fits_far_away_is_preferred_to_a_near_one_in_the_unknown():
    grid = Costmap(np.full((1, 300), 254, dtype=np.uint8), 1.0)
    grid.cells[0, 200:204], grid.cells[0, 202] = 0, 255
    grid.cells[0, 10:12] = 0
    wide = Footprint([(0.6, 0.2), (-0.6, 0.2), (-0.6, -0.2), (0.6, -0.2)])
    found = find_valid_pose(grid, wide, Pose.planar(199.0, 0.5), math.inf, 0.0)
    assert found.state is CellState.UNKNOWN and found.pose.x == 201.5
    grid.cells[0, 10:13] = 0
    assert find_valid_pose(grid, wide, Pose.planar(199.0, 0.5), math.inf, 0.0).pose.x == 11.5


@pytest.mark.parametrize("safety_dist", [-0.1, math.nan, math.inf])
def test_a_safety_distance_that_is_no_distance_is_misuse(safety_dist):
    with pytest.raises(ValueError, match="safety_dist must be 0 m or more"):
        PlaceQuery(safety_dist=safety_dist)
