"""A run is repeated from its folder alone: the same drive, or what differs and an exit code that says so."""

import json
import shutil

import numpy as np
import pytest
import typer
import yaml
from PIL import Image
from typer.testing import CliRunner

from terrain.commands.run import register

pytestmark = pytest.mark.timeout(300)

SCENARIO = """
name: trial
proves: A short drive.
backend: {backend}
navigation: {{{backend}: nav.yaml}}
world: {world}
robot: turtlebot
start: {{x: 2.0, y: 2.5}}
goals: [{{x: 3.5, y: 2.5}}]
sensors: [{{name: lidar, type: planar, max_range: 4.0, rays: 30}}]
perturb: {{range_noise: 0.02, start_position: 0.05}}
time_limit: 20.0
seed: 4
"""
MESH = """
backend: mesh
dist_tolerance: 0.3
angle_tolerance: 3.14
planners: [{name: dijkstra, type: dijkstra}, {name: astar, type: astar}]
controllers: [{name: follower, type: path_follower}]
mesh_map: {mesh_file: $WORLD_MESH, layers: []}
"""
COSTMAP = """
backend: costmap
dist_tolerance: 0.3
angle_tolerance: 3.14
planners: [{name: own, type: "own_planner:OwnPlanner"}]
controllers: [{name: pursuit, type: regulated_pure_pursuit}]
global_costmap:
  robot_radius: 0.2
  layers: [{name: walls, type: static}, {name: zones, type: keepout}]
  walls: {map_file: $WORLD_MAP}
  zones: {mask_file: maps/mask.yaml}
local_costmap: {robot_radius: 0.2, width: 3.0, height: 3.0, rolling_window: true, layers: []}
"""
OWN_PLANNER = (
    "from mbf_costmap_nav.planners.dijkstra import DijkstraPlanner\nclass OwnPlanner(DijkstraPlanner):\n    pass\n"
)


def mbf(*arguments):
    app = typer.Typer(pretty_exceptions_enable=False)
    register(app)
    return CliRunner(env={"COLUMNS": "200"}).invoke(app, [str(argument) for argument in arguments])


def write_map(folder, name, cells):
    folder.mkdir(exist_ok=True)
    Image.fromarray(cells).save(folder / f"{name}.png")
    keys = {"image": f"{name}.png", "resolution": 0.05, "origin": [0.0, 0.0, 0.0], "negate": 0}
    (folder / f"{name}.yaml").write_text(yaml.safe_dump({**keys, "occupied_thresh": 0.65, "free_thresh": 0.196}))


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """Folder of a finished run on a mesh whose scenario is gone, made with settings of its own."""
    folder = tmp_path_factory.mktemp("mesh")
    source = folder / "source"
    source.mkdir()
    (source / "nav.yaml").write_text(MESH)
    world = "{type: generated, size: [6.0, 5.0], spacing: 0.5, median_slope: 2.0}"
    (source / "trial.yaml").write_text(SCENARIO.format(backend="mesh", world=world))
    settings = ("--set", "world.median_slope=3.0", "--planner", "astar", "--executive", "classic", "--seed", 9)
    result = mbf("run", source / "trial.yaml", *settings, "--out", folder / "run", "--quiet")
    assert result.exit_code == 0, result.output
    shutil.rmtree(source)
    return folder / "run"


@pytest.fixture
def mesh_run(finished, tmp_path):
    """A copy of it, to be spoiled."""
    return shutil.copytree(finished, tmp_path / "run")


def change(file, **keys):
    file.write_text(yaml.safe_dump(yaml.safe_load(file.read_text()) | keys))


def test_a_run_on_a_mesh_repeats_without_the_files_it_came_from(mesh_run, tmp_path):
    result = mbf("rerun", mesh_run, "--out", tmp_path / "again", "--json")

    answer = json.loads(result.stdout)
    assert result.exit_code == 0, result.output
    assert answer["same_drive"] and answer["results"] == answer["surroundings"] == answer["changed_files"] == []
    assert (tmp_path / "again" / "events.jsonl").read_bytes() == (mesh_run / "events.jsonl").read_bytes()
    record = yaml.safe_load((mesh_run / "provenance.yaml").read_text())
    assert record["command"] == (
        "mbf run trial.yaml --seed 9 --out run --planner astar --set world.median_slope=3.0 --executive classic --quiet"
    )
    assert set(record["code"]) == {"mbf_abstract", "mbf_mesh_nav", "terrain"}
    assert set(record["files"]) == {"scenario.yaml", "navigation.yaml", "world.ply"}


def test_another_drive_is_exit_code_1_and_all_that_differs_is_named(mesh_run, tmp_path):
    change(mesh_run / "scenario.yaml", seed=10)
    change(mesh_run / "provenance.yaml", live_page=True, versions={"numpy": "1.2.3"})

    result = mbf("rerun", mesh_run, "--out", tmp_path / "again", "--quiet")

    assert result.exit_code == 1
    assert "another drive: at 0.00 s the robot is elsewhere" in result.output
    assert "had a live page" in result.output
    assert "changed or missing in the folder: scenario.yaml" in result.output
    assert "numpy: 1.2.3 -> " in result.output and "seed: 9 -> 10" in result.output


def test_a_run_of_a_map_with_own_plugin_and_zones_repeats_and_keeps_paths_to_itself(tmp_path, monkeypatch):
    source = tmp_path / "source"
    source.mkdir()
    (source / "own_planner.py").write_text(OWN_PLANNER)
    monkeypatch.syspath_prepend(str(source))
    free = np.full((100, 120), 254, np.uint8)
    walls, mask = free.copy(), free.copy()
    walls[[0, -1], :] = walls[:, [0, -1]] = 0
    mask[40:60, 52:56] = 0  # on the straight way
    write_map(source, "floor", walls)
    write_map(source / "maps", "mask", mask)
    (source / "nav.yaml").write_text(COSTMAP)
    (source / "trial.yaml").write_text(SCENARIO.format(backend="costmap", world="{type: map, file: floor.yaml}"))
    first = mbf("run", source / "trial.yaml", "--map", source / "floor.yaml", "--out", tmp_path / "run", "--quiet")
    assert first.exit_code == 0, first.output
    for folder in (source / "maps", source / "floor.png", source / "nav.yaml"):
        shutil.rmtree(folder) if folder.is_dir() else folder.unlink()

    result = mbf("rerun", tmp_path / "run", "--out", tmp_path / "again", "--json")

    assert result.exit_code == 0, result.output
    record = yaml.safe_load((tmp_path / "run" / "provenance.yaml").read_text())
    copies = {"floor.yaml", "floor.png", "mask.yaml", "mask.png"}
    assert {f"inputs/{name}" for name in copies} < set(record["files"])
    assert "own_planner" in record["code"]
    for file in (tmp_path / "run").rglob("*"):
        assert file.is_dir() or str(tmp_path).encode() not in file.read_bytes(), file


@pytest.mark.parametrize(
    ("name", "text", "expected"),
    [
        ("provenance.yaml", None, "the folder of a run, with provenance.yaml"),
        ("metrics.json", None, "the metrics of a finished run"),
        ("metrics.json", "{}", "the metrics of a finished run"),
        ("metrics.json", "{", "no JSON"),
        ("navigation.yaml", None, "navigation.mesh: expected a configuration file"),
        ("scenario.yaml", "robot: {", "scenario.yaml:1"),
    ],
)
def test_a_folder_that_cannot_be_repeated_is_one_clear_error(name, text, expected, mesh_run, tmp_path):
    (mesh_run / name).unlink() if text is None else (mesh_run / name).write_text(text)

    result = mbf("rerun", mesh_run, "--out", tmp_path / "again", "--quiet")

    assert result.exit_code == 2
    assert expected in result.output and "1 mistake found" in result.output
    assert not (tmp_path / "again" / "metrics.json").exists()


def test_a_run_in_real_time_and_the_folder_itself_are_refused(mesh_run, tmp_path):
    assert "another folder for the repetition" in mbf("rerun", mesh_run, "--out", mesh_run).output
    change(mesh_run / "provenance.yaml", clock="real")

    result = mbf("rerun", mesh_run, "--out", tmp_path / "again")

    assert result.exit_code == 2 and "real time (--wall-clock) gives another drive" in result.output
