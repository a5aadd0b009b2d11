"""Whatever is wrong with the files of a tiled map comes out as one error that names the file and the key."""

import json
import os
import shutil
import zipfile

import numpy as np
import pytest

from mbf_mesh_nav.mesh.mesh_report import MeshError
from mbf_mesh_nav.tiles.building.sources import open_heights
from mbf_mesh_nav.tiles.index import INDEX_FILE, read_index
from mbf_mesh_nav.tiles.tile import read_tile, tile_file
from mbf_mesh_nav.tiles.tiled_map import TiledMap

KEY = (1, 1)


@pytest.fixture
def folder(tiled_hills, tmp_path):
    """A copy that may be damaged."""
    return shutil.copytree(tiled_hills, tmp_path / "map")


def change_tile(folder, change):
    file = tile_file(folder, KEY)
    arrays = dict(np.load(file))
    change(arrays)
    np.savez(file, **arrays)
    return file


def put(name, place, value):
    def change(arrays):
        arrays[name][place] = value

    return change


def replace_by(name, of_old):
    def change(arrays):
        arrays[name] = of_old(arrays[name])

    return change


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda arrays: arrays.pop("faces"), "has no array 'faces'; it is not a tile"),
        (replace_by("costs", lambda old: old.astype(np.float64)), "'costs' holds float64, expected float32"),
        (replace_by("normals", lambda old: old[:, :2]), r"'normals' has the shape \(\d+, 2\), expected \(\d+, 3\)"),
        (replace_by("lethal", lambda old: old[:, 1:]), r"'lethal' has the shape .* expected \(8, \d+\)"),
        (put("faces", (0, 0), 10**6), r"'faces' holds 0 to 1000000, expected 0 to \d+"),
        (put("neighbours", 0, -5), r"'neighbours' holds -5 to \d+, expected 0 to \d+"),
        (put("portal_of", 0, 999), r"'portal_of' holds 0 to 999, expected 0 to \d+"),
        (put("offsets", 3, 10**6), "'offsets' does not ascend"),
        (put("vertices", (0, 1), np.nan), "'vertices' holds values that are not finite"),
        (put("normals", (0, 1), np.inf), "'normals' holds values that are not finite"),
        (put("costs", (2, 5), np.nan), "'costs' holds values that are negative or not a number"),
        (put("portal_costs", (0, 1, 0), -1.0), "'portal_costs' holds values that are negative or not a number"),
        (put("shared", 1, 0), "'shared' does not ascend"),
        (put("portals", 0, 10**6), "'portals' does not ascend"),
        (put("numbers", 0, -1), "'numbers' holds -1 to"),
        (replace_by("shared", lambda old: old[:, None]), r"'shared' has the shape \(\d+, 1\), expected \(s,\)"),
        (replace_by("shared", lambda old: old[1:]), r"'portal_of' has the shape \(\d+,\), expected \(\d+,\)"),
        (replace_by("vertices", lambda old: old[0, 0]), r"'vertices' has the shape \(\), expected \(n, 3\)"),
        (replace_by("normals", lambda old: old[0, 0]), r"'normals' has the shape \(\), expected \(c, 3\)"),
        (replace_by("portals", lambda old: old[0, 0]), r"'portals' has the shape \(\), expected \(p, 3\)"),
    ],
)
def test_a_damaged_array_of_a_tile_is_refused_by_name(folder, change, reason):
    file = change_tile(folder, change)
    with pytest.raises(MeshError, match=f"tile_1_1.npz: {reason}"):
        read_tile(file)


def test_a_core_of_more_vertices_than_there_are_is_refused(folder):
    """Every shape fits by itself; a kernel would read past the end."""

    def change(arrays):
        for name in ("vertices", "numbers"):
            arrays[name] = arrays[name][: len(arrays["normals"]) - 3]
        arrays["faces"] = arrays["faces"][: arrays["core_faces"][0]] % len(arrays["vertices"])

    file = change_tile(folder, change)
    with pytest.raises(
        MeshError, match=r"tile_1_1.npz: 'normals' has \d+ rows, expected at most the \d+ of 'vertices'"
    ):
        read_tile(file)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (replace_by("portals", lambda old: old[0, 0]), r"'portals' has the shape \(\), expected \(p, 3\)"),
        (put("portal_costs", (0, 0, 1), np.nan), "'portal_costs' holds values that are negative or not a number"),
    ],
)
def test_damaged_portals_are_noticed_when_the_map_is_opened(folder, change, reason):
    change_tile(folder, change)
    with pytest.raises(MeshError, match=f"tile_1_1.npz: {reason}"):
        TiledMap(folder)


def test_a_layer_is_changed_on_tiles_of_the_map_only_and_to_sound_values(folder):
    tiled = TiledMap(folder)
    tile = read_tile(tile_file(folder, KEY))
    lethal = tile.lethal[0]
    with pytest.raises(ValueError, match="costs of at least 0, got some that are negative or not a number"):
        tiled.change_layer(KEY, "safe", np.full_like(tile.costs[0], np.nan), lethal)
    change_tile(folder, lambda arrays: arrays.update(costs=arrays["costs"][:1], lethal=arrays["lethal"][:1]))
    with pytest.raises(MeshError, match=r"tile_1_1.npz: belongs to another map than the index"):
        tiled.change_layer(KEY, "safe", tile.costs[0], lethal)


def test_a_tile_that_was_truncated_is_refused(folder):
    file = tile_file(folder, KEY)
    file.write_bytes(file.read_bytes()[:-2000])
    with pytest.raises(MeshError, match=r"tile_1_1.npz: is not a valid .npz file"):
        read_tile(file)


def test_a_tile_with_a_flipped_bit_is_refused(folder):
    file = tile_file(folder, KEY)
    content = bytearray(file.read_bytes())
    content[1000] ^= 1
    file.write_bytes(bytes(content))
    with pytest.raises(MeshError, match=r"tile_1_1.npz: is not a valid .npz file: Bad CRC-32"):
        read_tile(file)


def test_a_tile_that_promises_more_than_it_holds_is_refused_before_it_is_read(folder):
    file = tile_file(folder, KEY)
    arrays = dict(np.load(file))
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, values in arrays.items():
            with archive.open(f"{name}.npy", "w") as member:
                grown = np.zeros((10**7, 3)) if name == "vertices" else values
                np.lib.format.write_array(member, grown)
    with pytest.raises(MeshError, match=r"tile_1_1.npz: its arrays take \d+ bytes, the limit is \d+"):
        read_tile(file)


def test_a_missing_tile_is_named(folder):
    tile_file(folder, KEY).unlink()
    with pytest.raises(MeshError, match=r"tile_1_1.npz: cannot be read: No such file"):
        TiledMap(folder)


def test_a_tile_of_another_map_is_noticed(folder):
    change_tile(folder, put("build", 0, 77))
    tiled = TiledMap(folder)
    with pytest.raises(MeshError, match=r"tile_1_1.npz: belongs to another map than the index"):
        tiled.tile(KEY)


def edit(folder, **changes):
    file = folder / INDEX_FILE
    content = json.loads(file.read_text())
    for name, value in changes.items():
        content.pop(name) if value is None else content.update({name: value})
    file.write_text(json.dumps(content))


def entry(box=(0, 0, 0, 1, 1, 1)):
    return {"key": [0, 0], "core_vertices": 9, "neighbours": 32, "shared": 0, "box": list(box)}


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"tile_size": None}, "'tile_size': Field required"),
        ({"tile_size": -2.0}, "'tile_size': Input should be greater than 0, got -2.0"),
        ({"version": 2}, "'version': Input should be 1, got 2"),
        ({"surprise": 1}, "'surprise': Extra inputs are not permitted, got 1"),
        ({"default_layer": "sfae"}, "'default_layer': expected one of border, .*, safe, got 'sfae'"),
        ({"profiles": {"a": {"layer": "x"}}}, "'profiles.a.layer': expected one of border, .* got 'x'"),
        ({"tiles": [{"key": [0, 0]}]}, "'tiles.0.core_vertices': Field required"),
        ({"tiles": [entry(box=[0, 0, 0, 1, 1, np.nan])]}, "'tiles.0.box.5': Input should be a finite number"),
        ({"tiles": [entry(box=[0, 2, 0, 1, 1, 1])]}, "'tiles.0.box': .*expected least x, y, z and greatest x, y, z"),
        ({"tiles": [entry(), entry()]}, r"'tiles': .*expected each tile once, \(0, 0\) is there 2 times"),
        ({"tile_size": np.inf}, "'tile_size': Input should be a finite number"),
        ({"build": "0"}, "'build': String should match pattern"),
    ],
)
def test_a_wrong_key_of_the_index_is_named(folder, changes, reason):
    edit(folder, **changes)
    with pytest.raises(MeshError, match=f"index.json: {reason}"):
        read_index(folder)


def test_an_index_that_is_no_file_of_this_kind_is_refused(folder, tmp_path):
    file = folder / INDEX_FILE
    file.write_text("[1, 2")
    with pytest.raises(MeshError, match=r"index.json: cannot be read"):
        read_index(folder)
    file.unlink()
    os.mkfifo(file)
    with pytest.raises(MeshError, match=r"index.json: is a pipe, expected a file"):
        read_index(folder)
    with pytest.raises(MeshError, match="there is no such folder of tiles"):
        read_index(tmp_path / "nowhere")


def test_an_unknown_profile_is_refused_with_the_known_ones(tiled_hills):
    with pytest.raises(KeyError, match="no cost profile 'truck', the map has: default"):
        TiledMap(tiled_hills, profile="truck")


def test_a_memory_that_holds_no_two_tiles_is_refused(tiled_hills):
    with pytest.raises(MeshError, match=r"its tiles need .* MB of memory, allowed are 0.1 MB"):
        TiledMap(tiled_hills, memory=1e5)


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (np.zeros((3, 3, 3)), r"expected an array \(ny, nx\) of floats, got float64 of shape"),
        (np.zeros((30, 30), dtype=np.int16), "expected an array .* got int16"),
        (np.zeros((300, 300)), "holds 90000 heights, the limit is 1000"),
        (b"nothing", "cannot be read as heights"),
    ],
)
def test_heights_that_are_none_are_refused(tmp_path, content, reason):
    file = tmp_path / "heights.npy"
    file.write_bytes(content) if isinstance(content, bytes) else np.save(file, content)
    with pytest.raises(MeshError, match=f"heights.npy: {reason}"):
        open_heights(file, 1000)
