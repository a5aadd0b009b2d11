"""The bucketed search and its field against a heapq twin, and the paths traced out of the field."""

import heapq
import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from mbf_costmap_nav.kernels.search.grid_line import line_cost
from mbf_costmap_nav.kernels.search.grid_path import trace_cells, trace_gradient
from mbf_costmap_nav.kernels.search.grid_search import CANCELED, EXHAUSTED, FOUND, search
from mbf_costmap_nav.kernels.search.padded_grid import PaddedGrid, pad_cells
from mbf_costmap_nav.kernels.search.search_cells import new_records, whole_grid
from mbf_costmap_nav.kernels.search.short_lines import TOUCHED, crossed_cells, trace_lines
from mbf_costmap_nav.kernels.search.theta_star import new_labels, theta_search
from mbf_costmap_nav.planning.search_grid import traversal_table

NO_CANCEL = np.zeros(1, dtype=np.uint8)
small_maps = hnp.arrays(
    np.uint8, st.tuples(st.integers(1, 12), st.integers(1, 12)), elements=st.sampled_from([0, 0, 0, 50, 252, 254, 255])
)


@st.composite
def roomy_maps(draw):
    """Maps of 9 to 30 cells a side with a few boxes, so that most cells are plain (their neighbours cost the same)."""
    height, width = draw(st.integers(9, 30)), draw(st.integers(9, 30))
    cells = np.full((height, width), draw(st.sampled_from([0, 40])), dtype=np.uint8)
    for _ in range(draw(st.integers(0, 6))):
        y, x = draw(st.integers(0, height - 1)), draw(st.integers(0, width - 1))
        side_y, side_x = draw(st.integers(1, 9)), draw(st.integers(1, 9))
        cells[y : y + side_y, x : x + side_x] = draw(st.sampled_from([0, 40, 120, 254]))
    return cells


def naive_field(cells, table, start, cut_corners):
    """Textbook Dijkstra over (iy, ix)."""
    height, width = cells.shape
    cost = {start: 0.0}
    queue = [(0.0, start)]
    while queue:
        g, (y, x) = heapq.heappop(queue)
        if g > cost[(y, x)]:
            continue
        for dy, dx in [(0, 1), (1, 0), (0, -1), (-1, 0), (1, 1), (1, -1), (-1, 1), (-1, -1)]:
            v, u = y + dy, x + dx
            if not (0 <= v < height and 0 <= u < width) or math.isinf(table[cells[v, u]]):
                continue
            if dx and dy and not cut_corners and (math.isinf(table[cells[y, u]]) or math.isinf(table[cells[v, x]])):
                continue
            g_new = g + math.hypot(dx, dy) * 0.5 * float(table[cells[y, x]] + table[cells[v, u]])
            if g_new < cost.get((v, u), math.inf):
                cost[(v, u)] = g_new
                heapq.heappush(queue, (g_new, (v, u)))
    return cost


def run(cells, start, goal, *, cost_factor=3.0, allow_unknown=False, cut_corners=False, flag=NO_CANCEL):
    """Search on a grid; start and goal are (iy, ix), goal None = field. Returns status, g, and what tracing needs."""
    table = traversal_table(cost_factor, 253, allow_unknown)
    stride = cells.shape[1] + 2
    grid = PaddedGrid(pad_cells(cells, 254), stride, table)

    def index(cell):
        return (cell[0] + 1) * stride + cell[1] + 1

    if goal is None:
        status, g, _ = search(grid, index(start), -1, 0.0, cut_corners, False, flag)
    else:
        status, g, _ = search(grid, index(start), index(goal), 1.0, cut_corners, False, flag)
    return status, g.reshape(-1, stride)[1:-1, 1:-1], (grid, g), index


@given(cells=small_maps, cut_corners=st.booleans(), allow_unknown=st.booleans())
def test_field_equals_the_naive_dijkstra(cells, cut_corners, allow_unknown):
    cells[0, 0] = 0
    _, field, _, _ = run(cells, (0, 0), None, cut_corners=cut_corners, allow_unknown=allow_unknown)
    expected = np.full(cells.shape, np.inf)
    for cell, g in naive_field(cells, traversal_table(3.0, 253, allow_unknown), (0, 0), cut_corners).items():
        expected[cell] = g
    np.testing.assert_allclose(field, expected, rtol=1e-5)


@settings(max_examples=200, deadline=None)
@given(cells=roomy_maps(), cut_corners=st.booleans(), data=st.data())
def test_where_neighbours_are_left_out_on_plain_ground_the_field_is_still_the_naive_one(cells, cut_corners, data):
    start = (data.draw(st.integers(0, cells.shape[0] - 1)), data.draw(st.integers(0, cells.shape[1] - 1)))
    cells[start] = 0
    _, field, _, _ = run(cells, start, None, cut_corners=cut_corners)
    expected = np.full(cells.shape, np.inf)
    for cell, g in naive_field(cells, traversal_table(3.0, 253, False), start, cut_corners).items():
        expected[cell] = g
    np.testing.assert_allclose(field, expected, rtol=1e-5)
    goal = tuple(np.argwhere(np.isfinite(field))[data.draw(st.integers(0, int(np.isfinite(field).sum()) - 1))])
    status, g, _, _ = run(cells, start, goal, cut_corners=cut_corners)
    assert status == FOUND and g[goal] == pytest.approx(expected[goal], rel=1e-5)


@settings(max_examples=30, deadline=None)
@given(first=small_maps, second=small_maps)
def test_memory_that_has_been_searched_in_changes_no_later_search(first, second):
    table, memory = traversal_table(3.0, 253, False), new_records(14 * 14)
    for cells in (first, second, first):
        cells[0, 0] = 0
        stride = cells.shape[1] + 2
        grid = PaddedGrid(pad_cells(cells, 254), stride, table)
        records = memory[: grid.cells.size]
        status, g, _ = search(grid, stride + 1, -1, 0.0, False, False, NO_CANCEL, records)
        alone = search(grid, stride + 1, -1, 0.0, False, False, NO_CANCEL)
        assert status == alone[0]
        np.testing.assert_array_equal(g, alone[1])


@settings(max_examples=40, deadline=None)
@given(cells=small_maps, data=st.data())
def test_memory_that_is_cleaned_where_it_was_touched_changes_no_later_search(cells, data):
    height, width = cells.shape
    stride, table = width + 2, traversal_table(3.0, 253, False)
    grid = PaddedGrid(pad_cells(cells, 254), stride, table)
    memories = new_records(grid.cells.size), whole_grid(grid.cells, stride)
    labels = new_labels(grid.cells.size), whole_grid(grid.cells, stride)
    canceled = np.ones(1, dtype=np.uint8)
    for _ in range(4):
        place = st.tuples(st.integers(1, height), st.integers(1, width))
        start, goal = (y * stride + x for y, x in (data.draw(place), data.draw(place)))
        if data.draw(st.integers(0, 4)) == 0:  # also after one that was canceled
            assert search(grid, start, goal, 1.0, False, False, canceled, *memories)[0] == CANCELED
            assert theta_search(grid, start, goal, canceled, *labels)[0] == CANCELED
        scale = float(data.draw(st.integers(0, 1)))
        ours, alone = (search(grid, start, goal, scale, False, False, NO_CANCEL, *own) for own in (memories, ()))
        assert ours[0] == alone[0]
        np.testing.assert_array_equal(ours[1], alone[1])
        ours, alone = (theta_search(grid, start, goal, NO_CANCEL, *own) for own in (labels, ()))
        assert ours[0] == alone[0]
        for mine, other in zip(ours[1:], alone[1:], strict=True):
            np.testing.assert_array_equal(mine, other)


def test_a_field_may_end_at_a_cell_that_has_its_final_value():
    cells = np.zeros((80, 80), dtype=np.uint8)
    _, _, (padded, whole), index = run(cells, (5, 5), None)
    status, g, _ = search(padded, index((5, 5)), index((9, 12)), 0.0, False, False, NO_CANCEL)
    assert status == FOUND and g[index((9, 12))] == whole[index((9, 12))]
    assert np.isinf(g[index((79, 79))])


@settings(max_examples=60, deadline=None)
@given(cells=small_maps, cut_corners=st.booleans(), data=st.data())
def test_a_star_reaches_the_goal_at_the_cost_of_the_field(cells, cut_corners, data):
    goal = (data.draw(st.integers(0, cells.shape[0] - 1)), data.draw(st.integers(0, cells.shape[1] - 1)))
    cells[0, 0] = 0
    _, field, _, _ = run(cells, (0, 0), None, cut_corners=cut_corners)
    status, g, grid, index = run(cells, (0, 0), goal, cut_corners=cut_corners)
    assert g[goal] == pytest.approx(field[goal], rel=1e-5)
    assert status == (FOUND if np.isfinite(field[goal]) else EXHAUSTED)
    path = search(grid[0], index((0, 0)), index(goal), 1.0, cut_corners, False, NO_CANCEL)[2]
    traced = trace_cells(*grid, index(goal), cut_corners)[::-1] if status == FOUND else []
    np.testing.assert_array_equal(path, traced)


@settings(max_examples=60, deadline=None)
@given(cells=small_maps, cut_corners=st.booleans())
def test_traced_cell_path_sums_up_to_its_cost(cells, cut_corners):
    cells[0, 0] = 0
    _, field, grid, index = run(cells, (0, 0), None, cut_corners=cut_corners)
    reached = np.argwhere(np.isfinite(field))
    end = tuple(reached[-1])
    path = trace_cells(*grid, index(end), cut_corners)
    padded, stride, table = grid[0]
    weights = table[padded[path]].astype(float)
    lengths = np.hypot(np.diff(path % stride), np.diff(path // stride))
    assert path[0] == index(end) and path[-1] == index((0, 0))
    assert (lengths < 1.5).all()
    assert (lengths * (weights[1:] + weights[:-1]) / 2).sum() == pytest.approx(field[end], rel=1e-5)


@settings(max_examples=60, deadline=None)
@given(cells=small_maps)
def test_gradient_path_arrives_through_reached_cells(cells):
    cells[0, 0] = 0
    _, field, grid, index = run(cells, (0, 0), None)
    end = tuple(np.argwhere(np.isfinite(field))[-1])
    points = trace_gradient(*grid, index(end))
    visited = np.floor(points + 0.5).astype(int)
    assert np.isfinite(grid[1][visited[:, 1] * grid[0].stride + visited[:, 0]]).all()
    assert visited[-1].tolist() == [1, 1]


def test_gradient_path_in_the_open_is_nearly_straight():
    cells = np.zeros((60, 100), dtype=np.uint8)
    _, _, grid, index = run(cells, (10, 10), None)
    points = trace_gradient(*grid, index((30, 90)))
    length = np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
    assert length <= 1.03 * math.hypot(80, 20)


@pytest.mark.parametrize("goal", [None, (299, 299)], ids=["field", "A*"])
def test_a_set_cancel_flag_ends_the_search(goal):
    flag = np.ones(1, dtype=np.uint8)
    status, _, _, _ = run(np.zeros((300, 300), dtype=np.uint8), (0, 0), goal, flag=flag)
    assert status == CANCELED


@pytest.mark.parametrize(
    ("start", "goal", "length", "steps"),
    [pytest.param((20, 20), (80, 80), 97.1543, 81, id="F164-corner-cutting")],
)
def test_smac_block_map_with_corner_cutting(start, goal, length, steps):
    cells = np.zeros((100, 100), dtype=np.uint8)
    cells[40:61, 40:61] = 254
    _, g, grid, index = run(cells, start, goal, cut_corners=True)
    assert g[goal] == pytest.approx(length, abs=1e-3)
    assert len(trace_cells(*grid, index(goal), True)) - 1 == steps


def test_smac_block_map_without_corner_cutting_f164():
    cells = np.zeros((100, 100), dtype=np.uint8)
    cells[40:61, 40:61] = 254
    _, g, grid, index = run(cells, (20, 20), (80, 80))
    assert g[80, 80] == pytest.approx(97.7401, abs=1e-3)
    assert len(trace_cells(*grid, index((80, 80)), False)) - 1 == 82


def naive_line_cost(cells, table, a, b, samples=20001):
    """Mean traversal of dense samples on the segment; blocked where a sample, or a touched corner, is blocked."""
    t = (np.arange(samples) + 0.5) / samples
    x, y = a[1] + t * (b[1] - a[1]), a[0] + t * (b[0] - a[0])
    traversal = table[cells[np.floor(y + 0.5).astype(int), np.floor(x + 0.5).astype(int)]]
    return traversal.astype(float).mean() * math.dist(a, b)


@settings(max_examples=80, deadline=None)
@given(cells=small_maps, data=st.data())
def test_line_cost_is_the_integral_of_the_traversal(cells, data):
    points = st.tuples(st.integers(0, cells.shape[0] - 1), st.integers(0, cells.shape[1] - 1))
    a, b = data.draw(points), data.draw(points)
    cells[a], cells[b] = 0, 0
    table, stride = traversal_table(3.0, 253, False), cells.shape[1] + 2
    flat = [(p[0] + 1) * stride + p[1] + 1 for p in (a, b)]
    cost = line_cost(PaddedGrid(pad_cells(cells, 254), stride, table), *flat)
    expected = naive_line_cost(cells, table, a, b)
    if np.isfinite(cost):
        assert cost == pytest.approx(expected, rel=2e-3)
    elif np.isfinite(expected):  # only a touched corner may block a line whose inner points are all free
        dy, dx = abs(a[0] - b[0]), abs(a[1] - b[1])
        assert any((2 * i + 1) * dy == (2 * j + 1) * dx for i in range(dx) for j in range(dy))


@pytest.mark.parametrize(("end", "free"), [((20, 7), True), ((18, 18), False)], ids=["F159-yes", "F159-no"])
def test_line_of_sight_past_the_block(end, free):
    cells = np.zeros((50, 50), dtype=np.uint8)
    cells[7:15, 7:15] = 253
    index = [(y + 1) * 52 + x + 1 for y, x in ((2, 2), end)]
    grid = PaddedGrid(pad_cells(cells, 254), 52, traversal_table(0.0, 253, False))
    assert np.isfinite(line_cost(grid, *index)) == free


@pytest.mark.parametrize("dx", range(-2, 3))
@pytest.mark.parametrize("dy", range(-2, 3))
def test_tabulated_lines_have_the_length_that_dense_samples_find_in_each_cell(dx, dy):
    t = (np.arange(20000) + 0.5) / 20000
    cells = np.floor(np.column_stack([t * dx, t * dy]) + 0.5).astype(int)
    found, counts = np.unique(cells, axis=0, return_counts=True)
    lengths = counts / len(t) * math.hypot(dx, dy)
    crossed = crossed_cells(dx, dy)
    assert {cell for cell, length in crossed.items() if length != TOUCHED} == {(int(x), int(y)) for x, y in found}
    assert [crossed[int(x), int(y)] for x, y in found] == pytest.approx(lengths.tolist(), abs=1e-3)


@settings(max_examples=100, deadline=None)
@given(cells=small_maps, cost_factor=st.floats(0.0, 20.0))
def test_theta_star_is_nowhere_dearer_than_the_naive_dijkstra_and_its_lines_are_free(cells, cost_factor):
    cells[0, 0] = 0
    table, stride = traversal_table(cost_factor, 253, False), cells.shape[1] + 2
    grid, start = PaddedGrid(pad_cells(cells, 254), stride, table), stride + 1
    for (y, x), octile in list(naive_field(cells, table, (0, 0), False).items())[::7]:
        goal = (y + 1) * stride + x + 1
        status, g, origin = theta_search(grid, start, goal, NO_CANCEL)
        lines = [line_cost(grid, a, b) for a, b in pairwise(trace_lines(origin, stride, start, goal))]
        assert status == FOUND and g[goal] <= octile * (1.0 + 1e-5)
        assert sum(lines) <= g[goal] * (1.0 + 1e-5)


@settings(max_examples=50, deadline=None)
@given(cells=small_maps)
def test_theta_star_without_a_way_settles_exactly_what_can_be_reached(cells):
    cells[0, 0], cells[-1, -1] = 0, 254
    table, stride = traversal_table(3.0, 253, False), cells.shape[1] + 2
    status, g, _ = theta_search(
        PaddedGrid(pad_cells(cells, 254), stride, table), stride + 1, stride * (len(cells) + 1) - 2, NO_CANCEL
    )
    reached = {(int(y), int(x)) for y, x in np.argwhere(np.isfinite(g.reshape(-1, stride)[1:-1, 1:-1]))}
    assert cells.size == 1 or (status == EXHAUSTED and reached == set(naive_field(cells, table, (0, 0), False)))


def naive_potential(cells, table, start):
    """navfn's update of all cells again and again until none changes."""
    traversal = np.pad(table[cells].astype(float), 1, constant_values=np.inf)
    potential = np.full(traversal.shape, np.inf)
    before = None
    while before is None or not np.array_equal(before, potential):
        before = potential.copy()
        for y, x in np.argwhere(np.isfinite(traversal)):
            t = traversal[y, x]
            a, b = sorted([min(before[y, x - 1], before[y, x + 1]), min(before[y - 1, x], before[y + 1, x])])
            if math.isinf(a):
                continue
            if b - a < t:
                d = (b - a) / t
                potential[y, x] = min(potential[y, x], a + t * min(1.0, -0.2301 * d * d + 0.5307 * d + 0.7040))
            else:
                potential[y, x] = min(potential[y, x], a + t)
        potential[start[0] + 1, start[1] + 1] = 0.0
    return potential[1:-1, 1:-1]


@settings(max_examples=40, deadline=None)
@given(cells=small_maps, cost_factor=st.floats(0.0, 300.0))
def test_the_interpolated_potential_equals_navfns_update_repeated_until_nothing_changes(cells, cost_factor):
    cells[0, 0] = 0
    table, stride = traversal_table(cost_factor, 253, False), cells.shape[1] + 2
    grid, start = PaddedGrid(pad_cells(cells, 254), stride, table), stride + 1
    _, g, _ = search(grid, start, -1, 0.0, False, True, NO_CANCEL)
    expected = naive_potential(cells, table, (0, 0))
    np.testing.assert_allclose(g.reshape(-1, stride)[1:-1, 1:-1], expected, rtol=1e-5)
    y, x = np.argwhere(np.isfinite(expected))[-1]
    goal = (y + 1) * stride + x + 1
    status, partial, _ = search(grid, start, goal, 0.0, False, True, NO_CANCEL)
    assert status == FOUND and partial[goal] == pytest.approx(expected[y, x], rel=1e-5)


def test_the_interpolated_potential_in_the_open_is_nearly_the_euclidean_distance():
    table, stride = traversal_table(3.0, 253, False), 102
    grid = PaddedGrid(pad_cells(np.zeros((100, 100), dtype=np.uint8), 254), stride, table)
    _, g, _ = search(grid, 11 * stride + 11, -1, 0.0, False, True, NO_CANCEL)
    g = g.reshape(102, 102)[1:-1, 1:-1]
    y, x = np.mgrid[:100, :100] - 10
    far = np.hypot(x, y) > 20
    assert np.abs(g[far] / np.hypot(x, y)[far] - 1.0).max() < 0.05
