"""Numbers that no robot has are notes of both maps' servers, and of robots: mostly another unit was meant."""

import json
import re

import numpy as np
import pytest
from PIL import Image

from command_line import mbf
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh

CONFIGURATIONS = {
    "costmap": ("costmap_differential", "room.yaml", "pursuit: {acc_lim_theta: 90.0, rotate_to_heading_vel: 18.0}"),
    "mesh": ("mesh_differential", "ground.obj", "follower: {acc_lim_theta: 90.0, acc_lim_x: 500.0}"),
}
EXPECTED = {
    "costmap": [
        "max_vel_theta 45 rad/s is more than robots have (6.28 rad/s): radians are meant, not degrees",
        "controller 'pursuit': rotate_to_heading_vel 18 rad/s is more",
        "controller 'pursuit': acc_lim_theta 90 rad/s^2 is more",
        "global_costmap: layer 'inflation': inflation_radius 24 m is more than robots have (20 m): metres are meant",
    ],
    "mesh": [
        "max_vel_theta 45 rad/s is more than robots have (6.28 rad/s): radians are meant, not degrees",
        "controller 'follower': acc_lim_x 500 m/s^2 is more than robots have (20 m/s^2): metres are meant",
        "controller 'follower': acc_lim_theta 90 rad/s^2 is more",
        "mesh_map: layer 'inflation': inflation_radius 24 m is more",
    ],
}


@pytest.fixture
def configuration(tmp_path):
    """``configuration(backend)`` writes a starter of a backend with its map."""
    Image.fromarray(np.full((80, 80), 254, np.uint8)).save(tmp_path / "room.png")
    (tmp_path / "room.yaml").write_text("image: room.png\nresolution: 0.1\norigin: [0.0, 0.0, 0.0]\n")
    vertices, faces = heightfield_mesh(np.zeros((41, 41)), 0.1, 0.1)[:2]
    lines = [f"v {x:g} {y:g} {z:g}\n" for x, y, z in vertices] + [f"f {a} {b} {c}\n" for a, b, c in faces + 1]
    (tmp_path / "ground.obj").write_text("".join(lines))

    def write(backend):
        starter, map_file, _ = CONFIGURATIONS[backend]
        file = tmp_path / f"{backend}.yaml"
        assert mbf("config", starter, "--map", tmp_path / map_file, "--out", file).exit_code == 0
        return file

    return write


def notes(output):
    return [line for line in output.splitlines() if "more than robots have" in line]


@pytest.mark.parametrize("backend", CONFIGURATIONS)
def test_degrees_and_millimetres_are_noted_and_the_starters_numbers_are_not(configuration, backend):
    file = configuration(backend)
    assert notes(mbf("check", file).output) == []
    text = re.sub("max_vel_theta: [0-9.]+", "max_vel_theta: 45", file.read_text())
    text = text.replace("inflation_radius: 0.5", "inflation_radius: 24.0", 1)
    file.write_text(f"{text}\n{CONFIGURATIONS[backend][2]}\n")

    checked = mbf("check", file)

    assert checked.exit_code == 0, checked.output
    found = notes(checked.output)
    assert len(found) == len(EXPECTED[backend])
    for expected in EXPECTED[backend]:
        assert any(line.startswith(f"note: {expected}") for line in found), (expected, found)


def test_a_robot_that_is_stated_in_degrees_is_noted():
    shown = mbf("robot", "show", "package://pybullet_data/husky/husky.urdf", "--json", "--set", "max_yaw_rate=45")
    expected = "max_yaw_rate 45 rad/s is more than robots have (6.28 rad/s): radians are meant, not degrees"
    assert expected in json.loads(shown.output)["notes"]
