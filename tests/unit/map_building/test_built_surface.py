"""The surface under a cloud: near to the true ground, whole on several levels, and none where something stands."""

from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from surveyed_ground import bridge, flat, ground, hills, post, rectangle, tree

from mbf_mesh_nav.building.outliers import isolated_points
from mbf_mesh_nav.building.surface import SurfaceParameters, build_surface, cell_for
from mbf_mesh_nav.kernels.building.columns import LOWEST, SLAB, TOP, sort_into_cells, split_columns
from mbf_mesh_nav.kernels.building.patches import STEP_X, STEP_Y, link_patches
from mbf_mesh_nav.kernels.building.quads import fitted_heights
from mbf_mesh_nav.map.map_builder import build_mesh_map
from mbf_mesh_nav.map.map_parameters import default_layers
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.mesh.mesh_report import MeshError


@pytest.fixture
def rng():
    return np.random.default_rng(11)


def vertices_near(surface, x, y, radius):
    return surface.vertices[np.hypot(surface.vertices[:, 0] - x, surface.vertices[:, 1] - y) < radius]


def parts_of(surface):
    return int(MeshMap.from_arrays(surface.vertices, surface.faces).components.max()) + 1


def test_the_surface_is_nearer_to_the_ground_than_the_noise(rng):
    surface = build_surface(ground(rng, hills))
    errors = surface.vertices[:, 2] - hills(*surface.vertices[:, :2].T)
    assert surface.patches.grid.cell == 0.2
    assert np.sqrt((errors * errors).mean()) < 0.015
    assert abs(errors.mean()) < 0.002
    assert len(surface.vertices) > 0.95 * 80 * 60


def test_the_distances_are_those_of_points_to_the_faces(rng):
    surface = build_surface(ground(rng, hills))
    mesh_map = MeshMap.from_arrays(surface.vertices, surface.faces)
    some = np.flatnonzero(np.isfinite(surface.distances))[::97]
    above = surface.points[some] + [0.0, 0.0, 5.0]
    _, lengths = mesh_map.locator.cast_rays(above, np.tile([0.0, 0.0, -1.0], (len(some), 1)))
    np.testing.assert_allclose(surface.distances[some], lengths - 5.0, atol=1e-5)
    assert np.isfinite(surface.distances).mean() > 0.95


def test_the_mesh_has_no_defect_and_faces_up(rng):
    surface = build_surface(np.vstack([ground(rng, hills), tree(rng, 5.0, 5.0, hills(5.0, 5.0))]))
    mesh_map = MeshMap.from_arrays(surface.vertices, surface.faces)
    assert mesh_map.report.findings == []
    assert (mesh_map.face_normals[:, 2] > 0.0).all()


def test_there_is_no_surface_where_a_tree_or_a_post_stands_but_below_the_crown(rng):
    places = [(4.0, 4.0), (9.1, 6.3), (12.4, 3.2)]
    trees = [tree(rng, x, y, hills(x, y)) for x, y in places[:2]]
    surface = build_surface(np.vstack([ground(rng, hills), *trees, post(rng, *places[2], hills(*places[2]))]))
    for x, y in places:
        assert len(vertices_near(surface, x, y, 0.15)) == 0
        assert len(vertices_near(surface, x, y, 1.2)) > 50
    assert surface.vertices[:, 2].max() < 2.5


def test_grass_of_ten_centimetres_is_driven_over(rng):
    blades = ground(rng, flat, noise=0.0)
    blades[:, 2] = rng.uniform(0.0, 0.1, len(blades))
    surface = build_surface(np.vstack([ground(rng, flat)[::2], blades[::2]]))
    assert not surface.is_obstacle.any()
    assert 0.0 < surface.vertices[:, 2].mean() < 0.03
    parameters, blocks = default_layers(inscribed_radius=0.3)
    mesh_map = build_mesh_map(parameters, blocks, vertices=surface.vertices, faces=surface.faces)
    assert {name: int(mesh_map.layers[name].lethal.sum()) for name in ("steepness", "roughness", "height_diff")} == {
        "steepness": 0,
        "roughness": 0,
        "height_diff": 0,
    }


def test_a_bridge_and_the_road_below_it_are_one_map_on_two_levels(rng):
    surface = build_surface(bridge(rng))
    deck = vertices_near(surface, 16.0, 6.0, 1.0)
    assert set(np.round(deck[:, 2])) == {0.0, 3.0}
    up_the_ramp = vertices_near(surface, 6.0, 6.0, 0.3)
    np.testing.assert_allclose(up_the_ramp[:, 2], 0.25 * up_the_ramp[:, 0], atol=0.04)
    assert parts_of(surface) == 2  # the road passes between the abutments: over the deck one does not come to it


def test_storeys_whose_slabs_were_seen_from_both_sides_lie_on_their_tops_and_are_no_noise(rng):
    heights = (0.0, 2.6, 3.0, 5.6, 6.0)  # a floor, and two slabs of 0.4 m
    surface = build_surface(np.vstack([rectangle(rng, (0.0, 12.0), (0.0, 8.0), (z, z)) for z in heights]))
    nearest = np.array((0.0, 3.0, 6.0))[np.rint(surface.vertices[:, 2] / 3.0).astype(int)]
    np.testing.assert_allclose(surface.vertices[:, 2], nearest, atol=0.2)
    assert np.std(surface.vertices[:, 2] - nearest) < 0.02
    assert [np.count_nonzero(nearest == z) > 4000 for z in (0.0, 3.0, 6.0)] == [True, True, True]
    assert np.percentile(surface.height_errors, 99.0) < 0.05


def test_storeys_do_not_make_the_cells_smaller(rng):
    floor = ground(rng, flat)
    assert cell_for(floor) == cell_for(np.vstack([np.add(floor, (0.0, 0.0, 3.1 * level)) for level in range(4)])) == 0.2


def test_a_dense_scan_does_not_make_the_cells_finer_than_a_robot_needs_and_its_map_is_more_even(rng):
    points = np.vstack([ground(rng, hills, size=(8.0, 6.0)) for _ in range(20)])
    assert cell_for(points) == 0.1
    chosen, finer = (build_surface(points, SurfaceParameters(cell=cell)) for cell in (0.0, 0.05))
    errors = [np.std(each.vertices[:, 2] - hills(*each.vertices[:, :2].T)) for each in (chosen, finer)]
    assert errors[0] < 0.8 * errors[1]


def test_a_cloud_that_lies_on_its_side_is_told_which_axis_is_flattest(rng):
    with pytest.raises(
        MeshError, match=r"no surface of 10 m² in it\. It is flattest along y: if that is up, choose --up y"
    ):
        build_surface(ground(rng, flat)[:, [0, 2, 1]])


def test_holes_are_filled_up_to_the_width_and_stay_where_they_are_wider(rng):
    points = ground(rng, hills)
    for x, y, radius in ((4.0, 6.0, 0.35), (11.0, 6.0, 1.5)):
        points = points[np.hypot(points[:, 0] - x, points[:, 1] - y) > radius]
    filled, open_ = (build_surface(points, SurfaceParameters(hole_width=width)) for width in (1.0, 0.0))
    assert len(vertices_near(open_, 4.0, 6.0, 0.2)) == 0
    inside = vertices_near(filled, 4.0, 6.0, 0.3)
    np.testing.assert_allclose(inside[:, 2], hills(*inside[:, :2].T), atol=0.05)
    assert len(vertices_near(filled, 11.0, 6.0, 1.0)) == 0
    np.testing.assert_array_equal(filled.vertices.min(axis=0)[:2], open_.vertices.min(axis=0)[:2])


def test_a_wider_limit_never_fills_less(rng):
    points = ground(rng, hills, size=(10.0, 8.0))
    for x, y, radius in rng.uniform((0.0, 0.0, 0.2), (10.0, 8.0, 1.2), (18, 3)).tolist():
        points = points[np.hypot(points[:, 0] - x, points[:, 1] - y) > radius]
    places = [set()]
    for width in (0.0, 0.5, 1.0, 1.5, 2.0, 3.0):
        surface = build_surface(points, SurfaceParameters(cell=0.25, hole_width=width))
        places.append(set(map(tuple, surface.vertices[:, :2].tolist())))
        assert places[-2] <= places[-1]
    assert len(places[-1]) > 1.1 * len(places[1])


def test_nothing_is_filled_through_a_wall_on_an_upper_floor(rng):
    floors = [rectangle(rng, (0.0, 12.0), (0.0, 8.0), (z, z)) for z in (0.0, 3.0)]
    wall = np.column_stack([rng.uniform(5.95, 6.05, 6000), rng.uniform(0.0, 8.0, 6000), rng.uniform(0.0, 5.5, 6000)])
    surface = build_surface(np.vstack([*floors, wall]))
    assert parts_of(surface) == 4
    upper = surface.vertices[surface.vertices[:, 2] > 1.5]
    assert np.abs(upper[:, 0] - 6.0).min() > 0.1


def test_a_car_roof_is_left_out_as_a_small_surface(rng):
    roof = rectangle(rng, (4.0, 8.0), (4.0, 5.8), (1.6, 1.6))
    surface = build_surface(np.vstack([ground(rng, flat), roof]))
    assert surface.vertices[:, 2].max() < 0.2
    assert 5.0 < surface.is_small.sum() * 0.04 < 9.0  # 4 x 1.8 m in whole cells


def test_points_below_the_ground_and_in_the_air_are_left_out(rng):
    strays = np.array([[4.0, 4.0, -3.0], [8.0, 8.0, 6.0], [10.0, 3.0, -0.5], [10.0, 9.0, 12.0]])
    clean = ground(rng, flat)
    surface = build_surface(np.vstack([strays, clean]))
    assert surface.is_outlier[[0, 1, 3]].all()
    assert surface.is_outlier[4:].mean() < 0.001
    assert np.abs(surface.vertices[:, 2]).max() < 0.1  # the third one is too near to be isolated and is still no ground


@pytest.mark.parametrize("quantum", [0.0, 0.01])
def test_the_order_of_the_points_does_not_change_a_bit(rng, quantum):
    points = np.vstack([ground(rng, hills), tree(rng, 5.0, 5.0, hills(5.0, 5.0))])
    points = np.round(points / quantum) * quantum if quantum else points
    one, other = build_surface(points), build_surface(points[rng.permutation(len(points))])
    assert one.vertices.tobytes() == other.vertices.tobytes()
    assert one.faces.tobytes() == other.faces.tobytes()


@pytest.mark.parametrize(
    ("points", "text"),
    [
        (np.zeros((1, 3)), "1 points are too few for a map, the least is 100"),
        (np.zeros((500, 3)), "all of its points lie on one line"),
        (np.linspace((0, 0, 0), (30, 10, 2), 500), "all of its points lie on one line"),
        (np.random.default_rng(1).uniform(0, 300, (200, 3)), "points are isolated"),
        (np.random.default_rng(1).uniform(0, (2, 2, 0.1), (400, 3)), "there is no surface of 10 m² in it"),
    ],
)
def test_points_that_are_no_map_are_refused(points, text):
    with pytest.raises(MeshError, match=text):
        build_surface(points)


def test_walls_at_one_height_are_known_for_those_of_a_planar_scanner(rng):
    along = rng.uniform(0.0, 10.0, 4000)
    walls = [
        np.column_stack(pair) for pair in ((along, 0.0 * along), (0.0 * along, along), (along, 10.0 + 0.0 * along))
    ]
    points = np.column_stack([np.vstack(walls) + rng.normal(0.0, 0.01, (12000, 2)), np.full(12000, 0.2)])
    with pytest.raises(MeshError, match="A planar scanner sees walls and no ground; a 3D sensor is needed"):
        build_surface(points)


def test_too_large_a_grid_is_refused():
    corners = np.random.default_rng(1).uniform(0.0, 1.0, (200, 3))
    corners[50:100, 0] += 40_000.0
    corners[100:, 1] += 40_000.0
    with pytest.raises(MeshError, match=r"80\d* x 80\d* cells of 0.5 m are too many.*larger ones with --cell"):
        build_surface(corners, SurfaceParameters(cell=0.5))


def test_what_a_step_raises_ends_the_building(rng):
    steps = []

    def on_step(name):
        steps.append(name)
        if name == "holes":
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        build_surface(ground(rng, flat), on_step=on_step)
    assert steps == ["outliers", "surfaces", "holes"]


# Naive twins of the kernels.


def some_points(seed, count):
    return np.round(np.random.default_rng(seed).uniform((0, 0, 0), (3, 2, 6), (count, 3)), 1)


@given(st.integers(0, 10_000), st.integers(1, 60))
def test_points_are_sorted_by_cell_and_height_and_then_by_place(seed, count):
    points = some_points(seed, count)
    by_height = np.argsort(points[:, 2], kind="stable")
    offsets, ordered = sort_into_cells(points, by_height, np.zeros(2), 1.0, 3, 2)
    cells = [int(min(y, 1.99)) * 3 + int(min(x, 2.99)) for x, y, _ in points.tolist()]
    naive = sorted(zip(cells, points.tolist(), strict=True), key=lambda one: (one[0], one[1][2], one[1][0], one[1][1]))
    assert ordered.tolist() == [point for _, point in naive]
    assert np.diff(offsets).tolist() == [Counter(cells)[cell] for cell in range(6)]


def naive_runs(heights, gap):
    runs = [[heights[0]]]
    for height in heights[1:]:
        if height - runs[-1][-1] <= gap:
            runs[-1].append(height)
        else:
            runs.append([height])
    return runs


@given(st.integers(0, 10_000), st.integers(1, 60))
def test_columns_are_split_at_gaps_as_by_the_naive_twin(seed, count):
    points = some_points(seed, count)
    offsets, ordered = sort_into_cells(points, np.argsort(points[:, 2], kind="stable"), np.zeros(2), 1.0, 3, 2)
    expected = []
    for cell in range(6):
        heights = ordered[offsets[cell] : offsets[cell + 1], 2].tolist()
        for number, run in enumerate(naive_runs(heights, 0.9) if heights else []):
            is_thick = run[-1] - run[0] > 1.2
            kinds = (
                ([LOWEST] if number == 0 else [])
                + ([TOP] if is_thick else [])
                + ([SLAB] if number and not is_thick else [])
            )
            expected += [(cell, kind, run) for kind in kinds]
    cells, firsts, ends, kinds = split_columns(ordered, offsets, 0.9, 1.2)
    runs = [ordered[first:end, 2].tolist() for first, end in zip(firsts, ends, strict=True)]
    assert list(zip(cells.tolist(), kinds.tolist(), runs, strict=True)) == expected


@given(st.integers(0, 10_000))
def test_links_are_mutual_choices_of_the_nearest_height(seed):
    rng = np.random.default_rng(seed)
    columns, rows, rise = 4, 3, 0.7
    counts = rng.integers(0, 3, columns * rows)
    cells = np.repeat(np.arange(columns * rows), counts).astype(np.int32)
    heights = np.concatenate([np.sort(rng.uniform(0.0, 2.0, count)) for count in counts])
    offsets = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)

    def choice(patch, direction):
        x, y = cells[patch] % columns + STEP_X[direction], cells[patch] // columns + STEP_Y[direction]
        there = [q for q in range(len(cells)) if cells[q] == y * columns + x and 0 <= x < columns]
        limit = rise * (np.sqrt(2.0) if direction % 2 else 1.0)
        near = [q for q in there if abs(heights[q] - heights[patch]) <= limit]
        return min(near, key=lambda q: abs(heights[q] - heights[patch]), default=-1)

    links = link_patches(cells, heights, offsets, columns, rise)
    for patch in range(len(cells)):
        for direction in range(8):
            other = choice(patch, direction)
            is_mutual = other >= 0 and choice(other, (direction + 4) % 8) == patch
            assert links[patch, direction] == (other if is_mutual else -1)


@settings(max_examples=30)
@given(st.integers(0, 10_000), st.integers(1, 5))
def test_isolated_points_are_those_with_few_points_in_the_voxels_around(seed, least):
    points = np.random.default_rng(seed).uniform(0.0, 4.0, (60, 3))
    voxels = [tuple(voxel) for voxel in np.floor(points - points.min(axis=0)).astype(int).tolist()]
    around = [sum(max(abs(a - b) for a, b in zip(one, other, strict=True)) <= 1 for other in voxels) for one in voxels]
    np.testing.assert_array_equal(isolated_points(points, 1.0, least), np.array(around) < least)


def naive_fit(points, patch_of, centres, heights, columns, cell, within, improbable):
    """``fitted_heights`` on a whole grid of cells, by planes through the three corners of the face below each point."""
    gains = np.zeros((len(heights), 3))
    for point, patch in zip(points, patch_of, strict=True):
        step = np.where(point[:2] >= centres[patch], 1, -1)
        row, column = divmod(int(patch), columns)
        if not (0 <= column + step[0] < columns and 0 <= row + step[1] < len(heights) // columns):
            continue
        first, last = patch + step[0], patch + step[1] * columns
        across = last + step[0]
        x, y = np.abs(point[:2] - centres[patch]) / cell
        if abs(heights[across] - heights[patch]) < abs(heights[last] - heights[first]):
            corners = [patch, first, across] if x >= y else [patch, across, last]
        else:
            corners = [patch, first, last] if x + y <= 1.0 else [first, across, last]
        weights = np.linalg.solve(np.vstack([centres[corners].T, np.ones(3)]), [*point[:2], 1.0])
        distance = point[2] - weights @ heights[corners]
        if abs(distance) <= within:
            gains[corners] += np.column_stack([weights * distance, weights, weights**2])
    is_moved = np.abs(gains[:, 0]) > improbable * np.sqrt(gains[:, 2])
    return heights + np.where(is_moved, gains[:, 0] / (gains[:, 1] + 0.5), 0.0)


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 1000), st.floats(0.0, 0.1))
def test_heights_move_towards_their_points_as_by_the_naive_twin(seed, improbable):
    rng = np.random.default_rng(seed)
    columns, rows, cell, each = 5, 4, 0.5, 3
    column, row = np.arange(columns * rows) % columns, np.arange(columns * rows) // columns
    centres = cell * (np.column_stack([column, row]) + 0.5)
    heights = rng.normal(0.0, 0.1, columns * rows)
    patch_of = np.repeat(np.arange(columns * rows), each)
    xy = centres[patch_of] + rng.uniform(-0.5 * cell, 0.5 * cell, (len(patch_of), 2))
    points = np.column_stack([xy, rng.normal(0.0, 0.15, len(patch_of))])
    offsets = np.arange(columns * rows + 1, dtype=np.int32)
    links = link_patches(offsets[:-1], heights, offsets, columns, 10.0)
    firsts = each * np.arange(columns * rows)
    limits = np.array([0.2, improbable])
    fitted = fitted_heights(points, firsts, firsts + each, centres, heights, links, cell, limits)
    expected = naive_fit(points, patch_of, centres, heights, columns, cell, *limits)
    np.testing.assert_allclose(fitted, expected, rtol=0, atol=1e-9)


def test_bumps_are_flattened_less_than_by_the_means_of_their_cells(rng, monkeypatch):
    def bumps(x, y):
        return 0.12 * np.cos(2.5 * np.pi * x) * np.cos(2.5 * np.pi * y)

    points, places = ground(rng, bumps), rng.uniform(1.0, 11.0, (2000, 2))

    def kept_share():
        surface = build_surface(points)
        locator = MeshMap.from_arrays(surface.vertices, surface.faces).locator
        above = np.column_stack([places, np.full(len(places), 5.0)])
        heights = 5.0 - locator.cast_rays(above, np.tile([0.0, 0.0, -1.0], (len(places), 1)))[1]
        true = bumps(*places.T)
        return (true * heights).sum() / (true * true).sum()

    fitted = kept_share()
    monkeypatch.setattr("mbf_mesh_nav.building.heights.FITTINGS", 0)
    assert fitted > kept_share() + 0.05
