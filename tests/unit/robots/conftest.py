"""URDFs made by hand, whose numbers can be checked on paper."""

from pathlib import Path

import pytest

from terrain.description.describe import describe
from terrain.description.parameters import UrdfRobot

INERTIA = '<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/>'
CYLINDER = '<origin rpy="1.5707963267948966 0 0"/><geometry><cylinder radius="{r}" length="0.1"/></geometry>'


def link(name, mass=0.0, collision="", at="0 0 0"):
    """A link with a mass at ``at`` and one collision shape."""
    inertial = f'<inertial><origin xyz="{at}"/><mass value="{mass}"/>{INERTIA}</inertial>' if mass else ""
    return f'<link name="{name}">{inertial}{f"<collision>{collision}</collision>" if collision else ""}</link>'


def joint(name, parent, child, at, kind="continuous", axis="0 1 0", inside=""):
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{at}"/><axis xyz="{axis}"/>{inside}</joint>'
    )


def wheel(name, parent, at, radius=0.2, axis="0 1 0", mass=1.0, inside=""):
    """A wheel of width 0.1 m, its link and its joint."""
    return link(f"{name}_link", mass, CYLINDER.format(r=radius)) + joint(
        name, parent, f"{name}_link", at, axis=axis, inside=inside
    )


def robot(*parts, name="hand_made"):
    return f'<robot name="{name}">{"".join(parts)}</robot>'


BODY = link("body", 6.0, '<origin xyz="0 0 0.1"/><geometry><box size="1 0.4 0.2"/></geometry>', "0 0 0.2")
FOUR_WHEELS = [
    wheel(f"{end}_{side}", "body", f"{x} {y} 0")
    for end, x in (("front", 0.3), ("rear", -0.3))
    for side, y in (("left", 0.35), ("right", -0.35))
]
FIXED_AXLE = [wheel(side, "body", f"0 {y} 0") for side, y in (("left", 0.35), ("right", -0.35))]


def steered(name, x, y):
    """A wheel that turns by 0.6 rad each way on an upright joint."""
    limits = '<limit lower="-0.6" upper="0.6" effort="5" velocity="3"/>'
    hinge = joint(f"{name}_steer", "body", f"{name}_hinge", f"{x} {y} 0", "revolute", "0 0 1", limits)
    return [link(f"{name}_hinge", 0.1), hinge, wheel(name, f"{name}_hinge", "0 0 0")]


@pytest.fixture
def write(tmp_path):
    """Write a URDF and return its file."""

    def write(text):
        file = tmp_path / "robot.urdf"
        file.write_text(text)
        return file

    return write


@pytest.fixture
def described(write):
    """Describe a robot of a URDF's text."""
    return lambda text, **stated: describe(UrdfRobot(urdf=str(write(text)), **stated))


def package_file(name: str) -> UrdfRobot:
    """A robot of pybullet_data."""
    return UrdfRobot(urdf=f"package://pybullet_data/{name}")


SHIPPED = Path(__file__).resolve().parents[3] / "terrain" / "urdf"
KIWI = Path(__file__).resolve().parents[3] / "examples" / "robots" / "kiwi.urdf"
