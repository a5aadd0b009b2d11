"""Facts from the unit tests of costmap_2d and Nav2 about layers (shared/data/peer_facts.csv, F001-F030, F048-F052)."""

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from mbf_abstract.geometry import Pose
from mbf_abstract.maps.sensing import RangeScan
from mbf_costmap_nav.grid.costmap import FREE, INSCRIBED, LETHAL, UNKNOWN
from mbf_costmap_nav.layers.denoise import small_groups
from mbf_costmap_nav.layers.inflation import cost_table

SQUARE = [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)]
ROUND_2_1 = [(2.1, 2.1), (-2.1, 2.1), (-2.1, -2.1), (2.1, -2.1)]


def count(costmap, value):
    return int(np.count_nonzero(costmap.snapshot().cells == value))


def rule(distance, inscribed_radius, weight):
    """The cost of F001 in plain Python, resolution 1."""
    if distance == 0:
        return 254
    if distance <= inscribed_radius:
        return 253
    return int(252 * math.exp(-weight * (distance - inscribed_radius)))


def see(costmap, *points, sensor=(0.0, 0.0, 0.0), source="laser", now=0.0):
    costmap.insert_points(source, [(*point, 0.0)[:3] for point in points], sensor, now)
    costmap.update(Pose.planar(0.0, 0.0), now)


@given(st.integers(0, 40), st.integers(0, 40), st.floats(0.1, 3.0), st.floats(0.0, 2.0))
@example(dx=0, dy=37, inscribed_radius=1.625, weight=2.220446049250313e-16)
@settings(deadline=None)
def test_f001_the_cost_of_a_distance_follows_the_rule(dx, dy, inscribed_radius, weight):
    table = cost_table(57, 0.05, inscribed_radius, weight)
    distance = 0.05 * math.sqrt(dx * dx + dy * dy)
    assert table[dx * dx + dy * dy] == rule(distance, inscribed_radius, weight)


@pytest.mark.parametrize(
    ("cell", "expected"), [((1, 0), 253), ((2, 0), 253), ((1, 1), 253), ((3, 0), 102), ((2, 1), 219)], ids=str
)
def test_f002_costs_around_one_lethal_corner_cell(build, seeing, cell, expected):
    layers = {"obstacle": seeing, "inflation": {"inflation_radius": 4.1, "cost_scaling_factor": 1.0}}
    costmap = build("obstacle", "inflation", outline=ROUND_2_1, **layers)
    see(costmap, (0.0, 0.0))
    assert costmap.snapshot().cost(*cell) == expected
    assert count(costmap, UNKNOWN) == 0, "F003: no unknown cell appears"


def test_f004_costs_along_both_axes_of_one_obstacle(build, seeing):
    outline = [(5.0, 5.0), (-5.0, 5.0), (-5.0, -5.0), (5.0, -5.0)]
    layers = {"obstacle": seeing, "inflation": {"inflation_radius": 10.5, "cost_scaling_factor": 1.0}}
    costmap = build("obstacle", "inflation", width=100.0, height=100.0, outline=outline, **layers)
    see(costmap, (50.0, 50.0))
    cells = costmap.snapshot().cells
    assert (cells[50, 50:56] >= 253).all() and (cells[50:56, 50] >= 253).all()
    assert cells[50, 56:62].tolist() == cells[56:62, 50].tolist() == [92, 34, 12, 4, 1, 0]


def test_f005_no_cell_between_two_obstacles_costs_less_than_the_rule(build, seeing):
    layers = {"obstacle": seeing, "inflation": {"inflation_radius": 4.1, "cost_scaling_factor": 1.0}}
    costmap = build("obstacle", "inflation", outline=ROUND_2_1, **layers)
    see(costmap, (4.0, 4.0), (5.0, 5.0))
    cells = costmap.snapshot().cells
    for (iy, ix), cost in np.ndenumerate(cells):
        for obstacle in (4, 5):
            distance = math.hypot(ix - obstacle, iy - obstacle)
            assert distance > 5.0 or cost >= rule(distance, 2.1, 1.0)


def test_f006_to_f008_inflated_static_map_and_added_obstacles(build, seeing):
    costmap = build(
        "static", "obstacle", "inflation", obstacle=seeing, inflation={"inflation_radius": 1.0}, outline=SQUARE
    )
    costmap.update(None, 0.0)
    assert (count(costmap, LETHAL), count(costmap, INSCRIBED)) == (20, 28)
    see(costmap, (0.0, 0.0))
    assert count(costmap, LETHAL) + count(costmap, INSCRIBED) == 51
    see(costmap, (2.0, 0.0))
    assert count(costmap, LETHAL) + count(costmap, INSCRIBED) == 54


def test_f009_f010_an_obstacle_beside_another_overrides_inflated_cells(build, seeing):
    costmap = build(
        "static", "obstacle", "inflation", obstacle=seeing, inflation={"inflation_radius": 1.0}, outline=SQUARE
    )
    see(costmap, (1.0, 9.0), sensor=(1.5, 9.5, 0.0))
    assert [costmap.snapshot().cost(x, 9) for x in (0, 1, 2)] == [253, 254, 253]
    see(costmap, (0.0, 9.0), sensor=(0.5, 9.5, 0.0))
    assert costmap.snapshot().cost(0, 9) == 254


def test_f011_three_obstacles_in_one_update(build, seeing):
    costmap = build(
        "static", "obstacle", "inflation", obstacle=seeing, inflation={"inflation_radius": 1.0}, outline=SQUARE
    )
    see(costmap, (1.0, 1.0), (2.0, 1.0), (2.0, 2.0))
    assert costmap.snapshot().cost(2, 3) == costmap.snapshot().cost(3, 3) == 253


def test_f012_one_obstacle_on_an_empty_map_and_a_second_update(build, seeing):
    layers = {"obstacle": seeing, "inflation": {"inflation_radius": 3.0, "cost_scaling_factor": 1.0}}
    costmap = build("obstacle", "inflation", outline=SQUARE, **layers)
    see(costmap, (5.0, 5.0))
    first = costmap.snapshot().cells
    assert (100 - count(costmap, FREE), count(costmap, LETHAL), count(costmap, INSCRIBED)) == (29, 1, 4)
    costmap.update(None, 1.0)
    assert np.array_equal(costmap.snapshot().cells, first)


def test_f013_one_observation_adds_one_lethal_cell(build, seeing):
    costmap = build("static", "obstacle", obstacle=seeing)
    see(costmap, (0.0, 0.0))
    assert count(costmap, LETHAL) == 21


def test_f014_ray_tracing_never_erases_static_cells(build, seeing):
    costmap = build("static", "obstacle", obstacle=seeing)
    see(costmap, (9.5, 9.5), sensor=(0.5, 0.5, 0.0))
    assert (count(costmap, LETHAL), count(costmap, FREE)) == (21, 79)


def test_f015_rays_make_unknown_cells_free(build, seeing):
    costmap = build("obstacle", obstacle=seeing, track_unknown_space=True)
    see(costmap, (3.0, 3.0), (5.0, 5.0), (7.0, 7.0))
    assert (count(costmap, LETHAL), count(costmap, UNKNOWN), count(costmap, FREE)) == (3, 92, 5)


def test_f016_a_point_above_the_height_limit_does_not_mark(build, seeing):
    costmap = build("obstacle", obstacle=seeing)
    see(costmap, (0.0, 5.0, 0.4), (1.0, 5.0, 2.2))
    assert count(costmap, LETHAL) == 1


def test_f017_the_same_point_three_times_counts_once(build, seeing):
    costmap = build("static", "obstacle", obstacle=seeing)
    for _ in range(3):
        see(costmap, (0.0, 0.0))
    assert count(costmap, LETHAL) == 21


def test_f018_a_point_on_a_static_obstacle_adds_nothing(build, seeing):
    costmap = build("static", "obstacle", obstacle=seeing)
    see(costmap, (9.5, 0.0))
    assert count(costmap, LETHAL) == 20


def test_f019_an_observation_below_the_minimum_range_does_not_mark(build, seeing):
    seeing["sources"]["laser"]["obstacle_min_range"] = 2.0
    costmap = build("obstacle", obstacle=seeing)
    see(costmap, (5.0, 5.0))
    see(costmap, (5.0, 5.0), (1.0, 1.0))
    assert count(costmap, LETHAL) == 1


@pytest.mark.parametrize(("method", "unknown"), [("maximum", 99), ("maximum_without_unknown_overwrite", 100)])
def test_f020_combination_with_an_unknown_map(build, seeing, method, unknown):
    seeing |= {"combination_method": method}
    seeing["sources"]["laser"]["clearing"] = False
    costmap = build("obstacle", obstacle=seeing, track_unknown_space=True)
    see(costmap, (5.0, 5.0))
    assert count(costmap, UNKNOWN) == unknown


def sonar(costmap, x, y, reading, hit=True):
    costmap.insert_scan(RangeScan.of_rays("sonar", (x, y, 0.0), [(x + reading, y, 0.0)], [hit], 0.0))
    costmap.update(None, 0.0)


@pytest.fixture
def sonar_map(build):
    block = {
        "sources": {"sonar": {"field_of_view": math.radians(10.0), "expected_update_rate": 0.0}},
        "clear_on_max_reading": True,
    }
    return build("range_sensor", range_sensor=block)


def test_f021_f022_a_reading_marks_and_a_maximum_reading_clears(sonar_map):
    sonar(sonar_map, 2.0, 5.0, 2.0)
    assert sonar_map.snapshot().cost(4, 5) == LETHAL
    sonar(sonar_map, 2.0, 5.0, 7.0, hit=False)
    assert sonar_map.snapshot().cost(4, 5) == FREE


def test_f023_readings_from_three_places_along_the_axis(sonar_map):
    for x in (2.0, 4.0, 6.0):
        sonar(sonar_map, x, 5.0, 3.0)
    assert [sonar_map.snapshot().cost(x, 5) for x in (5, 6, 7, 8, 9)] == [254, 0, 254, 0, 254]


def test_f024_readings_from_three_places_side_by_side(sonar_map):
    for y in (3.0, 5.0, 7.0):
        sonar(sonar_map, 2.0, y, 1.0)
    assert [sonar_map.snapshot().cost(3, y) for y in (3, 4, 5, 6, 7)] == [254, 0, 254, 0, 254]


SPECKLES = "x.x. x..x .x.. xx.x"
GROUPS = ".xx..xx ..x.x.. x..x..x x...... ...x.xx xxx..xx ....xx."


@pytest.mark.parametrize(
    ("before", "size", "connectivity", "after"),
    [
        pytest.param(SPECKLES, 2, 4, "x... x... .x.. xx..", id="F025"),
        pytest.param(SPECKLES, 2, 8, "x.x. x..x .x.. xx..", id="F026"),
        pytest.param(GROUPS, 3, 4, ".xx.... ..x.... ....... ....... .....xx xxx..xx ....xx.", id="F027"),
        pytest.param(GROUPS, 3, 8, ".xx..xx ..x.x.. ...x... ....... ...x.xx xxx..xx ....xx.", id="F028"),
        pytest.param("x. .x", 2, 8, "x. .x", id="F029-8"),
        pytest.param("x. .x", 2, 4, ".. ..", id="F029-4"),
    ],
)
def test_small_groups_are_removed(before, size, connectivity, after):
    obstacles = np.array([[cell == "x" for cell in row] for row in before.split()])
    kept = obstacles & ~small_groups(obstacles, size, connectivity)
    assert kept.tolist() == [[cell == "x" for cell in row] for row in after.split()]


def test_f030_an_unknown_cell_among_costs_is_noise(build):
    costmap = build("denoise", denoise={"no_information_is_obstacle": True, "group_connectivity_type": 4})
    layer = costmap.layers["denoise"]
    cells = np.full((10, 10), 250, dtype=np.uint8)
    cells[1, 1] = UNKNOWN
    layer.update_costs(cells, costmap.geometry.box)
    assert cells[1, 1] == FREE


@pytest.mark.parametrize(
    ("layers", "size", "lethal"),
    [
        pytest.param(["obstacle"], 3.0, 20, id="F048"),
        pytest.param(["obstacle"], 20.0, 22, id="F049"),
        pytest.param([], 3.0, 22, id="F050"),
        pytest.param(["static", "obstacle"], 3.0, 0, id="F051"),
        pytest.param(["static", "obstacle"], 12.0, 6, id="F052"),
    ],
)
def test_clearing_outside_a_window_around_the_robot(build, seeing, layers, size, lethal):
    seeing["sources"]["laser"]["clearing"] = False
    costmap = build("static", "obstacle", obstacle=seeing)
    see(costmap, (5.0, 0.0), (0.0, 5.0))
    costmap.clear_area(Pose.planar(0.0, 0.0), size, layers, inside=False)
    costmap.update(None, 0.1)
    assert count(costmap, LETHAL) == lethal


# --------------------------------------------------------------------------------------------------- the list
def test_f182_layers_keep_the_order_of_the_list_and_are_found_by_name(build):
    order = ["voxel", "static", "obstacle"]
    costmap = build(*order)
    assert list(costmap.layers) == order
    assert [type(costmap.layers[name]).__name__ for name in order] == ["VoxelLayer", "StaticLayer", "ObstacleLayer"]


# ------------------------------------------------------------------------- two sources with limits of their own
HEIGHTS = {"min_obstacle_height": 0.2, "max_obstacle_height": 0.5}
RANGES = {"obstacle_min_range": 2.0, "obstacle_max_range": 3.0}


@pytest.mark.parametrize(
    ("limits", "points", "marked"),
    [
        (HEIGHTS, [(2.5, 0.5, 0.1), (3.5, 0.5, 0.3), (4.5, 0.5, 0.6)], {(3, 0)}),
        (RANGES, [(1.5, 0.5, 0.3), (3.0, 0.5, 0.3), (5.5, 0.5, 0.3)], {(3, 0)}),
        ({"marking": False}, [(2.5, 0.5, 0.3)], set()),
    ],
    ids=["heights", "ranges", "no marking"],
)
def test_limits_hold_for_their_own_source_only(build, seeing, limits, points, marked):
    low, wide = seeing["sources"]["laser"] | limits, seeing["sources"]["laser"]
    costmap = build("obstacle", obstacle=seeing | {"sources": {"low": low, "wide": wide}}, width=10, height=10)
    costmap.insert_points("low", points, (0.5, 0.5, 0.3), 0.0)
    costmap.insert_points("wide", [(8.5, 8.5, 0.9)], (8.5, 7.5, 0.3), 0.0)
    costmap.update(None, 0.0)
    assert {(int(ix), int(iy)) for iy, ix in np.argwhere(costmap.snapshot().cells == 254)} == marked | {(8, 8)}


def test_a_source_clears_from_its_least_to_its_largest_distance(build, seeing):
    laser = seeing["sources"]["laser"] | {"raytrace_min_range": 2.0, "raytrace_max_range": 4.0}
    costmap = build("obstacle", obstacle=seeing | {"sources": {"laser": laser}}, width=10, height=10)
    wall = [(x + 0.5, 0.5, 0.0) for x in range(1, 8)]
    costmap.insert_points("laser", wall, (0.5, 5.5, 0.0), 0.0)
    costmap.update(None, 0.0)
    before = set(map(int, np.flatnonzero(costmap.snapshot().cells[0] == 254)))
    costmap.insert_scan(RangeScan.of_rays("laser", (0.5, 0.5, 0.0), [(9.5, 0.5, 0.0)], [False], 20.0))
    costmap.update(None, 20.0)
    after = set(map(int, np.flatnonzero(costmap.snapshot().cells[0] == 254)))
    assert (before, after) == ({1, 2, 3, 4, 5, 6, 7}, {1, 5, 6, 7})
