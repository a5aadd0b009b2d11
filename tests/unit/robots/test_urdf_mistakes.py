"""Every mistake in a URDF is one clear finding with its line; all of them at once."""

import numpy as np
import pytest
import trimesh

from mbf_abstract.config.findings import ConfigError
from terrain.description.describe import describe
from terrain.description.parameters import UrdfRobot
from tests.unit.robots.conftest import BODY, FIXED_AXLE, FOUR_WHEELS, joint, link, robot, steered, wheel

BOX = '<geometry><box size="1 1 1"/></geometry>'
MISTAKES = {
    "no joint type": (joint("j", "body", "x", "0 0 0", "hinge") + link("x"), "joint j: type: expected one of"),
    "unknown link": (joint("j", "body", "nowhere", "0 0 0", "fixed"), "expected a link of this file, got 'nowhere'"),
    "two bases": (link("lonely"), "expected one link that is not the child of a joint, got 'body', 'lonely'"),
    "twice": (link("body"), "expected a name of its own, got 'body' twice"),
    "no limit": (joint("j", "body", "x", "0 0 0", "revolute") + link("x"), "joint j: limit: expected an element"),
    "zero axis": (joint("j", "body", "x", "0 0 0", axis="0 0 0") + link("x"), "joint j: axis: expected a direction"),
    "huge": (
        joint("j", "body", "x", "0 2e6 0", "fixed") + link("x", 1.0, BOX),
        "expected 3 finite numbers and not beyond 1e+06, got '0 2e6 0'",
    ),
    "nan": (joint("j", "body", "x", "0 nan 0", "fixed") + link("x", 1.0, BOX), "expected 3 finite numbers"),
    "macro": (
        "<xacro:property name='w' value='0.3'/>" + link("x", 1.0, BOX),
        "expected a URDF without xacro (expand it: xacro FILE > robot.urdf), got <xacro:property>",
    ),
    "xacro": (joint("j", "body", "x", "${a} 0 0", "fixed") + link("x", 1.0, BOX), "got '${a} 0 0'"),
    "negative mass": (
        link("x", -1.0) + joint("j", "body", "x", "0 0 0", "fixed"),
        "link x: mass: expected a number >= 0",
    ),
    "flat cylinder": (
        link("x", 1.0, '<geometry><cylinder radius="0" length="1"/></geometry>')
        + joint("j", "body", "x", "0 0 0", "fixed"),
        "cylinder: radius: expected a finite number above 0, got '0'",
    ),
    "no geometry": (
        link("x", 1.0, "<geometry><cone/></geometry>") + joint("j", "body", "x", "0 0 0", "fixed"),
        "expected one box, cylinder, sphere or mesh, got <cone>",
    ),
    "missing mesh": (
        link("x", 1.0, '<geometry><mesh filename="gone.stl"/></geometry>') + joint("j", "body", "x", "0 0 0", "fixed"),
        "expected a mesh file, got 'gone.stl'",
    ),
    "unknown package": (
        link("x", 1.0, '<geometry><mesh filename="package://no_such_package/a.stl"/></geometry>')
        + joint("j", "body", "x", "0 0 0", "fixed"),
        "no package 'no_such_package' is known",
    ),
    "bracket in a name": (
        link("x", 1.0, '<geometry><mesh filename="package://[x/a.stl"/></geometry>')
        + joint("j", "body", "x", "0 0 0", "fixed"),
        "robot.urdf:1: link x: mesh: expected a mesh file, got 'package://[x/a.stl'",
    ),
    "name too long": (
        link("x", 1.0, f'<geometry><mesh filename="{"a" * 5000}.stl"/></geometry>')
        + joint("j", "body", "x", "0 0 0", "fixed"),
        "robot.urdf:1: link x: mesh: expected a mesh file, got 'aaa",
    ),
    "negative velocity": (
        joint("j", "body", "x", "0 0 0", inside='<limit velocity="-2" effort="1"/>') + link("x"),
        "joint j: velocity: expected a number >= 0, got -2",
    ),
    "negative effort": (
        joint("j", "body", "x", "0 0 0", inside='<limit velocity="2" effort="-1"/>') + link("x"),
        "joint j: effort: expected a number >= 0, got -1",
    ),
    "other way round": (
        joint("j", "body", "x", "0 0 0", "revolute", inside='<limit lower="1" upper="-1"/>') + link("x"),
        "joint j: limit: expected lower <= upper",
    ),
}


def findings_of(write, text):
    with pytest.raises(ConfigError) as caught:
        describe(UrdfRobot(urdf=str(write(text))))
    return [finding.text for finding in caught.value.findings]


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_one_finding(write, mistake):
    parts, expected = MISTAKES[mistake]
    found = findings_of(write, robot(BODY, *FOUR_WHEELS, parts))
    assert len(found) == 1 and expected in found[0], found


def test_all_mistakes_come_at_once_with_their_lines(write):
    wrong = [MISTAKES[name][0] for name in ("no limit", "unknown link", "zero axis")]
    wrong = [text.replace('"j"', f'"j{k}"').replace('"x"', f'"x{k}"') for k, text in enumerate(wrong)]
    found = findings_of(write, robot(BODY, *FOUR_WHEELS, *[f"\n{text}" for text in wrong]))
    assert [text.split(": ")[0].rsplit(":", 1)[1] for text in found] == ["2", "3", "4"]


def test_a_circle_of_joints_is_named(write):
    loop = link("a") + link("b") + joint("ab", "a", "b", "0 0 0", "fixed") + joint("ba", "b", "a", "0 0 0", "fixed")
    found = findings_of(write, robot(BODY, *FOUR_WHEELS, loop))
    assert len(found) == 2 and all("a cycle of joints" in text for text in found)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("<robot", "expected well-formed XML"),
        ("", "expected well-formed XML"),
        ("<sdf/>", "expected the element <robot>, got <sdf>"),
        ('<!DOCTYPE r [<!ENTITY e "eeee">]><robot>&e;</robot>', "expected no entities of its own"),
        ("<robot>" * 100 + "</robot>" * 100, "expected at most 64 levels"),
        ("<robot/>", "expected at least one <link>"),
        (robot(link("body", 1.0)), "expected collision shapes"),
        (robot(link("body", 1.0, BOX)), "drive: expected wheels"),
    ],
)
def test_files_that_are_no_robots_are_refused(write, text, expected):
    (found,) = findings_of(write, text)
    assert expected in found


def test_a_folder_and_a_missing_file_are_refused(tmp_path):
    for name in (tmp_path, tmp_path / "none.urdf"):
        with pytest.raises(ConfigError, match="urdf: expected a file"):
            describe(UrdfRobot(urdf=str(name)))


def test_a_robot_without_masses_needs_them_stated(described):
    weightless = robot(BODY, *FOUR_WHEELS).replace('<mass value="6.0"/>', '<mass value="0"/>').replace('"1.0"', '"0"')
    with pytest.raises(ConfigError, match="mass: expected masses in the links"):
        described(weightless)
    with pytest.raises(ConfigError, match="center_of_mass: expected"):
        described(weightless, mass=10.0)
    assert described(weightless, mass=10.0, center_of_mass=(0.0, 0.0, 0.2)).mass == 10.0


def test_a_named_wheel_that_is_none_is_refused_with_those_that_are(described):
    with pytest.raises(ConfigError, match=r"a joint that turns a wheel \(front_left.*got 'front_lefd'"):
        described(robot(BODY, *FOUR_WHEELS), wheels=("front_lefd",))


def test_a_car_needs_steered_wheels(described):
    with pytest.raises(ConfigError, match="one steered wheel, or two beside each other, for a car, got none"):
        described(robot(BODY, *FOUR_WHEELS), drive="ackermann")


def test_wheels_steered_one_behind_the_other_make_no_car(described):
    ends = [part for name, x in (("front", 0.5), ("rear", -0.5)) for part in steered(name, x, 0.0)]
    with pytest.raises(ConfigError, match=r"got front_steer at x = 0\.50 m, rear_steer at x = -0\.50 m"):
        described(robot(BODY, *FIXED_AXLE, *ends))


def test_a_file_in_millimetres_is_told_that_a_urdf_is_in_metres(described):
    shape = '<origin xyz="0 0 -150"/><geometry><box size="1000 400 20"/></geometry>'
    wheels = [wheel(side, "body", f"0 {y} 0", radius=200) for side, y in (("left", 350), ("right", -350))]
    notes = described(robot(link("body", 6.0, shape, "0 0 200"), *wheels)).notes
    assert "its footprint is 1000 m long; a URDF is in metres, and this looks like millimetres" in notes
    assert not any("millimetres" in note for note in described(robot(BODY, *FOUR_WHEELS)).notes)


def test_an_origin_that_cannot_be_read_is_a_note_where_nothing_solid_hangs_on_it(described):
    text = robot(BODY, *FOUR_WHEELS, joint("j", "body", "imu", "$(optenv X) 0 0", "fixed"), link("imu"))
    assert any("j: its origin cannot be read" in note for note in described(text).notes)


def test_moments_that_no_body_has_are_a_note(described):
    flat = robot(BODY, *FOUR_WHEELS).replace('ixx="0.1" iyy="0.1" izz="0.1"', 'ixx="0.1" iyy="0.1" izz="0.3"', 1)
    assert any("moments of inertia that no body has" in note for note in described(flat).notes)
    assert not any("moments of inertia" in note for note in described(robot(BODY, *FOUR_WHEELS)).notes)


def test_a_mesh_counts_by_its_hull_and_its_scale(described, tmp_path):
    corners = trimesh.creation.box((1000.0, 400.0, 200.0))
    corners.export(tmp_path / "body.stl")
    mesh = '<origin xyz="0 0 0.1"/><geometry><mesh filename="body.stl" scale="0.001 0.001 0.001"/></geometry>'
    box = described(robot(BODY, *FOUR_WHEELS))
    found = described(robot(link("body", 6.0, mesh, "0 0 0.2"), *FOUR_WHEELS))
    assert np.allclose(found.footprint, box.footprint, atol=1e-6)
    assert (found.height, found.ground_clearance) == (box.height, box.ground_clearance)


def test_a_package_is_found_above_the_file_and_by_the_environment(tmp_path, monkeypatch):
    package = tmp_path / "src" / "my_robot"
    (package / "meshes").mkdir(parents=True)
    (package / "urdf").mkdir()
    trimesh.creation.box((1.0, 0.4, 0.2)).export(package / "meshes" / "body.stl")
    shape = '<geometry><mesh filename="package://my_robot/meshes/body.stl"/></geometry>'
    text = robot(link("body", 6.0, shape, "0 0 0.2"), *FOUR_WHEELS)
    (package / "urdf" / "robot.urdf").write_text(text)
    (tmp_path / "elsewhere.urdf").write_text(text)
    assert describe(UrdfRobot(urdf=str(package / "urdf" / "robot.urdf"))).drive == "skid"
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path / "src"))
    assert describe(UrdfRobot(urdf=str(tmp_path / "elsewhere.urdf"))).drive == "skid"
    assert describe(UrdfRobot(urdf="package://my_robot/urdf/robot.urdf")).drive == "skid"


def test_a_damaged_mesh_is_one_finding(write, tmp_path):
    (tmp_path / "body.stl").write_bytes(b"solid nothing")
    shape = '<geometry><mesh filename="body.stl"/></geometry>'
    found = findings_of(write, robot(link("body", 6.0, shape), *FOUR_WHEELS))
    assert len(found) == 1 and "body.stl" in found[0]
