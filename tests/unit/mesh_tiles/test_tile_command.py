"""``mbf map tile``: files become tiles, and mistakes one error."""

import json

import numpy as np
import pytest
from tiled_terrains import SPACING
from typer.testing import CliRunner

from mbf_abstract.cli import make_app
from mbf_mesh_nav.building.map_build import write_map
from mbf_mesh_nav.files.map_header import MapHeader
from mbf_mesh_nav.files.vertex_errors import VertexErrors
from mbf_mesh_nav.map.map_builder import build_mesh_map
from mbf_mesh_nav.map.map_parameters import MeshLayerEntry, MeshMapParameters
from mbf_mesh_nav.mesh.densify import densify
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh
from mbf_mesh_nav.mesh.repair import checked_mesh
from mbf_mesh_nav.tiles.index import read_index
from mbf_mesh_nav.tiles.tile import read_tile, tile_file

JUDGING = (
    "backend: mesh\nmesh_map:\n  layers: [{name: height_diff, type: height_diff}, {name: tilt, type: tilt}]\n"
    "  height_diff: {height_limit: 1.0}\n"
)
DENSE = "backend: mesh\nmesh_map:\n  layers: [{name: slopes, type: steepness}]\n  densify: 0.2\n"


def run(*arguments):
    return CliRunner().invoke(make_app(), ["map", "tile", *map(str, arguments)])


def test_heights_and_the_same_ground_as_a_mesh_become_tiles(heights, tmp_path):
    done = run(heights, "--spacing", SPACING, "--out", tmp_path / "map", "--tile-size", 12, "--json")
    assert done.exit_code == 0, done.output
    figures = json.loads(done.stdout)
    assert figures["tiles"] == 4 and "roughness" in figures["layers"]
    write_map(tmp_path / "mesh.ply", *heightfield_mesh(np.load(heights), SPACING, SPACING), MapHeader((0, 0, 0), 0, 0))
    done = run(tmp_path / "mesh.ply", "--out", tmp_path / "of_mesh", "--tile-size", 12)
    assert done.exit_code == 0, done.output
    assert f"vertices  {figures['vertices']}" in done.stdout
    assert read_index(tmp_path / "of_mesh").source == "mesh.ply"


def test_the_layers_are_those_of_a_configuration(heights, tmp_path):
    config = tmp_path / "robot.yaml"
    config.write_text(
        "backend: mesh\nmesh_map:\n  layers: [{name: slopes, type: steepness}]\n  slopes: {threshold: 0.9}\n"
        "  edge_cost_factor: 2.0\n"
    )
    out = tmp_path / "map"
    done = run(heights, "--spacing", SPACING, "--out", out, "--config", config, "--tile-size", 24, "--workers", 2)
    assert done.exit_code == 0, done.output
    index = read_index(out)
    assert index.layers == ("slopes",) and index.profile()[1].edge_cost_factor == 2.0


def test_tiles_of_a_built_map_count_with_the_error_of_each_vertex(heights, tmp_path):
    vertices, faces = heightfield_mesh(np.load(heights), SPACING, SPACING)
    errors = VertexErrors(*np.random.default_rng(5).uniform(0.0, [[0.1], [0.05]], (2, len(vertices))))
    file, config, differ = tmp_path / "mesh.ply", tmp_path / "robot.yaml", 0
    config.write_text(JUDGING, "utf-8")
    write_map(file, vertices, faces, MapHeader((0, 0, 0), 0, 0, 0.05), errors)
    done = run(file, "--out", tmp_path / "map", "--tile-size", 12, "--config", config)
    assert done.exit_code == 0, done.output
    entries = [MeshLayerEntry(name=name, type=name) for name in ("height_diff", "tilt")]
    blocks = {"height_diff": {"height_limit": 1.0}}
    chosen = MeshMapParameters(mesh_file=str(file), layers=tuple(entries))
    whole = build_mesh_map(chosen, blocks)
    exact = build_mesh_map(
        chosen, {"height_diff": {"height_limit": 1.0, "height_error": 0.0}, "tilt": {"height_error": 0.0}}
    )
    for entry in read_index(tmp_path / "map").tiles:
        tile = read_tile(tile_file(tmp_path / "map", entry.key))
        internal = whole.input_to_internal[tile.numbers[: tile.core_vertices]]
        for row, name in enumerate(("height_diff", "tilt")):
            np.testing.assert_array_equal(tile.lethal[row], whole.layers[name].lethal[internal])
            differ += (tile.lethal[row] != exact.layers[name].lethal[internal]).sum()
    assert differ


def test_a_mesh_is_densified_as_the_configuration_says(tmp_path):
    vertices = np.array([(0.0, 0.0, 0.0), (2.0, 0.0, 0.0), (2.0, 2.0, 0.0), (0.0, 2.0, 0.0)])
    faces = np.array([(0, 1, 2), (0, 2, 3)], dtype=np.int32)
    write_map(tmp_path / "plate.ply", vertices, faces, MapHeader((0, 0, 0), 0, 0))
    (tmp_path / "dense.yaml").write_text(DENSE, "utf-8")
    done = run(tmp_path / "plate.ply", "--out", tmp_path / "map", "--config", tmp_path / "dense.yaml", "--json")
    assert done.exit_code == 0, done.output
    expected = densify(checked_mesh(vertices, faces)[0], 0.2)
    assert json.loads(done.stdout)["vertices"] == len(expected.vertices) > 4


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("heights.npy",), "heights.npy: needs a spacing (--spacing)"),
        (("mesh.ply", "--spacing", "0.5"), "mesh.ply: states its own spacing, got 0.5 m"),
        (("nothing.tif",), "nothing.tif: there is no such file"),
        (("nothing.npy", "--spacing", "0.5"), "nothing.npy: there is no such file"),
        (("heights.npy", "--spacing", "1e200"), "heights must lie within 1e+09 m of the first one, got "),
        (
            ("heights.npy", "--spacing", "0.5", "--tile-size", "0.1"),
            "expected a tile size of at least the spacing of 0.5 m of the heights, got 0.1 m",
        ),
        (("map.xyz",), "map.xyz: unknown ending '.xyz'"),
        (("heights.npy", "--spacing", "0.5", "--tile-size", "1", "--portal-length", "2"), "a portal length of at most"),
        (("heights.npy", "--spacing", "0.5", "--config", "dense.yaml"), "densify 0, got 0.2 m"),
        (("model.tif", "--config", "dense.yaml"), "densify 0, got 0.2 m"),
    ],
)
def test_a_mistake_is_one_error(heights, tmp_path, arguments, text):
    source = heights if arguments[0] == "heights.npy" else tmp_path / arguments[0]
    (tmp_path / "dense.yaml").write_text(DENSE, "utf-8")
    others = [tmp_path / one if one.endswith(".yaml") else one for one in arguments[1:]]
    done = run(source, *others, "--out", tmp_path / "map")
    assert done.exit_code == 2 and text in done.output
    assert "Traceback" not in done.output
