"""``mbf plan`` and ``mbf check`` on a folder of tiles."""

import json
import shutil

import numpy as np
import pytest
from typer.testing import CliRunner

from mbf_abstract.cli import make_app
from mbf_mesh_nav.tiles.index import INDEX_FILE
from mbf_mesh_nav.tiles.tile import tile_file


def run(*arguments):
    return CliRunner().invoke(make_app(), [str(argument) for argument in arguments])


def ends_of(places):
    return [text for name, place in zip(("--start", "--goal"), places, strict=True) for text in (name, *place)]


@pytest.fixture
def folder(tiled_hills, tmp_path):
    """A copy of the hills."""
    return shutil.copytree(tiled_hills, tmp_path / "map")


def test_a_plan_has_the_figures_and_the_picture_of_a_plan_on_one_mesh(tiled_hills, whole_hills, tmp_path):
    start, goal = whole_hills.free_places(2, 15)
    done = run("plan", tiled_hills, *ends_of((start, goal)), "--json", "--png", tmp_path / "plan.png")
    assert done.exit_code == 0, done.output
    facts = json.loads(done.stdout)
    assert facts["outcome_name"] == "SUCCESS" and facts["planner"] == "hierarchical"
    assert facts["cost"] == pytest.approx(whole_hills.cost(start, goal), rel=0.03)
    assert np.allclose(facts["poses"][0][:3], start) and np.allclose(facts["poses"][-1][:3], goal)
    steps = np.diff([pose[:3] for pose in facts["poses"]], axis=0)
    assert facts["length_m"] == pytest.approx(np.linalg.norm(steps, axis=1).sum(), rel=1e-5)
    assert (tmp_path / "plan.png").read_bytes()[:4] == b"\x89PNG"


def test_without_z_the_ground_is_taken_and_without_a_path_the_exit_code_is_1(tiled_hills, whole_hills):
    (start,) = whole_hills.free_places(1, 15)
    done = run("plan", tiled_hills, *ends_of((start[:2], (-30.0, 4.0))))
    assert done.exit_code == 1
    assert "OUT_OF_MAP" in done.stdout and "there is no surface above or below it" in done.stdout
    assert "note: there is no ground at the goal (-30, 4)" in done.stderr


def change_index(folder, **changes):
    file = folder / INDEX_FILE
    file.write_text(json.dumps(json.loads(file.read_text("utf-8")) | changes), "utf-8")


def not_tiles(folder):
    shutil.rmtree(folder)
    folder.mkdir()


def not_complete(folder):
    (folder / INDEX_FILE).unlink()


def of_another_version(folder):
    change_index(folder, version=2)


def a_tile_is_missing(folder):
    tile_file(folder, (1, 1)).unlink()


def a_tile_is_truncated(folder):
    content = tile_file(folder, (1, 1)).read_bytes()
    tile_file(folder, (1, 1)).write_bytes(content[:5000])


@pytest.mark.parametrize("command", ["plan", "check"])
@pytest.mark.parametrize(
    ("damage", "text"),
    [
        (not_tiles, "expected a configuration, "),
        (not_complete, "index.json: is missing; 16 tiles are there"),
        (of_another_version, "'version': Input should be 1, got 2"),
        (a_tile_is_missing, "tile_1_1.npz"),
        (a_tile_is_truncated, "tile_1_1.npz"),
    ],
)
def test_a_folder_that_is_not_a_sound_map_is_one_error(folder, command, damage, text):
    damage(folder)
    done = run(command, folder, *(ends_of(((2, 2), (3, 3))) if command == "plan" else ()))
    assert done.exit_code == 2, done.output
    assert text in done.stderr.replace("\n", " ") and "Traceback" not in done.output


def test_a_check_lists_all_damaged_tiles_and_files_that_are_not_of_the_map(folder):
    done = run("check", folder)
    assert done.exit_code == 0 and "good; 16 tiles" in done.stdout and "layers: border, " in done.stdout
    (folder / "tile_99_0.npz").write_bytes(b"")
    assert "note: 1 files are not in index.json, e.g. tile_99_0.npz" in run("check", folder).stdout
    # The headers are sound, some values are not: only reading it all shows that.
    content = bytearray(tile_file(folder, (0, 2)).read_bytes())
    content[len(content) // 2] ^= 255
    tile_file(folder, (0, 2)).write_bytes(content)
    shutil.copy(tile_file(folder, (2, 2)), tile_file(folder, (2, 1)))
    done = run("check", folder)
    assert done.exit_code == 2 and "2 mistakes found" in done.stderr
    assert "tile_0_2.npz" in done.stderr and "tile_2_1.npz" in done.stderr
    assert run("check", folder, "--no-load").exit_code == 0
