"""A recorded drive towards a wall, as bags of every kind, and configurations that see the wall."""

import math

import numpy as np
import pytest

from mbf_abstract.server.factory import read_config
from mbf_ros.bags.reading import open_bag
from mbf_ros.bags.replay import replay_bag
from mbf_ros.bags.replay_options import ReplayOptions
from mbf_ros.bags.writing import BagMessage, message_object, write_bag

BEGAN = 1_700_000_000_250_000_000  # ns
SPEED, WALL, LASER = 0.5, 3.0, 0.1  # m/s, x of the wall and of the laser in base_link [m]

COSTMAP = """\
backend: costmap
planners: [{name: straight, type: straight_line}]
planner_max_retries: 0
global_costmap:
  {width: 6.0, height: 4.0, resolution: 0.1, origin_x: -1.0, origin_y: -2.0, robot_radius: 0.2, update_frequency: 5.0,
   layers: [{name: obstacles, type: obstacle}],
   obstacles: {sources: {lidar: {obstacle_max_range: 8.0, raytrace_max_range: 8.0}}}}
local_costmap:
  {rolling_window: true, width: 2.0, height: 2.0, resolution: 0.1, robot_radius: 0.2,
   layers: [{name: obstacles, type: obstacle}],
   obstacles: {sources: {lidar: {}}}}
"""
MESH = """\
backend: mesh
planners: [{name: dijkstra, type: dijkstra}]
mesh_map:
  {mesh_file: floor.ply, inscribed_radius: 0.2, update_frequency: 5.0, default_layer: obstacles,
   layers: [{name: obstacles, type: obstacle}], obstacles: {sources: [lidar]}}
"""


def stamp(seconds):
    sec, nanosec = divmod(BEGAN + round(seconds * 1e9), 10**9)
    return {"sec": sec, "nanosec": nanosec}


def header(frame, seconds):
    return {"frame_id": frame, "stamp": stamp(seconds)}


def transform(seconds, parent, child, x):
    body = {"translation": {"x": x, "y": 0.0, "z": 0.0}, "rotation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}}
    return {"header": header(parent, seconds), "child_frame_id": child, "transform": body}


def message(seconds, topic, kind, values, latched=False):
    return BagMessage(BEGAN + round(seconds * 1e9), topic, kind, values, latched)


def tf(seconds, x, delay=0.0):
    found = [transform(seconds, "/map", "odom", 0.0), transform(seconds, "odom", "/base_link", x)]
    return message(seconds + delay, "/tf", "tf2_msgs/TFMessage", {"transforms": found})


def static():
    values = {"transforms": [transform(0.0, "base_link", "laser", LASER)]}
    return message(0.0, "/tf_static", "tf2_msgs/TFMessage", values, True)


def scan(seconds, x, topic="/base_scan", frame="/laser", delay=0.0):
    """What a laser at ``x`` + LASER sees: a wall across, as wide as its view, and nothing behind it."""
    angles = -1.0 + 0.02 * np.arange(101)
    values = {
        "header": header(frame, seconds), "angle_min": -1.0, "angle_max": 1.0, "angle_increment": 0.02,
        "range_min": 0.1, "range_max": 8.0, "ranges": [(WALL - x - LASER) / math.cos(a) for a in angles.tolist()],
    }  # fmt: skip
    return message(seconds + delay, topic, "sensor_msgs/LaserScan", values)


def odometry(seconds, x):
    place = {"pose": {"position": {"x": x, "y": 0.0}}}
    values = {
        "header": header("odom", seconds), "child_frame_id": "base_link", "pose": place,
        "twist": {"twist": {"linear": {"x": SPEED}}},
    }  # fmt: skip
    return message(seconds, "/odom", "nav_msgs/Odometry", values)


def drive(duration=2.0):
    """A drive: transforms at 20 Hz, scans and odometry at 10 Hz."""
    messages = [static()]
    for tick in range(round(duration * 20) + 1):
        seconds = tick / 20
        messages.append(tf(seconds, SPEED * seconds))
        if tick % 2 == 0:
            messages += [odometry(seconds, SPEED * seconds), scan(seconds, SPEED * seconds)]
    return messages


def make_bag(folder, messages, kind="mcap"):
    """Write a bag of ``ros1``, ``sqlite3`` or ``mcap``, or its only file ``.db3`` or ``.mcap``; return its path."""
    if kind.startswith("."):
        written = make_bag(folder, messages, "sqlite3" if kind == ".db3" else "mcap")
        (written / "metadata.yaml").unlink()
        return next(written.glob(f"*{kind}"))
    if kind == "mcap":
        write_bag(folder / "drive", messages)
        return folder / "drive"
    return make_ros1_bag(folder, messages) if kind == "ros1" else make_sqlite_bag(folder, messages)


def make_ros1_bag(folder, messages):
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store, connections = get_typestore(Stores.ROS1_NOETIC), {}
    transforms = "tf2_msgs/msg/TFMessage"  # has the same fields in both, and is no part of rosbags' ROS 1
    store.register({transforms: get_typestore(Stores.ROS2_HUMBLE).fielddefs[transforms]})
    with Writer(folder / "drive.bag") as writer:
        for one, name, values in completed_messages(messages):
            if one.topic not in connections:
                connections[one.topic] = writer.add_connection(one.topic, name, typestore=store)
            content = store.serialize_ros1(message_object(store, name, values), name)
            writer.write(connections[one.topic], one.time, content)
    return folder / "drive.bag"


def make_sqlite_bag(folder, messages):
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store, connections = get_typestore(Stores.ROS2_HUMBLE), {}
    with Writer(folder / "drive", version=8, storage_plugin=StoragePlugin.SQLITE3) as writer:
        for one, name, values in completed_messages(messages):
            if one.topic not in connections:
                connections[one.topic] = writer.add_connection(one.topic, name, typestore=store)
            content = store.serialize_cdr(message_object(store, name, values), name)
            writer.write(connections[one.topic], one.time, content)
    return folder / "drive"


def completed_messages(messages):
    from mbf_ros.messages.interfaces import completed, full_name

    for one in messages:
        yield one, full_name(one.type), completed(one.type, one.message)


def write_floor(file):
    """A mesh of squares of 0.25 m, 5 m by 3 m, at the height of the laser's rays minus 0.2 m."""
    import trimesh

    xs, ys = np.arange(-1.0, 4.01, 0.25), np.arange(-1.5, 1.51, 0.25)
    x, y = np.meshgrid(xs, ys)
    vertices = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, -0.2)])
    i = (np.arange(len(ys) - 1)[:, None] * len(xs) + np.arange(len(xs) - 1)).ravel()
    w = len(xs)
    faces = np.concatenate([np.column_stack([i, i + 1, i + w]), np.column_stack([i + 1, i + w + 1, i + w])])
    trimesh.Trimesh(vertices, faces, process=False).export(file)


@pytest.fixture
def configuration(tmp_path):
    """Write a configuration; returns its path."""

    def write(text=COSTMAP):
        file = tmp_path / "robot.yaml"
        file.write_text(text)
        if "floor.ply" in text:
            write_floor(tmp_path / "floor.ply")
        return file

    return write


@pytest.fixture
def replayed(tmp_path, configuration):
    """Replay messages, or a bag, into a configuration."""

    def run(messages, text=COSTMAP, **options):
        path = messages if not isinstance(messages, list) else make_bag(tmp_path, messages)
        with open_bag(path) as bag:
            return replay_bag(bag, *read_config(configuration(text)), ReplayOptions(**options))

    return run


def last_grid(replayed):
    """Cells of the last picture that are forbidden."""
    return replayed.log.maps[-1][1].costs >= 1.0
