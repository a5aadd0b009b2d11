"""Tiles hold what the whole mesh has, and come out the same however they are built."""

import shutil
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tiled_terrains import BLOCKS, PARAMETERS, SPACING, settings, terrain

from mbf_mesh_nav.map.map_builder import build_mesh_map
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh
from mbf_mesh_nav.mesh.mesh_report import MeshError
from mbf_mesh_nav.mesh.repair import checked_mesh
from mbf_mesh_nav.tiles.building.build import build_tiles
from mbf_mesh_nav.tiles.building.sources import HeightSource, MeshSource
from mbf_mesh_nav.tiles.index import INDEX_FILE, CostProfile, read_index
from mbf_mesh_nav.tiles.tile import read_tile, tile_file
from mbf_mesh_nav.tiles.tiled_map import TiledMap


def tiles_of(folder):
    return [read_tile(tile_file(folder, entry.key)) for entry in read_index(folder).tiles]


def bytes_of(folder):
    return {file.name: file.read_bytes() for file in folder.iterdir()}


def assert_layers_without_seams(folder, whole, tolerance):
    names = read_index(folder).layers
    for tile in tiles_of(folder):
        numbers = tile.numbers[: tile.core_vertices]
        internal = whole.input_to_internal[numbers]
        assert np.array_equal(whole.vertices[internal], tile.vertices[: tile.core_vertices])
        for row, name in enumerate(names):
            layer = whole.layers[name]
            np.testing.assert_allclose(tile.costs[row], layer.costs[internal], rtol=tolerance, err_msg=name)
            assert np.array_equal(tile.lethal[row], layer.lethal[internal]), name


def test_layers_on_tiles_of_heights_are_those_of_the_whole_mesh_at_borders_too(tiled_hills, whole_hills):
    assert_layers_without_seams(tiled_hills, whole_hills.map, tolerance=1e-5)


def test_layers_on_tiles_of_a_mesh_are_those_of_the_whole_mesh_at_borders_too(tmp_path):
    vertices, faces = heightfield_mesh(terrain(65, seed=4), SPACING, SPACING)
    rng = np.random.default_rng(1)
    vertices[:, :2] += rng.uniform(-0.12, 0.12, (len(vertices), 2)) - 9.0
    order = rng.permutation(len(vertices))
    vertices, faces = vertices[order], np.argsort(order)[faces].astype(np.int32)
    mesh, _ = checked_mesh(vertices, faces, ())
    build_tiles(MeshSource(mesh.vertices, mesh.faces), tmp_path / "map", settings())
    whole = build_mesh_map(PARAMETERS, BLOCKS, vertices=mesh.vertices, faces=mesh.faces)
    assert_layers_without_seams(tmp_path / "map", whole, tolerance=1e-5)
    assert any(entry.key[0] < 0 for entry in read_index(tmp_path / "map").tiles)


def test_each_face_is_in_the_core_of_one_tile_and_shared_vertices_in_all_that_use_them(tiled_hills, whole_hills):
    faces, users, shared = [], {}, {}
    for place, tile in enumerate(tiles_of(tiled_hills)):
        faces.append(np.sort(tile.numbers[tile.faces[: tile.core_faces[0]]], axis=1))
        for number in tile.numbers[: tile.core_vertices].tolist():
            users.setdefault(number, set()).add(place)
        for number in tile.numbers[tile.shared].tolist():
            shared.setdefault(number, set()).add(place)
    whole = whole_hills.map
    expected = np.sort(whole.internal_to_input[whole.faces], axis=1)
    assert sorted(np.concatenate(faces).tolist()) == sorted(expected.tolist())
    assert shared == {number: places for number, places in users.items() if len(places) > 1}


def test_tiles_have_the_same_bytes_from_one_and_two_workers_and_in_any_order(hills, tiled_hills, tmp_path):
    class Backwards(HeightSource):
        def keys(self, tile_size):
            return super().keys(tile_size)[::-1]

    build_tiles(HeightSource(hills, SPACING, SPACING), tmp_path / "two", settings(), workers=2)
    build_tiles(Backwards(hills, SPACING, SPACING), tmp_path / "backwards", settings())
    assert bytes_of(tmp_path / "two") == bytes_of(tiled_hills)
    assert bytes_of(tmp_path / "backwards") == bytes_of(tiled_hills)


BUILD_AND_DIE = """
import os, signal, sys
from pathlib import Path

import numpy as np

heights, folder, last, tests = sys.argv[1:]
sys.path.insert(0, tests)
from tiled_terrains import SPACING, settings

from mbf_mesh_nav.tiles.building.build import build_tiles
from mbf_mesh_nav.tiles.building.sources import HeightSource

def kill(done, total):
    if done == int(last):
        os.kill(os.getpid(), signal.SIGKILL)

build_tiles(HeightSource(np.load(heights), SPACING, SPACING), Path(folder), settings(), on_tile=kill)
"""


def test_a_build_that_is_killed_twice_goes_on_and_gives_the_same_bytes(hills, tiled_hills, tmp_path):
    folder = tmp_path / "map"
    np.save(tmp_path / "heights.npy", hills)
    for tiles in ("2", "5"):
        arguments = tmp_path / "heights.npy", folder, tiles, Path(__file__).parent
        process = subprocess.run([sys.executable, "-c", BUILD_AND_DIE, *map(str, arguments)], timeout=100, check=False)
        assert process.returncode == -signal.SIGKILL
        with pytest.raises(MeshError, match=r"index.json: is missing; \d+ tiles are there.*goes on when it is started"):
            read_index(folder)
    there = {file.name: file.stat().st_mtime_ns for file in folder.glob("tile_*.npz")}
    (folder / ".tile_3_3.4711.npz").write_bytes(b"half a tile")
    build_tiles(HeightSource(hills, SPACING, SPACING), folder, settings())
    assert bytes_of(folder) == bytes_of(tiled_hills)
    assert len(there) >= 5
    assert {name: (folder / name).stat().st_mtime_ns for name in there} == there


def test_a_damaged_tile_is_built_again_and_sound_ones_are_not(hills, tiled_hills, tmp_path):
    folder = tmp_path / "map"
    source = HeightSource(hills, SPACING, SPACING)
    build_tiles(source, folder, settings())
    damaged = tile_file(folder, (1, 1))
    damaged.write_bytes(damaged.read_bytes()[:1000])
    build_tiles(source, folder, settings())
    assert bytes_of(folder) == bytes_of(tiled_hills)


def test_a_tile_whose_layer_was_changed_is_built_again(hills, tiled_hills, tmp_path):
    folder = shutil.copytree(tiled_hills, tmp_path / "map")
    tile = read_tile(tile_file(folder, (1, 1)))
    lethal = np.ones(tile.core_vertices, dtype=np.bool_)
    TiledMap(folder).change_layer((1, 1), "safe", np.full(len(lethal), np.inf, dtype=np.float32), lethal)
    assert bytes_of(folder) != bytes_of(tiled_hills)
    build_tiles(HeightSource(hills, SPACING, SPACING), folder, settings())
    assert bytes_of(folder) == bytes_of(tiled_hills)


def test_how_the_mesh_is_read_and_kept_makes_no_other_map():
    source, plain = HeightSource(terrain(17, seed=0), SPACING, SPACING), settings()
    changes = {"mesh_file": "elsewhere/map.ply", "cache_dir": "cache", "max_faces": 10, "repair": ("unused_vertices",)}
    elsewhere = replace(plain, mesh_map=PARAMETERS.model_copy(update=changes))
    assert elsewhere.digest(source) == plain.digest(source)
    for name, value in {"edge_cost_factor": 2.0, "default_layer": "effort", "inscribed_radius": 0.1}.items():
        other = replace(plain, mesh_map=PARAMETERS.model_copy(update={name: value}))
        assert other.digest(source) != plain.digest(source), name


def test_a_folder_of_another_map_is_refused(hills, tiled_hills):
    before = bytes_of(tiled_hills)
    with pytest.raises(MeshError, match="holds a map of another source or with other settings"):
        build_tiles(HeightSource(hills + 1.0, SPACING, SPACING), tiled_hills, settings())
    with pytest.raises(MeshError, match="holds a map of another source or with other settings"):
        build_tiles(HeightSource(hills, SPACING, SPACING), tiled_hills, settings(portal_length=3.0))
    assert bytes_of(tiled_hills) == before


def test_a_layer_without_a_bound_on_what_it_looks_at_is_refused_by_name(hills, tmp_path):
    endless = {**BLOCKS, "height_diff": {"radius": 0.8}}
    wanted = settings().__class__(mesh_map=PARAMETERS, layer_blocks=endless, tile_size=12.0)
    with pytest.raises(MeshError, match=r"layer 'height_diff' of type height_diff does not state.*height_limit"):
        build_tiles(HeightSource(hills, SPACING, SPACING), tmp_path / "map", wanted)


def test_a_profile_of_an_unknown_layer_is_refused_by_name(hills, tmp_path):
    wanted = settings(profiles={"light": CostProfile(layer="efort")})
    with pytest.raises(MeshError, match=r"profile 'light': expected a layer of border, .* got 'efort'"):
        build_tiles(HeightSource(hills, SPACING, SPACING), tmp_path / "map", wanted)


def test_heights_without_a_face_make_no_map(tmp_path):
    with pytest.raises(MeshError, match="there is no face in it"):
        build_tiles(HeightSource(np.full((9, 9), np.nan), SPACING, SPACING), tmp_path / "map", settings())
    assert not (tmp_path / "map" / INDEX_FILE).exists()


def test_the_whole_grid_is_never_read_at_once(tmp_path):
    class Windows:
        """Heights that note the largest window."""

        shape = (65, 65)
        largest = 0

        def __getitem__(self, window):
            values = terrain(65, seed=2)[window]
            Windows.largest = max(Windows.largest, values.size)
            return values

        def __iter__(self):
            return iter(terrain(65, seed=2))

    build_tiles(HeightSource(Windows(), SPACING, SPACING), tmp_path / "map", settings(tile_size=4.0))
    assert 0 < Windows.largest < 65 * 65 / 4
