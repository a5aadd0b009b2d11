"""Every fast kernel against a slow twin of a few lines."""

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from mbf_costmap_nav.grid.costmap import CellBox, GridGeometry
from mbf_costmap_nav.kernels.map.inflation import inflate
from mbf_costmap_nav.kernels.map.rasterisation import blocked_under, fill_polygon, polygon_costs, rasterise_polygon
from mbf_costmap_nav.kernels.map.raytrace import clear_rays, mark_points
from mbf_costmap_nav.kernels.map.voxel import clear_voxel_rays, count_bits, project_columns
from mbf_costmap_nav.layers.denoise import small_groups
from mbf_costmap_nav.layers.inflation import cost_table
from mbf_costmap_nav.map.layer import CombinationMethod, combine

SIXTEENTHS = st.integers(-32, 144).map(lambda value: value / 16)
CELL_VALUES = st.sampled_from([0, 0, 0, 0, 0, 0, 100, 253, 254, 255])
GRIDS = st.tuples(st.integers(1, 14), st.integers(1, 14)).flatmap(
    lambda shape: hnp.arrays(np.uint8, shape, elements=CELL_VALUES)
)


def slow_inflation(cells, table, radius, unknown_from):
    seeds = np.argwhere(cells == 254)
    out = cells.copy()
    for (iy, ix), old in np.ndenumerate(cells):
        square = np.min(((seeds - (iy, ix)) ** 2).sum(axis=1), initial=radius * radius + 1)
        cost = table[square] if square <= radius * radius else 0
        out[iy, ix] = (cost if cost >= unknown_from else old) if old == 255 else max(old, cost)
    return out


@given(GRIDS, st.integers(0, 20), st.sampled_from([1, 253]))
@settings(max_examples=40, deadline=None)
def test_inflation_is_the_distance_to_the_nearest_seed(cells, radius, unknown_from):
    table = cost_table(radius, 0.05, 0.12, 4.0)
    out = cells.copy()
    inflate(out, (cells == 254).view(np.uint8), (0, 0, *cells.shape[::-1]), table, radius, unknown_from)
    assert np.array_equal(out, slow_inflation(cells, table, radius, unknown_from))


@given(GRIDS, st.integers(0, 17), st.data())
@settings(max_examples=40, deadline=None)
def test_inflating_a_box_changes_only_the_box_and_sees_seeds_around_it(cells, radius, data):
    height, width = cells.shape
    x0, y0 = data.draw(st.integers(0, width - 1)), data.draw(st.integers(0, height - 1))
    x1, y1 = data.draw(st.integers(x0 + 1, width)), data.draw(st.integers(y0 + 1, height))
    table = cost_table(radius, 0.05, 0.12, 4.0)
    out = cells.copy()
    inflate(out, (cells == 254).view(np.uint8), (x0, y0, x1, y1), table, radius, 253)
    expected = cells.copy()
    expected[y0:y1, x0:x1] = slow_inflation(cells, table, radius, 253)[y0:y1, x0:x1]
    assert np.array_equal(out, expected)


def test_the_largest_radius_is_exact_too():
    cells = np.zeros((3, 300), dtype=np.uint8)
    cells[1, 0] = 254
    radius = 253
    table = np.ones(radius * radius + 1, dtype=np.uint8)
    inflate(cells, (cells == 254).view(np.uint8), (0, 0, 300, 3), table, radius, 253)
    assert np.flatnonzero(cells[1])[-1] == 253 and np.flatnonzero(cells[0])[-1] == 252


def clipped_area_bounds(polygon, x, y):
    """Part of a convex polygon in the closed unit cell at (x, y), by Sutherland and Hodgman."""
    points = [tuple(p) for p in polygon]
    for axis, bound, sign in ((0, x, 1), (0, x + 1, -1), (1, y, 1), (1, y + 1, -1)):
        kept = []
        for a, b in zip(points, points[1:] + points[:1], strict=True):
            da, db = sign * (a[axis] - bound), sign * (b[axis] - bound)
            if da >= 0:
                kept.append(a)
            if (da > 0) != (db > 0) and da != db:
                t = da / (da - db)
                kept.append((a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])))
        points = kept
    return np.array(points).reshape(-1, 2)


@given(st.integers(3, 8), st.floats(0.05, 3.0), st.floats(-4, 4), st.floats(-4, 4), st.floats(0, 7), st.data())
@settings(max_examples=50, deadline=None)
def test_cover_holds_all_cells_the_polygon_enters_and_none_it_does_not_touch(corners, size, x, y, turn, data):
    angles = turn + 2 * np.pi * np.arange(corners) / corners
    stretch = data.draw(st.floats(0.1, 1.0))
    polygon = np.column_stack([x + size * np.cos(angles), y + stretch * size * np.sin(angles)])
    x0, y0, mask = rasterise_polygon(polygon, (-20, -20, 20, 20))
    for iy in range(-8, 8):
        for ix in range(-8, 8):
            row, column = iy - y0, ix - x0
            covered = 0 <= row < mask.shape[0] and 0 <= column < mask.shape[1] and bool(mask[row, column])
            part = clipped_area_bounds(polygon, ix, iy)
            assert len(part) or not covered or min(abs(polygon - [ix, iy]).min(), 1e-6) <= 1e-6
            assert covered or not len(part) or np.ptp(part, axis=0).min() <= 1e-6


def test_a_concave_polygon_leaves_its_notch_out():
    notched = np.array([(0.5, 0.5), (5.5, 0.5), (5.5, 4.5), (4.5, 4.5), (4.5, 1.5), (1.5, 1.5), (1.5, 4.5), (0.5, 4.5)])
    _, _, mask = rasterise_polygon(notched, (0, 0, 10, 10))
    assert mask.tolist() == [[1] * 6, [1] * 6, [1, 1, 0, 0, 1, 1], [1, 1, 0, 0, 1, 1], [1, 1, 0, 0, 1, 1]]


def test_a_polygon_on_grid_lines_covers_the_cells_right_and_above():
    square = np.array([(2.0, 2.0), (4.0, 2.0), (4.0, 4.0), (2.0, 4.0)])
    x0, y0, mask = rasterise_polygon(square, (0, 0, 10, 10))
    assert (x0, y0) == (2, 2) and mask.tolist() == [[1, 1, 1]] * 3


def test_a_polygon_far_larger_than_the_grid_costs_no_more_than_the_grid():
    cells = np.zeros((4, 5), dtype=np.uint8)
    huge = np.array([(-1e6, -1e6), (1e6, -1e6), (1e6, 1e6), (-1e6, 1e6)])
    assert fill_polygon(cells, huge, 7) == (0, 0, 5, 4)
    assert (cells == 7).all()


@given(hnp.arrays(np.uint8, (6, 7), elements=st.sampled_from([0, 253, 254, 255])), SIXTEENTHS, SIXTEENTHS)
@settings(max_examples=50, deadline=None)
def test_blocked_cells_are_the_lethal_ones_of_a_map_in_a_lethal_frame(cells, x, y):
    framed = np.full((26, 27), 254, dtype=np.uint8)
    framed[10:16, 10:17] = cells
    polygon = np.array([(x - 1.25, y - 1.0), (x + 1.875, y), (x, y + 1.75)])
    covered, lethal, *_ = polygon_costs(framed, polygon + 10.0)
    assert blocked_under(cells, polygon, True) == (lethal, covered)
    framed[framed == 254] = 0
    framed[10:16, 10:17] = cells
    _, lethal, *_ = polygon_costs(framed, polygon + 10.0)
    assert blocked_under(cells, polygon, False) == (lethal, covered), "off the grid is free unless asked for"


def test_the_summary_of_a_polygon_off_the_map_is_outside():
    cells = np.zeros((4, 5), dtype=np.uint8)
    assert polygon_costs(cells, np.array([(4.0, 1.0), (5.0, 1.0), (4.5, 2.0)])) == (-1, 0, 0, 0, 0, 0)


def slow_line(x0, y0, x1, y1):
    """Bresenham with costmap_2d's rounding."""
    dx, dy = abs(x1 - x0), abs(y1 - y0)
    cells, error, longer = [(x0, y0)], max(dx, dy) // 2, max(dx, dy)
    sx, sy = (1 if x1 > x0 else -1), (1 if y1 > y0 else -1)
    for _ in range(longer):
        error += min(dx, dy)
        side = error >= longer
        error -= longer if side else 0
        x0 += sx if dx >= dy or side else 0
        y0 += sy if dy > dx or side else 0
        cells.append((x0, y0))
    return cells


COORDINATES = st.floats(0.0, 0.99)


@given(COORDINATES, COORDINATES, COORDINATES, COORDINATES)
@settings(max_examples=60, deadline=None)
def test_a_ray_clears_the_cells_of_its_line(x0, y0, x1, y1):
    grid = GridGeometry(20, 20, 0.05)
    cells = np.full((20, 20), 254, dtype=np.uint8)
    touched = np.zeros(4, dtype=np.int64)
    clear_rays(cells, np.zeros(2), 0.05, np.array([x0, y0, 0.0]), np.array([[x1, y1, 0.0]]), 0.0, 9.0, 0, touched)
    line = slow_line(*grid.world_to_cell_unbounded(x0, y0), *_end_cell(x0, y0, x1, y1))
    assert sorted(zip(*np.nonzero(cells == 0)[::-1], strict=True)) == sorted(set(line))
    xs, ys = zip(*line, strict=True)
    assert touched.tolist() == [min(xs), min(ys), max(xs) + 1, max(ys) + 1]


def _end_cell(x0, y0, x1, y1):
    """The kernel computes the end as start + difference; rounding may matter on a grid line."""
    return int(x0 / 0.05 + (x1 / 0.05 - x0 / 0.05)), int(y0 / 0.05 + (y1 / 0.05 - y0 / 0.05))


def test_a_ray_from_outside_clears_the_part_on_the_map():
    cells = np.full((5, 5), 254, dtype=np.uint8)
    sensor, ends = np.array([-3.0, 2.5, 0.0]), np.array([[9.0, 2.5, 0.0]])
    clear_rays(cells, np.zeros(2), 1.0, sensor, ends, 0.0, 100.0, 0, np.zeros(4, dtype=np.int64))
    assert (cells[2] == 0).all() and np.count_nonzero(cells == 0) == 5


def test_a_ray_clears_only_between_its_two_ranges():
    cells = np.full((1, 10), 254, dtype=np.uint8)
    sensor, ends = np.array([0.5, 0.5, 0.0]), np.array([[9.5, 0.5, 0.0]])
    clear_rays(cells, np.zeros(2), 1.0, sensor, ends, 2.0, 5.0, 0, np.zeros(4, dtype=np.int64))
    assert np.flatnonzero(cells[0] == 0).tolist() == [2, 3, 4, 5]


@given(st.lists(st.tuples(st.floats(-2, 12), st.floats(-2, 12), st.booleans()), max_size=20))
@settings(max_examples=50, deadline=None)
def test_hits_in_range_are_marked_where_they_are(points):
    grid, cells = GridGeometry(10, 10, 1.0), np.zeros((10, 10), dtype=np.uint8)
    ends = np.array([(x, y, 0.0) for x, y, _ in points]).reshape(-1, 3)
    hits = np.array([hit for *_, hit in points], dtype=bool)
    mark_points(cells, np.zeros(2), 1.0, np.zeros(3), ends, hits, 1.0, 8.0, 254, np.zeros(4, dtype=np.int64))
    near = {grid.world_to_cell(x, y) for x, y, hit in points if hit and 1.0 <= math.sqrt(x * x + y * y) <= 8.0}
    assert set(zip(*np.nonzero(cells)[::-1], strict=True)) == near - {None}


@given(hnp.arrays(np.bool_, (7, 9)), st.integers(1, 5), st.sampled_from([4, 8]))
@settings(max_examples=40, deadline=None)
def test_small_groups_are_found_by_flood_fill(obstacles, minimal_size, connectivity):
    steps = [(-1, 0), (1, 0), (0, -1), (0, 1)] + [(-1, -1), (-1, 1), (1, -1), (1, 1)] * (connectivity == 8)
    expected = np.zeros_like(obstacles)
    for start in np.argwhere(obstacles):
        group, work = {tuple(start)}, [tuple(start)]
        while work:
            y, x = work.pop()
            for neighbour in {(y + dy, x + dx) for dy, dx in steps} - group:
                if 0 <= neighbour[0] < 7 and 0 <= neighbour[1] < 9 and obstacles[neighbour]:
                    group.add(neighbour)
                    work.append(neighbour)
        expected[tuple(start)] = len(group) < minimal_size
    assert np.array_equal(small_groups(obstacles, minimal_size, connectivity), expected)


@given(st.integers(0, 2**32 - 1))
@settings(deadline=None)
def test_bits_are_counted(word):
    assert count_bits(np.uint32(word)) == word.bit_count()


def test_a_ray_through_voxels_leaves_other_heights_alone():
    marked, seen = np.full((1, 10), 0b1001, dtype=np.uint32), np.full((1, 10), 0b1001, dtype=np.uint32)
    sensor, ends = np.array([0.5, 0.5, 3.5]), np.array([[9.5, 0.5, 3.5]])
    touched = np.zeros(4, dtype=np.int64)
    clear_voxel_rays(marked, seen, 4, np.zeros(3), np.ones(3), sensor, ends, 0.0, 50.0, touched)
    assert (marked == 0b0001).all() and (seen == 0b1001).all() and touched.tolist() == [0, 0, 10, 1]


def test_columns_become_lethal_free_or_unknown_by_their_thresholds():
    marked = np.array([[0b11, 0b01, 0b00, 0b00]], dtype=np.uint32)
    seen = np.array([[0b11, 0b11, 0b01, 0b00]], dtype=np.uint32)
    cells = np.full((1, 4), 9, dtype=np.uint8)
    project_columns(marked, seen, 4, 1, 2, 255, cells, (0, 0, 4, 1))
    assert cells.tolist() == [[254, 0, 255, 255]]


def test_the_maximum_of_two_layers_gives_way_to_whatever_is_known():
    cells, layer = np.meshgrid(np.arange(256, dtype=np.uint8), np.arange(256, dtype=np.uint8))
    combined = cells.copy()
    combine(combined, layer, CellBox(0, 0, 256, 256), CombinationMethod.MAXIMUM)
    for (old, new), result in zip(np.stack([cells, layer], axis=-1).reshape(-1, 2), combined.ravel(), strict=True):
        known = [value for value in (old, new) if value != 255]
        assert result == max(known, default=255)
