"""A recorded map becomes a file that static layers read, cell by cell as it was."""

import math

import numpy as np
import pytest
from typer.testing import CliRunner

from mbf_abstract.cli import make_app
from mbf_abstract.server.factory import read_floor
from mbf_ros.bags.reading import BagError, open_bag
from mbf_ros.bags.recorded_map import read_recorded_map, write_recorded_map
from mbf_ros.messages.interfaces import completed
from tests.unit.bags.conftest import COSTMAP, drive, header, last_grid, make_bag, message

CELLS = np.random.default_rng(0).choice([-1, 0, 30, 65, 99, 100], size=(4, 6)).astype(np.int8)


def grid(seconds, cells, topic="/map", resolution=0.05, yaw_w=1.0):
    height, width = cells.shape
    origin = {"position": {"x": -1.5, "y": 0.25, "z": 0.0}, "orientation": {"w": yaw_w}}
    info = {"resolution": resolution, "width": width, "height": height, "origin": origin}
    values = {"header": header("map", seconds), "info": info, "data": cells.reshape(-1)}
    return message(seconds, topic, "nav_msgs/OccupancyGrid", values, True)


def run(*arguments):
    return CliRunner().invoke(make_app(), ["bag", "map", *map(str, arguments)])


@pytest.mark.parametrize("kind", ["ros1", "sqlite3", "mcap"])
def test_every_cell_is_kept(tmp_path, kind):
    bag = make_bag(tmp_path, [grid(0.0, CELLS)], kind)
    assert run(bag, "--out", tmp_path / "office.yaml").exit_code == 0
    floor = read_floor(tmp_path / "office.yaml")
    np.testing.assert_array_equal(floor.occupancy, CELLS.astype(np.uint8))  # -1 is 255, unknown
    assert (floor.resolution, floor.origin_x, floor.origin_y) == (0.05, -1.5, 0.25)


def test_the_map_of_a_time_is_the_last_one_until_then(tmp_path):
    bag = make_bag(tmp_path, [grid(0.0, CELLS), grid(2.0, CELLS[:2]), *drive(3.0)[-1:]])
    for at, rows in ((1.0, 4), (2.5, 2)):
        file = tmp_path / f"at_{rows}.yaml"
        run(bag, "--out", file, "--at", at)
        assert len(read_floor(file).occupancy) == rows


def test_the_image_is_found_whatever_its_name(tmp_path):
    bag = make_bag(tmp_path, [grid(0.0, CELLS)])
    assert run(bag, "--out", tmp_path / 'ground: "a" # 1 é.yaml').exit_code == 0
    assert read_floor(tmp_path / 'ground: "a" # 1 é.yaml').occupancy.shape == CELLS.shape


@pytest.mark.parametrize("name", ["map.yaml", "map.pgm"])
def test_files_that_are_there_are_not_overwritten(tmp_path, monkeypatch, name):
    make_bag(tmp_path, [grid(0.0, CELLS)])
    monkeypatch.chdir(tmp_path)
    (tmp_path / name).write_text("mine")
    refused = run("drive")
    assert refused.exit_code == 2 and f"{name}: expected a file that does not exist yet" in refused.output
    assert (tmp_path / name).read_text() == "mine" and len(list(tmp_path.glob("map.*"))) == 1


def test_a_topic_without_a_map_says_so(tmp_path):
    from rosbags.rosbag2 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    with Writer(tmp_path / "drive", version=8) as writer:
        writer.add_connection("/map", "nav_msgs/msg/OccupancyGrid", typestore=store)
        chatter = writer.add_connection("/chatter", "std_msgs/msg/Empty", typestore=store)
        writer.write(chatter, 10**9, b"\x00\x01\x00\x00\x00")
    with open_bag(tmp_path / "drive") as bag:
        with pytest.raises(BagError, match=r"expected a map on /map, got none$"):
            read_recorded_map(bag, "/map", math.inf)
        with pytest.raises(BagError, match=r"expected a map on /map in the first 0 s, got none$"):
            read_recorded_map(bag, "/map", 0.0)


def test_a_time_that_is_no_number_is_refused(tmp_path):
    with (
        open_bag(make_bag(tmp_path, [grid(0.0, CELLS)])) as bag,
        pytest.raises(ValueError, match="--at: expected 0 s or more, got nan"),
    ):
        read_recorded_map(bag, "/map", math.nan)


def test_a_time_after_the_end_of_the_bag_is_refused(tmp_path):
    bag = make_bag(tmp_path, [grid(0.0, CELLS), *drive(0.5)[-1:]])
    refused = run(bag, "--out", tmp_path / "map.yaml", "--at", "9")
    assert refused.exit_code == 2 and not (tmp_path / "map.yaml").exists()
    assert "error: --at: expected at most 0.500 s, where the bag ends, got 9 s" in refused.output


def test_of_several_maps_the_one_named_map_is_taken_or_asked_for(tmp_path):
    bag = make_bag(tmp_path, [grid(0.0, CELLS, "/global_costmap/costmap"), grid(0.0, CELLS[:3], "/robot/map")])
    assert "6 x 3 cells" in run(bag, "--out", tmp_path / "a.yaml").output
    assert "6 x 4" in run(bag, "--out", tmp_path / "b.yaml", "--topic", "/global_costmap/costmap").output
    (tmp_path / "two").mkdir()
    two = make_bag(tmp_path / "two", [grid(0.0, CELLS, "/one/map"), grid(0.0, CELLS, "/two/map")])
    refused = run(two, "--out", tmp_path / "c.yaml")
    assert refused.exit_code == 2 and "got /one/map, /two/map; choose by --topic" in refused.output
    assert "--topic: expected a topic of" in run(bag, "--topic", "/robot/odom").output


def test_a_replay_with_the_recorded_map_has_its_walls(tmp_path, replayed):
    walls = np.zeros((40, 60), np.int8)
    walls[5, 7] = 100
    bag = make_bag(tmp_path, [grid(0.0, walls, resolution=0.1), *drive(0.5)])
    run(bag, "--out", tmp_path / "office.yaml")
    static = COSTMAP.replace("layers: [{name", "layers: [{name: walls, type: static}, {name", 1)
    static = static.replace("robot_radius: 0.2, update", "walls: {map_file: office.yaml}, robot_radius: 0.2, update")
    assert last_grid(replayed(bag, static))[5, 7]


def test_a_replay_takes_the_recorded_map_where_a_layer_expects_it(tmp_path, replayed):
    walls = np.zeros((40, 60), np.int8)
    walls[5, 7] = 100
    static = COSTMAP.replace("layers: [{name", "layers: [{name: walls, type: static}, {name", 1)
    static = static.replace("robot_radius: 0.2, update", "walls: {map_topic: map}, robot_radius: 0.2, update")
    made = replayed(make_bag(tmp_path, [grid(0.0, walls, resolution=0.1), *drive(0.5)]), static)
    assert last_grid(made)[5, 7] and made.topics["/map"].used_as == "map"


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"width": 5}, "data: expected 5 x 4 cells, at least one, got 24"),
        ({"resolution": 0.0}, "info.resolution: expected 0.0001 to 1000 m, got 0"),
        ({"origin": {"position": {"x": float("nan"), "y": 0.0}}}, "the recorded map: info.origin: "),
    ],
)
def test_a_map_that_means_nothing_is_refused(tmp_path, change, text):
    values = grid(0.0, CELLS).message
    broken = completed("nav_msgs/OccupancyGrid", {**values, "info": {**values["info"], **change}})
    with pytest.raises(BagError, match=text):
        write_recorded_map(tmp_path / "office.yaml", broken)


def test_a_bag_without_a_map_says_so(tmp_path):
    with open_bag(make_bag(tmp_path, drive(0.1))) as bag:
        assert "/map" not in bag.types
    assert "expected one topic of the type nav_msgs/msg/OccupancyGrid, got none" in run(tmp_path / "drive").output
    assert "expected a .yaml file, got" in run(tmp_path / "drive", "--out", tmp_path / "map.pgm").output
