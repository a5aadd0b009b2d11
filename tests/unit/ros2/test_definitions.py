"""The interface files that are compiled have the fields of ``interfaces.txt``, proved by parsing them."""

import re
from pathlib import Path

import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from mbf_abstract.outcomes import GetPathOutcome
from mbf_ros.ros2.interfaces.definitions import JAZZY, KILTED, PACKAGES, PARTS, interface_files, used_packages

HASHES = dict(
    line.split()
    for line in (Path(__file__).parents[1] / "ros" / "type_hashes.txt").read_text().splitlines()
    if not line.startswith("#")
)

READ = ("map_msgs/", "mesh_msgs/")  # of these no compiled package was at hand, only the text of the interface files


def parts():
    """Name and text of each part of each file; a part without fields is left out."""
    for package in PACKAGES:
        for path, text in interface_files(package).items():
            kind, _, name = path.partition(".")[0].partition("/")
            for part, lines in zip(PARTS[kind], text.split("---\n"), strict=True):
                if lines:
                    yield f"{package}/{kind}/{name}{part}", lines


@pytest.fixture(scope="module")
def store():
    store = get_typestore(Stores.ROS2_KILTED)
    for name, text in parts():
        (store.fielddefs[name],) = get_types_from_msg(text, name).values()
    return store


@pytest.mark.parametrize("name", [name for name, _ in parts() if not name.startswith(READ)])
def test_a_part_has_the_hash_of_the_released_package(store, name):
    assert store.hash_rihs01(name) == HASHES[name]


@pytest.mark.parametrize(
    ("name", "released"),
    [
        (
            "map_msgs/msg/OccupancyGridUpdate",
            "std_msgs/Header header\nint32 x\nint32 y\nuint32 width\nuint32 height\nint8[] data",
        ),
        (
            "mesh_msgs/msg/MeshGeometry",
            "geometry_msgs/Point[] vertices\ngeometry_msgs/Point[] vertex_normals\n"
            "mesh_msgs/MeshTriangleIndices[] faces",
        ),
        (
            "mesh_msgs/msg/MeshGeometryStamped",
            "std_msgs/Header header\nstring uuid\nmesh_msgs/MeshGeometry mesh_geometry",
        ),
        ("mesh_msgs/msg/MeshTriangleIndices", "uint32[3] vertex_indices"),
        ("mesh_msgs/msg/MeshVertexCosts", "float32[] costs"),
        (
            "mesh_msgs/msg/MeshVertexCostsStamped",
            "std_msgs/Header header\nstring uuid\nstring type\nmesh_msgs/MeshVertexCosts mesh_vertex_costs",
        ),
    ],
)
def test_a_part_has_the_fields_of_the_released_interface_file(name, released):
    assert dict(parts())[name] == f"{released}\n"


def test_the_constants_of_a_result_are_our_outcomes():
    lines = interface_files("mbf_msgs")["action/GetPath.action"].splitlines()
    assert [line for line in lines if "=" in line] == [f"uint32 {one.name} = {int(one)}" for one in GetPathOutcome]


def test_the_constants_of_nav2_are_its_error_codes_and_a_default_is_kept():
    lines = interface_files("nav2_msgs")["action/Wait.action"].splitlines()
    assert [line for line in lines if "=" in line] == [
        "uint16 NONE = 0",
        "uint16 UNKNOWN = 740",
        "uint16 TIMEOUT = 741",
    ]
    assert "uint8 max_cost 254" in interface_files("nav2_msgs")["srv/IsPathValid.srv"].splitlines()


def test_nav2_of_jazzy_has_lists_of_poses_and_missed_waypoints_and_the_other_packages_are_the_same():
    kilted, jazzy = (interface_files("nav2_msgs", distribution) for distribution in (KILTED, JAZZY))
    assert kilted.keys() ^ jazzy.keys() == {"msg/WaypointStatus.msg", "msg/MissedWaypoint.msg"}
    assert "geometry_msgs/PoseStamped[] poses" in jazzy["action/NavigateThroughPoses.action"].splitlines()
    assert "nav_msgs/Goals poses" in kilted["action/NavigateThroughPoses.action"].splitlines()
    assert not [path for path, text in jazzy.items() if re.search("WaypointStatus|Goals|disable_collision", text)]
    assert jazzy["action/FollowPath.action"] == kilted["action/FollowPath.action"]
    for package in set(PACKAGES) - {"nav2_msgs"}:
        assert interface_files(package, JAZZY) == interface_files(package)


def test_every_package_that_is_needed_is_named():
    assert used_packages("tf2_msgs") == ("builtin_interfaces", "geometry_msgs", "std_msgs")
    assert {"action_msgs", "geometry_msgs", "nav_msgs", "service_msgs"} <= set(used_packages("mbf_msgs"))
