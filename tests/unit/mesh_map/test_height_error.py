"""Limits of layers are narrower by what the errors of a map's heights do to slopes and steps."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mbf_mesh_nav.building.map_build import write_map
from mbf_mesh_nav.files.map_header import MapHeader, read_map_header
from mbf_mesh_nav.layers.height_diff import HeightDiffLayer
from mbf_mesh_nav.layers.steepness import SteepnessLayer
from mbf_mesh_nav.layers.tilt import TiltLayer, TiltParameters
from mbf_mesh_nav.map.height_error import HeightErrorParameters
from mbf_mesh_nav.map.layer import LayerContext
from mbf_mesh_nav.map.map_builder import build_mesh_map, default_layers
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh

ERROR = 0.01
LAYERS = ("steepness", "roughness", "height_diff")


def computed(mesh, layer_class, **parameters):
    layer = layer_class(LayerContext("layer", mesh.topology, mesh.locator, layer_class.Parameters(**parameters)))
    layer.recompute()
    return layer


def ramp(slope, spacing=0.1):
    return heightfield_mesh(np.tile(np.arange(21) * spacing * np.tan(slope), (21, 1)), spacing, spacing)


def noisy_plane():
    return MeshMap.from_heights(np.random.default_rng(2).normal(0.0, ERROR, (80, 80)), 0.2, 0.2)


@pytest.fixture
def map_file(tmp_path):
    """A ramp of 0.55 rad, and a function that writes it with an error of its heights."""

    def write(height_error):
        file = tmp_path / f"ramp_{height_error}.ply"
        write_map(file, *ramp(0.55), MapHeader((0.0, 0.0, 0.0), 0.02, 0.04, height_error))
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
    assert HeightErrorParameters(height_error=ERROR).slope_error(0.5) == pytest.approx(slopes.std(), rel=0.02)


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


def test_limits_and_clearance_of_the_footprint_are_lower_by_the_error():
    mesh = MeshMap.from_arrays(*ramp(0.3))
    exact, wrong = (computed(mesh, TiltLayer, height_error=error) for error in (None, ERROR))
    slopes = [np.arctan(np.sqrt(2.0) * ERROR / length) for length in (0.4, 0.5, 0.5)]
    np.testing.assert_allclose(np.subtract(exact.limits(), wrong.limits()), slopes)
    parameters = TiltParameters(ground_clearance=0.1, height_error=ERROR)
    assert parameters.room_below == pytest.approx(0.1 - np.sqrt(2.0) * ERROR)


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
