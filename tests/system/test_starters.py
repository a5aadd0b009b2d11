"""``mbf config``: every starter passes ``mbf check`` with a map of its kind, and drives the robot it is meant for."""

from pathlib import Path
from string import Template

import numpy as np
import pytest
import trimesh

from command_line import mbf
from mbf_abstract.commands.starters import starters
from mbf_mesh_nav.map.map_parameters import MeshMapParameters
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh
from mbf_mesh_nav.tiles.building.build import build_tiles
from mbf_mesh_nav.tiles.building.sources import HeightSource
from mbf_mesh_nav.tiles.building.tile_settings import TileSettings
from terrain.scenarios.robots import Sensor
from terrain.scenarios.scenario import PlanarPose, Scenario
from terrain.scenarios.world_types import GeneratedWorld
from terrain.session.session import Session, SessionOptions

ROOT = Path(__file__).resolve().parents[2]
OFFICE = ROOT / "terrain" / "data" / "office.yaml"
ROBOTS = {
    "costmap_car": "car",
    "costmap_differential": "turtlebot",
    "costmap_mapless": "turtlebot",
    "costmap_omni": str(ROOT / "examples" / "robots" / "kiwi.urdf"),
    "mesh_differential": "turtlebot",
    "mesh_skid_steered": "husky",
}


@pytest.fixture(scope="module")
def maps(tmp_path_factory):
    """A map of each kind."""
    folder = tmp_path_factory.mktemp("maps")
    heights = np.zeros((49, 49))
    trimesh.Trimesh(*heightfield_mesh(heights, 0.25, 0.25), process=False).export(folder / "field.ply")
    layers = ({"name": "border", "type": "border"},)
    settings = TileSettings(MeshMapParameters(layers=layers), tile_size=12.0)
    build_tiles(HeightSource(heights, 0.25, 0.25), folder / "tiles", settings)
    return {"costmap": OFFICE, "mesh": folder / "field.ply", "tiles": folder / "tiles"}


@pytest.mark.parametrize("name", starters())
def test_every_starter_passes_the_check_with_a_map_of_its_kind(name, maps, tmp_path):
    given = [] if name.endswith("mapless") else ["--map", maps[name.partition("_")[0]]]

    written = mbf("config", name, *given, "--out", tmp_path / "robot.yaml")
    checked = mbf("check", tmp_path / "robot.yaml")

    assert written.exit_code == 0, written.output
    assert checked.exit_code == 0 and f"good; backend {name.partition('_')[0]}" in checked.output, checked.output


@pytest.mark.timeout(300)  # kernels are compiled on a machine that has none
@pytest.mark.parametrize(("name", "robot"), ROBOTS.items())
def test_a_starter_drives_the_robot_it_is_meant_for(name, robot, tmp_path):
    backend = name.partition("_")[0]
    config, world_map = tmp_path / "robot.yaml", {"costmap": "$WORLD_MAP", "mesh": "$WORLD_MESH"}[backend]
    text = Template(starters()[name]).substitute(map_file=world_map)
    config.write_text(text.replace("odom\n", "map\n").replace("odom  ", "map  "))  # scans of the simulator are in map
    scenario = Scenario(
        name=name,
        proves="A starter drives.",
        backend=backend,
        navigation={backend: config},
        world=GeneratedWorld(type="generated", size=(7.0, 5.0), spacing=0.25),
        robot=robot,
        start=PlanarPose(x=2.0, y=2.5, yaw=0.0),
        goals=(PlanarPose(x=4.0, y=2.5, yaw=0.0),),
        sensors=(Sensor(name="scan", type="planar", rate=10.0, rays=60, max_range=3.0),),
        physics="kinematic",
        time_limit=60.0,
    )
    with Session(scenario, SessionOptions()) as session:
        result = session.navigator.go_to(session.goals[0])
    assert result.success, result.message


def test_the_list_has_a_line_for_each_starter_that_fits_a_terminal():
    lines = mbf("config").output.splitlines()

    assert [line.split()[0] for line in lines] == list(starters()) and {*ROBOTS, "tiles_skid_steered"} == {*starters()}
    assert all(len(line) <= 80 and line.endswith(".") for line in lines)


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("costmap_boat",), "no starter 'costmap_boat'; known: costmap_car, costmap_differential"),
        (("costmap_car",), "costmap_car needs a map: --map FILE"),
        (("costmap_car", "--map", "nowhere.yaml"), "--map nowhere.yaml: no such file"),
        (("costmap_mapless", "--map", OFFICE), "costmap_mapless has no map: leave out --map"),
    ],
)
def test_a_bad_argument_is_named_and_nothing_is_written(arguments, text, tmp_path):
    result = mbf("config", *arguments, "--out", tmp_path / "robot.yaml")

    assert result.exit_code == 2 and text in result.stderr
    assert not (tmp_path / "robot.yaml").exists()


def test_the_path_of_the_map_starts_at_the_configuration_and_a_file_is_not_overwritten(tmp_path, monkeypatch):
    (tmp_path / "maps").mkdir()
    (tmp_path / "maps" / "my office.yaml").write_text("image: office.png\n")
    (tmp_path / "config").mkdir()
    monkeypatch.chdir(tmp_path)
    arguments = ("config", "costmap_car", "--map", "maps/my office.yaml")

    assert 'map_file: "maps/my office.yaml"' in mbf(*arguments).output
    assert mbf(*arguments, "--out", "config/robot.yaml").exit_code == 0
    assert 'map_file: "../maps/my office.yaml"' in Path("config/robot.yaml").read_text()
    assert mbf(*arguments, "--out", "config/robot.yaml").exit_code == 2


@pytest.mark.parametrize(("name", "expected"), [("mesh_differential", "mesh"), ("costmap_car", "costmap")])
def test_a_map_of_another_kind_is_refused_before_a_file_is_written(name, expected, tmp_path):
    (tmp_path / "my ground.ply").write_bytes(b"ply\n")
    file, other = (OFFICE, "costmap") if expected == "mesh" else (tmp_path / "my ground.ply", "mesh")
    result = mbf("config", name, "--map", file, "--out", tmp_path / "robot.yaml")
    assert result.exit_code == 2 and not (tmp_path / "robot.yaml").exists()
    assert f"{file}: expected a map of the backend {expected}, got one of {other}" in result.output


def test_the_next_command_is_printed_as_a_shell_takes_it(tmp_path):
    result = mbf("config", "costmap_car", "--map", OFFICE, "--out", tmp_path / "my robot.yaml")
    assert f"then mbf check '{tmp_path}/my robot.yaml'" in result.output
