"""The interface file has the types of ROS 2, proved by their RIHS01 hashes, and messages are checked against it."""

import base64
import json
import math
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from mbf_ros.messages.interfaces import MessageError, completed, fields_of, known_types
from mbf_ros.messages.json_text import json_text

COMPILED = dict(
    line.split()
    for line in (Path(__file__).parent / "type_hashes.txt").read_text().splitlines()
    if not line.startswith("#")
)
PLACEHOLDER = "uint8 structure_needs_at_least_one_member"  # what rosidl puts into a type without fields
OURS_ONLY = ("std_srvs/", "map_msgs/", "mesh_msgs/", "actionlib_msgs/", "move_base_msgs/")
"""Packages that are in neither of the two lists."""


def definition(type_name):
    lines = [
        f"{f.type if f.length is None else f'{f.type}[{f.length or str()}]'} {f.name}" for f in fields_of(type_name)
    ]
    return "\n".join(lines or [PLACEHOLDER])


@pytest.fixture(scope="module")
def our_types():
    store = get_typestore(Stores.EMPTY)
    for name in known_types():
        (fields,) = get_types_from_msg(definition(name), name).values()  # under a name that is wrong for services
        store.register({name: fields})
    return store


@pytest.mark.parametrize("name", COMPILED)
def test_a_type_is_the_same_on_the_wire_as_the_compiled_one(our_types, name):
    assert our_types.hash_rihs01(name) == COMPILED[name]


def test_every_other_type_is_the_one_of_ros_2_jazzy_or_kilted(our_types):
    jazzy, kilted = get_typestore(Stores.ROS2_JAZZY), get_typestore(Stores.ROS2_KILTED)
    others = [name for name in known_types() if name not in COMPILED and not name.startswith(OURS_ONLY)]
    different = [
        name
        for name in others
        if our_types.hash_rihs01(name) != (kilted if name in kilted.fielddefs else jazzy).hash_rihs01(name)
    ]
    assert different == []
    assert len(others) > 25


def test_every_type_of_a_field_is_known():
    numbers = {f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)}
    plain = {"bool", "byte", "string", "float32", "float64", *numbers}
    used = {field.type for name in known_types() for field in fields_of(name)} - plain
    assert used <= set(known_types())


def test_an_unknown_type_is_named():
    with pytest.raises(MessageError, match="unknown message type 'geometry_msgs/Pos'"):
        completed("geometry_msgs/Pos", {})


def test_a_missing_field_is_named_with_its_place():
    values = {"target_pose": {"pose": {"position": {"x": 1.0}}}}
    with pytest.raises(MessageError, match=r"Goal\.target_pose\.pose\.position: the field 'y' of .*Point is missing"):
        completed("mbf_msgs/action/MoveBase_Goal", values)


def test_a_goal_without_a_target_is_not_one_for_the_origin():
    with pytest.raises(MessageError, match="the field 'target_pose' of mbf_msgs/action/MoveBase_Goal is missing"):
        completed("mbf_msgs/action/MoveBase_Goal", {"planner": "astar"})


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({"header": 3}, "header: expected an object with the fields of std_msgs/msg/Header, got 3"),
        ({"header": {"frame_id": 3}}, r"header\.frame_id: expected a string, got 3"),
        ({"header": {"stamp": {"sec": 0.5}}}, r"header\.stamp\.sec: expected a int32 .*got 0\.5"),
        ({"header": {"stamp": {"sec": 2**31}}}, "got 2147483648"),
        ({"header": {"stamp": {"sec": True}}}, "got True"),
        ({"header": {"stamp": {"nanosec": -1}}}, r"expected a uint32 \(0 to 4294967295\), got -1"),
        ({"headre": {}}, "has no field 'headre'; it has header, poses"),
        ({"poses": {}}, r"poses: expected a list of geometry_msgs/msg/PoseStamped, got \{\}"),
        ({"poses": [1]}, r"poses\[0\]: expected an object"),
        ([], r"expected an object with the fields of nav_msgs/Path, got \[\]"),
        (None, "got None"),
    ],
)
def test_a_wrong_field_is_named_with_what_is_expected_and_got(values, text):
    with pytest.raises(MessageError, match=text):
        completed("nav_msgs/Path", {"poses": [], **values} if isinstance(values, dict) else values)


def test_what_is_left_out_gets_the_defaults_of_ros():
    pose = completed("geometry_msgs/Pose", {"position": {"x": 1, "y": 2}})
    assert pose == {
        "position": {"x": 1.0, "y": 2.0, "z": 0.0},
        "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
    }


def test_times_and_headers_of_ros_1_are_taken():
    header = completed("std_msgs/Header", {"seq": 7, "stamp": {"secs": 3, "nsecs": 4}, "frame_id": "map"})
    assert header == {"stamp": {"sec": 3, "nanosec": 4}, "frame_id": "map"}


def test_lists_of_numbers_are_arrays_and_may_hold_null_for_nan():
    scan = completed(
        "sensor_msgs/LaserScan",
        {"header": {}, "angle_min": 0, "angle_increment": 0.1, "range_max": 5, "ranges": [1, None, 2.5, 1e300]},
    )
    assert scan["ranges"].dtype == np.float32
    np.testing.assert_array_equal(scan["ranges"], np.float32([1, math.nan, 2.5, math.inf]))


def test_bytes_are_base64_or_a_list():
    by_text = completed("sensor_msgs/CompressedImage", {"data": "AQL/"})["data"]
    by_list = completed("sensor_msgs/CompressedImage", {"data": [1, 2, 255]})["data"]
    assert by_text.tolist() == by_list.tolist() == [1, 2, 255]
    with pytest.raises(MessageError, match=r"CompressedImage\.data: expected bytes in base64"):
        completed("sensor_msgs/CompressedImage", {"data": "not base64!"})


def test_json_has_null_for_what_is_not_finite_and_base64_for_bytes():
    values = {
        "a": math.inf,
        "b": [math.nan, 1.5],
        "c": np.array([1.0, -math.inf]),
        "d": np.uint8([1, 2, 255]),
        "e": np.int8([-1]),
    }
    text = json_text(values)
    assert json.loads(text) == {"a": None, "b": [None, 1.5], "c": [1.0, None], "d": "AQL/", "e": [-1]}


def plain(value):
    """The naive twin of ``json_text``: values for the library's encoder."""
    if isinstance(value, dict):
        return {key: plain(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [plain(inner) for inner in value]
    if isinstance(value, np.ndarray):
        return base64.b64encode(value.tobytes()).decode() if value.dtype == np.uint8 else plain(value.tolist())
    return None if isinstance(value, float) and not math.isfinite(value) else value


numbers = st.lists(st.floats() | st.integers(-(2**31), 2**31 - 1), max_size=8)
leaves = (
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text()
    | numbers.map(np.array)
    | st.binary().map(lambda data: np.frombuffer(data, np.uint8))
)


@given(st.recursive(leaves, lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner), max_leaves=12))
def test_a_message_is_written_as_the_librarys_encoder_would_write_it(value):
    assert json.loads(json_text(value)) == json.loads(json.dumps(plain(value), allow_nan=False))


@pytest.mark.parametrize("count", [0, 9_999, 10_000, 10_001, 25_000])
def test_a_long_list_is_written_whole(count):
    assert json.loads(json_text(np.arange(count))) == list(range(count))


def test_the_interface_file_comes_with_the_package():
    assert files("mbf_ros.messages").joinpath("interfaces.txt").is_file()


@given(st.lists(st.one_of(st.integers(-200, 300), st.sampled_from([True, 3.0, 2.5, "1", None, 2**70, -(2**70)]))))
def test_a_list_of_whole_numbers_is_what_its_numbers_are_one_by_one(values):
    def one_by_one():
        for i, value in enumerate(values):
            completed("map_msgs/OccupancyGridUpdate", {"width": 1, "height": 1, "data": [0] * i + [value]})
            yield int(value)

    def found(read):
        try:
            return list(read())
        except MessageError as error:
            return str(error)

    message = {"width": 1, "height": 1, "data": values}
    assert found(lambda: completed("map_msgs/OccupancyGridUpdate", message)["data"].tolist()) == found(one_by_one)
