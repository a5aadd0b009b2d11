"""What is found in a configuration reaches the user; a robot is never wider than its inflation."""

import numpy as np
import pytest
from PIL import Image

from command_line import mbf
from mbf_abstract.maps.layers.layer_list import LayerListError
from mbf_mesh_nav.map.map_builder import build_mesh_map
from mbf_mesh_nav.map.map_parameters import MeshMapParameters
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh

NARROW = "global_costmap: layer 'inflation': inflation_radius 0.6 m is smaller than the inscribed radius"
COSTMAPS = """
global_costmap: &map
  robot_radius: 1.5
  layers: [{name: walls, type: static}, {name: inflation, type: inflation}]
  walls: {map_file: gap.yaml}
  inflation: {inflation_radius: 0.6}
local_costmap: *map
planners: [{name: dijkstra, type: dijkstra}]
"""
SCENARIO = """
name: notes
proves: What was found in the configuration is reported.
physics: kinematic
backend: costmap
world: {type: map, file: gap.yaml}
robot: turtlebot
start: {x: 2.0, y: 3.0}
goals: [{x: 2.0, y: 3.0}]
time_limit: 10.0
navigation: {costmap: server.yaml}
"""


@pytest.fixture
def folder(tmp_path):
    """A map of two rooms of 6 m x 6 m joined by a gap of 1.7 m, and a configuration of a robot of 3 m."""
    pixels = np.full((60, 120), 254, dtype=np.uint8)
    pixels[:, 60] = 0
    pixels[21:38, 60] = 254
    Image.fromarray(pixels).save(tmp_path / "gap.png")
    (tmp_path / "gap.yaml").write_text(
        "{image: gap.png, resolution: 0.1, origin: [0, 0, 0], negate: 0, occupied_thresh: 0.65, free_thresh: 0.2}\n"
    )
    (tmp_path / "server.yaml").write_text("backend: costmap\n" + COSTMAPS)
    return tmp_path


def test_a_robot_wider_than_its_inflation_is_not_led_through_a_gap_it_does_not_fit(folder):
    planned = mbf("plan", folder / "server.yaml", "--start", 2, 3, "--goal", 10, 3)
    assert planned.exit_code == 1 and NARROW in planned.stderr, planned.output


def test_check_and_plan_and_run_report_that_the_inflation_is_narrower_than_the_robot(folder):
    assert f"note: {NARROW}" in mbf("check", folder / "server.yaml").stdout
    assert f"note: {NARROW}" in mbf("plan", folder / "server.yaml", "--start", 2, 3, "--goal", 3, 3).stderr
    (folder / "scenario.yaml").write_text(SCENARIO)
    (folder / "server.yaml").write_text(
        "backend: costmap\ncontrollers: [{name: pursuit, type: regulated_pure_pursuit}]\n"
        + COSTMAPS.replace("gap.yaml", str(folder / "gap.yaml"))
    )
    run = mbf("run", folder / "scenario.yaml", "--out", folder / "run", "--quiet")
    assert f"note: {NARROW}" in run.output, run.output


def test_an_optional_plugin_that_was_left_out_is_reported_too(folder):
    with (folder / "server.yaml").open("a") as file:
        file.write("controllers: [{name: gone, type: module_that_is_not:There, optional: true}]\n")
        file.write("allow_module_types: true\n")
    for command in (("check",), ("plan", "--start", 2, 3, "--goal", 3, 3)):
        assert "left out: optional controller 'gone'" in mbf(command[0], folder / "server.yaml", *command[1:]).output


def test_a_mesh_whose_inflation_is_made_for_a_narrower_robot_is_refused():
    vertices, faces = heightfield_mesh(np.zeros((11, 11)), 0.5, 0.5)
    parameters = MeshMapParameters(
        inscribed_radius=1.5,
        layers=[{"name": "border", "type": "border"}, {"name": "inflation", "type": "inflation", "inputs": ["border"]}],
    )
    text = r"'inflation': inflation_radius of at least the robot's radius \(mesh_map.inscribed_radius\), 1.5 m"
    with pytest.raises(LayerListError, match=text):
        build_mesh_map(parameters, {"inflation": {"inflation_radius": 0.6}}, vertices=vertices, faces=faces)


def test_two_outlines_of_one_robot_are_noted_where_something_drives(folder):
    text = COSTMAPS.replace("local_costmap: *map", "local_costmap: {robot_radius: 0.2}")
    (folder / "server.yaml").write_text("backend: costmap\n" + text)
    noted = "local_costmap: the robot's outline, 0.2 m to its farthest corner, is another one on global_costmap, 1.5 m"
    assert noted not in mbf("check", folder / "server.yaml").output
    for local, expected in (("{robot_radius: 0.2}", True), ("*map", False)):
        controllers = "controllers: [{name: pursuit, type: regulated_pure_pursuit}]\n"
        text = COSTMAPS.replace("local_costmap: *map", f"local_costmap: {local}")
        (folder / "server.yaml").write_text("backend: costmap\n" + text + controllers)
        checked = mbf("check", folder / "server.yaml")
        assert checked.exit_code == 0 and (noted in " ".join(checked.output.split())) is expected, checked.output
