"""Messages as bytes of ROS 2: the same as those of rosbags, whose bytes rclpy reads (tests/system/ros2)."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from mbf_abstract.maps.view import FieldView, MeshView
from mbf_ros.bags.writing import message_object
from mbf_ros.messages import maps
from mbf_ros.messages.cdr import serialized
from mbf_ros.messages.geometry import MessageContext
from mbf_ros.messages.interfaces import completed, fields_of, full_name, known_types
from mbf_ros.messages.records import colors, points, triangles

CONTEXT = MessageContext("map", 1000.0)
MESH = MeshView(
    np.random.default_rng(1).random((5, 3)), np.int32([[0, 1, 2], [2, 3, 4]]), np.float32([0, 0.5, 2, 1, np.inf])
)
MESSAGES = {
    "nav_msgs/OccupancyGrid": maps.occupancy_grid(np.eye(3, dtype=np.int8), (0, 3, 0, 3), "map", 1.0, CONTEXT),
    "map_msgs/OccupancyGridUpdate": maps.occupancy_grid_update(
        np.eye(3, dtype=np.int8), maps.CellWindow(0, 1, 3, 2), "odom", 2.0, CONTEXT
    ),
    "geometry_msgs/PolygonStamped": maps.polygon(np.eye(3), "map", 1.5, CONTEXT),
    "mesh_msgs/MeshGeometryStamped": maps.mesh_geometry(MESH, "mbf", "map", 1.0, CONTEXT),
    "mesh_msgs/MeshVertexCostsStamped": maps.mesh_costs(MESH, "mbf", "layer", "map", 1.0, CONTEXT),
    "mesh_msgs/VectorFieldStamped": maps.vector_field(
        FieldView(np.eye(3), np.ones((3, 3), np.float32)), "map", 1.0, CONTEXT
    ),
    "visualization_msgs/MarkerArray": maps.mesh_markers(MESH, "map", 1.0, CONTEXT),
    "visualization_msgs/Marker": maps.field_markers(
        FieldView(np.zeros((2, 3)), np.ones((2, 3), np.float32)), "map", 0.0, CONTEXT
    )["markers"][0],
    "diagnostic_msgs/DiagnosticArray": {
        "status": [{"level": 2, "name": "größer", "message": "", "values": [{"key": "a", "value": "bcd"}]}, {}]
    },
    "std_msgs/Empty": {},
    "mbf_msgs/action/ExePath_Feedback": {"dist_to_goal": float("inf"), "message": "x"},
}


@pytest.fixture(scope="module")
def store():
    store = get_typestore(Stores.EMPTY)
    for name in known_types():
        lines = [
            f"{f.type if f.length is None else f'{f.type}[{f.length or str()}]'} {f.name}" for f in fields_of(name)
        ]
        text = "\n".join(lines or ["uint8 structure_needs_at_least_one_member"])
        (fields,) = get_types_from_msg(text, name).values()
        store.register({name: fields})
    return store


@pytest.mark.parametrize("name", MESSAGES)
def test_the_bytes_are_those_of_rosbags(store, name):
    message = completed(name, MESSAGES[name])
    full = full_name(name)
    assert serialized(name, MESSAGES[name] if name in WHOLE else message) == bytes(
        store.serialize_cdr(message_object(store, full, message), full)
    )


WHOLE = tuple(name for name, message in MESSAGES.items() if set(message) == {field.name for field in fields_of(name)})


@given(st.lists(st.tuples(*3 * [st.floats(-1e3, 1e3)]), max_size=5))
def test_records_are_the_list_of_their_messages(rows):
    listed = [{"x": x, "y": y, "z": z} for x, y, z in rows]
    records = points(np.array(rows))
    assert list(records) == listed and len(records) == len(rows)
    assert [records[i] for i in range(len(rows))] == listed and list(records[1:]) == listed[1:]


def test_records_of_colours_and_triangles_have_the_names_of_their_fields():
    assert list(colors(np.array([[0.0, 0.5, 1.0, 1.0]]))) == [{"r": 0.0, "g": 0.5, "b": 1.0, "a": 1.0}]
    (triangle,) = triangles(np.int32([[1, 2, 3]]))
    assert triangle["vertex_indices"].tolist() == [1, 2, 3]
