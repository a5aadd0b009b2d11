"""``mbf run`` on a map of tiles: planned, driven around what no map shows, drawn, and checked like any other run."""

import numpy as np
import pytest

from command_line import mbf
from mbf_mesh_nav.map.map_parameters import MeshLayerEntry, MeshMapParameters
from mbf_mesh_nav.tiles.building.build import build_tiles
from mbf_mesh_nav.tiles.building.sources import HeightSource
from mbf_mesh_nav.tiles.building.tile_settings import TileSettings
from terrain.recording.run_folder import read_run

SCENARIO = """
name: tiled
proves: A robot passes a post that is on no tile.
backend: tiles
navigation: {tiles: nav.yaml}
world: {type: generated, size: [12.0, 10.0], spacing: 0.5}
robot: husky
start: {x: 2.5, y: 5.0}
goals: [{x: 9.0, y: 5.0}]
sensors: [{name: lidar, type: rings, rate: 4.0, rays: 120, max_range: 6.0}]
obstacles: [{shape: cylinder, size: [0.3, 0.3, 1.0], x: 6.0, y: 5.0}]
limits: {forbidden: [collision]}
physics: kinematic
time_limit: 60.0
"""
NAVIGATION = """
backend: tiles
controller_frequency: 10.0
planner_frequency: 1.0
replan_failed_policy: keep
dist_tolerance: 0.4
angle_tolerance: 3.14
planners: [{name: far, type: tiles.hierarchical}]
far: {repair: true}
controllers: [{name: follower, type: path_follower}]
tiled_map:
  folder: ground
  window: 24.0
  layers:
    - {name: obstacles, type: obstacle}
    - {name: around, type: inflation, inputs: [obstacles]}
  obstacles: {sources: [lidar], robot_height: 0.6, obstacle_max_range: 4.0, ground_tolerance: 0.25, decay_time: 30.0}
  around: {inscribed_radius: 0.5, inflation_radius: 1.0, lethal_value: .inf}
"""


@pytest.fixture
def scenario(tmp_path):
    """A scenario file, its navigation and a folder of four tiles beside it."""
    layers = (MeshLayerEntry(name="slopes", type="steepness"), MeshLayerEntry(name="border", type="border"))
    parameters = MeshMapParameters(layers=layers, inscribed_radius=0.3)
    heights = HeightSource(np.zeros((21, 25)), 0.5, 0.5)
    build_tiles(heights, tmp_path / "ground", TileSettings(mesh_map=parameters, tile_size=6.0))
    (tmp_path / "nav.yaml").write_text(NAVIGATION)
    (tmp_path / "scenario.yaml").write_text(SCENARIO)
    return tmp_path / "scenario.yaml"


def test_a_run_on_tiles_is_checked_driven_and_drawn_with_what_the_lidar_saw(scenario, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path.parent)  # the folder of tiles counts from the configuration
    checked = mbf("check", scenario)
    assert checked.exit_code == 0, checked.output
    out = tmp_path / "run"
    done = mbf("run", scenario, "--out", out)
    assert done.exit_code == 0, done.output
    assert "repaired where" in (out / "events.jsonl").read_text()
    assert {"picture.png", "replay.html", "report.html"} <= {file.name for file in out.iterdir()}
    recording, _ = read_run(out)
    last = recording.grids[-1]
    x_min, x_max, y_min, y_max = last.extent
    rows, columns = last.cells.shape
    row, column = int((5.0 - y_min) / (y_max - y_min) * rows), int((6.0 - x_min) / (x_max - x_min) * columns)
    assert last.cells[row, column] == 100, "the picture shows the post"
    assert last.cells[row, columns // 4] < 100, "and free ground"
