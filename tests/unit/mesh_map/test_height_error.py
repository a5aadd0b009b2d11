"""Limits of layers are narrower by what the errors of a map's heights do to slopes and steps."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mbf_mesh_nav.building.map_build import write_map
from mbf_mesh_nav.files.map_header import MapHeader, read_map_header
from mbf_mesh_nav.files.mesh_io import read_mesh
from mbf_mesh_nav.files.vertex_errors import EARLIER_VERTEX, VERTEX, VertexErrors, read_vertex_errors
from mbf_mesh_nav.kernels.layers.footprint_settling import settle_footprints, wheel_directions
from mbf_mesh_nav.kernels.layers.wheel_errors import errors_below_wheels
from mbf_mesh_nav.layers.height_diff import HeightDiffLayer
from mbf_mesh_nav.layers.steepness import SteepnessLayer
from mbf_mesh_nav.layers.tilt import HEADINGS, TiltLayer
from mbf_mesh_nav.map.height_error import slope_error
from mbf_mesh_nav.map.layer import LayerContext
from mbf_mesh_nav.map.map_builder import build_mesh_map
from mbf_mesh_nav.map.map_parameters import default_layers
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh
from mbf_mesh_nav.mesh.mesh_report import MeshError

ERROR = 0.01
LAYERS = ("steepness", "roughness", "height_diff")


def computed(mesh, layer_class, errors=None, **parameters):
    chosen = layer_class.Parameters(**parameters)
    context = LayerContext("layer", mesh.topology, mesh.locator, chosen, height_errors=errors)
    layer = layer_class(context)
    layer.recompute()
    return layer


def ramp(slope, spacing=0.1):
    return heightfield_mesh(np.tile(np.arange(21) * spacing * np.tan(slope), (21, 1)), spacing, spacing)


def noisy_plane():
    return MeshMap.from_heights(np.random.default_rng(2).normal(0.0, ERROR, (80, 80)), 0.2, 0.2)


@pytest.fixture
def map_file(tmp_path):
    """A ramp of 0.55 rad, and a function that writes it with an error of its heights, or one of each vertex."""

    def write(height_error, errors=None, of_places=None):
        file = tmp_path / f"ramp_{height_error}.ply"
        stated = None if errors is None else VertexErrors(errors, errors if of_places is None else of_places)
        write_map(file, *ramp(0.55), MapHeader((0.0, 0.0, 0.0), 0.02, 0.04, height_error), stated)
        return str(file)

    return write


def built(file, **blocks):
    parameters, defaults = default_layers(0.3)
    parameters = parameters.model_copy(update={"mesh_file": file})
    return build_mesh_map(parameters, {name: {**defaults.get(name, {}), **blocks.get(name, {})} for name in LAYERS})


def test_a_map_file_with_a_negative_error_states_none(map_file):
    assert read_map_header(Path(map_file(-0.05))) is None
    assert read_map_header(Path(map_file(0.05))).height_error == 0.05


def test_the_slope_between_two_wrong_heights_is_as_wrong_as_stated():
    heights = np.random.default_rng(1).normal(0.0, ERROR, (2, 20_000))
    slopes = np.arctan((heights[1] - heights[0]) / 0.5)
    assert slope_error(ERROR, 0.5) == pytest.approx(slopes.std(), rel=0.02)
    np.testing.assert_array_equal(slope_error(np.full(3, ERROR), 0.5), slope_error(ERROR, 0.5))


def test_a_normal_over_wrong_heights_is_as_wrong_as_stated():
    mesh = noisy_plane()
    layer = computed(mesh, SteepnessLayer, height_error=ERROR)
    inner = ~mesh.topology.border_vertices
    along_x, along_y = (np.arctan(mesh.vertex_normals[inner, axis] / mesh.vertex_normals[inner, 2]) for axis in (0, 1))
    assert layer.normal_error == pytest.approx(along_x.std(), rel=0.04)
    assert layer.normal_error == pytest.approx(along_y.std(), rel=0.04)


def test_wrong_heights_never_make_a_plane_smoother():
    assert computed(noisy_plane(), HeightDiffLayer, radius=0.5).costs.min() > ERROR


@settings(deadline=None, max_examples=15)
@given(st.floats(0.0, 0.05), st.floats(0.0, 0.05))
def test_a_greater_error_closes_more_ground_and_opens_none(one, other):
    rng = np.random.default_rng(3)
    mesh = MeshMap.from_heights(rng.normal(0.0, 0.08, (14, 14)), 0.2, 0.2)
    less, more = sorted((one, other))
    for layer_class, chosen in ((SteepnessLayer, {}), (HeightDiffLayer, {}), (TiltLayer, {"rigid": True})):
        low, high = (computed(mesh, layer_class, height_error=error, **chosen) for error in (less, more))
        assert (high.lethal | ~low.lethal).all()
        if layer_class is TiltLayer:
            assert (low.allowed | ~high.allowed).all()


@settings(deadline=None, max_examples=15)
@given(st.floats(0.0, 0.05), st.sampled_from([0.0, 0.25, 0.5, 2.0]))
def test_a_margin_of_some_errors_is_as_so_many_times_the_error(error, margin):
    rng = np.random.default_rng(4)
    mesh = MeshMap.from_heights(rng.normal(0.0, 0.08, (14, 14)), 0.2, 0.2)
    stated = rng.uniform(0.0, error, 14 * 14)
    for layer_class, chosen in ((SteepnessLayer, {}), (HeightDiffLayer, {}), (TiltLayer, {"rigid": True})):
        one = computed(mesh, layer_class, stated, error_margin=margin, **chosen)
        other = computed(mesh, layer_class, margin * stated, **chosen)
        np.testing.assert_array_equal(one.lethal, other.lethal)
        np.testing.assert_array_equal(one.lethal_for_good, computed(mesh, layer_class, **chosen).lethal)
        one = computed(mesh, layer_class, height_error=error, error_margin=margin, **chosen)
        other = computed(mesh, layer_class, height_error=margin * error, **chosen)
        np.testing.assert_array_equal(one.lethal, other.lethal)


def test_limits_and_clearance_of_the_footprint_are_lower_by_the_error():
    mesh = MeshMap.from_arrays(*ramp(0.3))
    exact, wrong = (computed(mesh, TiltLayer, height_error=error) for error in (None, ERROR))
    slopes = [np.arctan(np.sqrt(2.0) * ERROR / length) for length in (0.4, 0.5, 0.5)]
    np.testing.assert_allclose(np.subtract(exact.limits(), wrong.limits()), slopes)
    assert wrong.room_below == pytest.approx(wrong.parameters.ground_clearance - 1.5 * ERROR)


def test_layers_take_the_error_from_the_map_file(map_file):
    exact, wrong = built(map_file(0.0)), built(map_file(0.02))
    assert not exact.layers["steepness"].lethal.any()
    assert wrong.layers["steepness"].lethal.all()
    assert [wrong.layers[name].parameters.height_error for name in ("steepness", "height_diff")] == [0.02, 0.02]
    assert "standard error of its heights 0.020 m" in str(wrong.report)


def test_an_error_that_the_configuration_states_wins(map_file):
    mesh_map = built(map_file(0.02), steepness={"height_error": 0.0})
    assert not mesh_map.layers["steepness"].lethal.any()
    assert mesh_map.layers["height_diff"].parameters.height_error == 0.02


def test_a_map_file_keeps_its_facts(tmp_path, map_file):
    header = MapHeader((500_000.0, 5_400_000.0, 0.0), 0.02, 0.04, 0.013, "EPSG:25832")
    write_map(tmp_path / "map.ply", *ramp(0.1), header)
    assert read_map_header(tmp_path / "map.ply") == header
    older = tmp_path / "older.ply"
    lines = (tmp_path / "map.ply").read_bytes().split(b"\n")
    older.write_bytes(b"\n".join(line for line in lines if b"mbf_height" not in line and b"mbf_crs" not in line))
    assert read_map_header(older) == MapHeader(header.origin, 0.02, 0.04)


ONE_BAD_PLACE = np.where(np.arange(21 * 21) == 10 * 21 + 10, 0.1, 0.0)
"""Errors of the vertices of a ramp: that of the middle one is 0.1 m."""


def test_layers_are_narrower_only_where_the_file_says_that_heights_are_wrong(map_file):
    vertices, _ = read_mesh(map_file(0.02, ONE_BAD_PLACE))
    narrowed = built(map_file(0.02, ONE_BAD_PLACE))
    lethal = narrowed.layers["steepness"].lethal
    np.testing.assert_allclose(narrowed.vertices[lethal], vertices[ONE_BAD_PLACE > 0.0])
    assert narrowed.layers["steepness"].parameters.height_error is None
    assert not built(map_file(0.02, ONE_BAD_PLACE), steepness={"height_error": 0.0}).layers["steepness"].lethal.any()


def test_a_vertex_that_densifying_adds_has_the_greatest_error_of_its_neighbours(map_file):
    parameters, blocks = default_layers(0.3)
    file = map_file(0.02, ONE_BAD_PLACE)
    mesh_map = build_mesh_map(parameters.model_copy(update={"mesh_file": file, "densify": 0.08}), blocks)
    away = np.linalg.norm(mesh_map.vertices - read_mesh(file)[0][10 * 21 + 10], axis=1)
    assert len(mesh_map.vertices) > 3 * 21 * 21
    np.testing.assert_allclose(mesh_map.height_errors[away < 0.06], 0.1)
    assert (mesh_map.height_errors[away > 0.12] == 0.0).all()


@pytest.mark.parametrize("wrong", [-0.01, np.nan, np.inf])
def test_a_map_file_with_an_impossible_error_of_a_vertex_is_refused(map_file, wrong):
    file = map_file(0.02, np.where(ONE_BAD_PLACE > 0.0, wrong, 0.01))
    with pytest.raises(MeshError, match=r"height_error of its vertices: expected finite numbers of at least 0"):
        built(file)


def test_limits_of_the_footprint_count_with_places_and_the_belly_with_vertices():
    mesh = MeshMap.from_heights(np.random.default_rng(4).normal(0.0, 0.08, (14, 14)), 0.2, 0.2)
    of_vertices, of_places = np.full(14 * 14, 0.02), np.full(14 * 14, 0.012)
    chosen = TiltLayer.Parameters(rigid=True)
    surface = "layer", mesh.topology, mesh.locator
    both = TiltLayer(LayerContext(*surface, chosen, height_errors=of_vertices, place_errors=of_places))
    both.recompute()
    vertices, places = (computed(mesh, TiltLayer, errors, rigid=True) for errors in (of_vertices, of_places))
    np.testing.assert_allclose(both.limits(), places.limits())
    assert both.room_below == vertices.room_below < places.room_below
    assert (both.allowed | ~vertices.allowed).all() and (places.allowed | ~both.allowed).all()
    assert places.allowed.sum() > both.allowed.sum() > vertices.allowed.sum()
    slopes = TiltLayer.Parameters(rigid=True, ground_clearance=np.inf)
    without_belly = TiltLayer(LayerContext(*surface, slopes, height_errors=of_vertices, place_errors=of_places))
    without_belly.recompute()
    of_places_alone = computed(mesh, TiltLayer, of_places, rigid=True, ground_clearance=np.inf)
    np.testing.assert_array_equal(without_belly.allowed, of_places_alone.allowed)


def test_a_map_file_keeps_the_errors_of_places(map_file):
    file = Path(map_file(0.02, ONE_BAD_PLACE, 0.5 * ONE_BAD_PLACE))
    np.testing.assert_allclose(read_vertex_errors(file).of_vertices, ONE_BAD_PLACE)
    np.testing.assert_allclose(read_vertex_errors(file).of_places, 0.5 * ONE_BAD_PLACE)
    mesh_map = built(str(file))
    np.testing.assert_allclose(mesh_map.place_errors, 0.5 * mesh_map.height_errors)
    assert mesh_map.layers["steepness"].place_errors is mesh_map.place_errors


def test_a_map_file_of_an_earlier_version_states_its_vertices_errors_for_places_too(tmp_path, map_file):
    header, end, body = Path(map_file(0.02, ONE_BAD_PLACE, 0.5 * ONE_BAD_PLACE)).read_bytes().partition(b"end_header\n")
    records = np.frombuffer(body, dtype=VERTEX, count=21 * 21)
    older = np.empty(len(records), dtype=EARLIER_VERTEX)
    older["position"], older["height_error"] = records["position"], records["height_error"]
    file = tmp_path / "earlier.ply"
    header = header.replace(b"property float place_error\n", b"")
    file.write_bytes(header + end + older.tobytes() + body[records.nbytes :])
    np.testing.assert_allclose(read_vertex_errors(file).of_vertices, ONE_BAD_PLACE)
    np.testing.assert_array_equal(*read_vertex_errors(file))
    assert len(read_mesh(file)[0]) == 21 * 21


def test_one_error_of_all_vertices_narrows_the_tilt_as_one_number_does():
    mesh = MeshMap.from_heights(np.random.default_rng(4).normal(0.0, 0.08, (14, 14)), 0.2, 0.2)
    one = computed(mesh, TiltLayer, height_error=0.02, rigid=True)
    each = computed(mesh, TiltLayer, np.full(14 * 14, 0.02), rigid=True)
    np.testing.assert_array_equal(one.allowed, each.allowed)
    np.testing.assert_allclose(one.limits(), each.limits())


def wheel_errors_one_by_one(mesh, wheelbase, track, errors):
    """Naive twin of ``errors_below_wheels``: wheels found from above, on the only face there."""
    result = np.zeros((len(mesh.vertices), HEADINGS))
    for vertex, centre in enumerate(mesh.vertices):
        for heading in range(HEADINGS):
            yaw, squares = 2.0 * np.pi * heading / HEADINGS, []
            for ahead, left in ((1, 1), (-1, 1), (-1, -1), (1, -1)):
                x, y = 0.5 * ahead * wheelbase, 0.5 * left * track
                place = centre[:2] + np.array([np.cos(yaw) * x - np.sin(yaw) * y, np.sin(yaw) * x + np.cos(yaw) * y])
                face = mesh.locator.cast_rays([[*place, 10.0]], [[0.0, 0.0, -1.0]])[0][0]
                corners = [vertex] if face < 0 else mesh.faces[face]
                squares.append(np.mean(errors[corners] ** 2))
            result[vertex, heading] = np.sqrt(np.mean(squares))
    return result


@settings(deadline=None, max_examples=8)
@given(st.integers(0, 1000))
def test_the_error_below_the_wheels_is_that_of_the_faces_they_stand_on(seed):
    rng = np.random.default_rng(seed)
    mesh = MeshMap.from_heights(rng.normal(0.0, 0.05, (7, 6)), 0.2, 0.23)
    errors, wheelbase, track = rng.uniform(0.0, 0.1, len(mesh.vertices)), 0.51, 0.37
    directions = wheel_directions(HEADINGS, wheelbase, track)
    found = errors_below_wheels(mesh.topology.surface, *directions, 0.5 * np.hypot(wheelbase, track), errors)
    np.testing.assert_allclose(found, wheel_errors_one_by_one(mesh, wheelbase, track, errors), rtol=1e-5)


def test_no_belly_is_led_over_a_boulder_that_wrong_scans_have_smeared_to_a_flat_hill():
    heights = np.zeros((15, 15))
    heights[7, 7] = 0.02
    mesh = MeshMap.from_heights(heights, 0.2, 0.2)
    away = np.abs(mesh.vertices[:, :2] - 1.4).max(axis=1)
    errors = np.where(away < 0.01, 0.08, 0.03)
    husky = {"wheelbase": 0.512, "track": 0.571, "rigid": True, "ground_clearance": 0.12}
    layer = computed(mesh, TiltLayer, errors, **husky)
    assert not layer.allowed[away < 0.01].any()
    beside = (away > 0.19) & (away < 0.21) & (np.abs(mesh.vertices[:, 1] - 1.4) < 0.01)
    assert not layer.allowed[beside][:, [0, 8]].any()  # the boulder is not under the middle and not under a wheel
    assert layer.allowed[(away > 0.5) & (away < 0.9)].all()


@settings(deadline=None, max_examples=8)
@given(st.integers(0, 1000))
def test_ground_below_the_belly_is_as_high_as_its_highest_vertex_with_its_margin(seed):
    rng = np.random.default_rng(seed)
    mesh = MeshMap.from_heights(rng.normal(0.0, 0.05, (9, 8)), 0.2, 0.23)
    margins, wheelbase, track = rng.uniform(0.0, 0.1, len(mesh.vertices)), 0.51, 0.37
    directions = wheel_directions(HEADINGS, wheelbase, track)
    roll, pitch, bump, raised = settle_footprints(mesh.topology.surface, *directions, wheelbase, track, False, margins)
    for vertex, centre in enumerate(mesh.vertices):
        for heading in np.flatnonzero(np.isfinite(roll[vertex])):
            yaw, across = 2.0 * np.pi * heading / HEADINGS, mesh.vertices - centre
            ahead = np.cos(yaw) * across[:, 0] + np.sin(yaw) * across[:, 1]
            left = np.cos(yaw) * across[:, 1] - np.sin(yaw) * across[:, 0]
            inside = (np.abs(ahead) <= 0.5 * wheelbase) & (np.abs(left) <= 0.5 * track)
            rise = np.tan(pitch[vertex, heading]) * ahead + np.tan(roll[vertex, heading]) * left
            above = (mesh.vertices[:, 2] - rise)[inside]
            higher = (above + margins[inside]).max() - above.max()
            assert raised[vertex, heading] - bump[vertex, heading] == pytest.approx(higher, abs=1e-5)


@settings(deadline=None, max_examples=10)
@given(st.integers(0, 1000))
def test_greater_errors_of_places_close_more_ground_and_open_none(seed):
    rng = np.random.default_rng(seed)
    mesh = MeshMap.from_heights(rng.normal(0.0, 0.08, (14, 14)), 0.2, 0.2)
    less = rng.uniform(0.0, 0.03, len(mesh.vertices))
    more = less + rng.uniform(0.0, 0.03, len(mesh.vertices))
    for layer_class in (SteepnessLayer, HeightDiffLayer, TiltLayer):
        low, high = (computed(mesh, layer_class, errors) for errors in (less, more))
        assert (high.lethal | ~low.lethal).all()
        if layer_class is TiltLayer:
            assert (low.allowed | ~high.allowed).all()


def test_stored_layers_of_other_errors_are_not_taken(tmp_path, map_file):
    parameters, blocks = default_layers(0.3)
    for round_of_builds in range(2):
        for errors in (None, 0.0 * ONE_BAD_PLACE, ONE_BAD_PLACE):
            chosen = {"mesh_file": map_file(0.02, errors), "cache_dir": str(tmp_path / "layers")}
            build_mesh_map(parameters.model_copy(update=chosen), blocks)
        assert len(list((tmp_path / "layers").glob("HeightDiffLayer-*"))) == 3, round_of_builds
