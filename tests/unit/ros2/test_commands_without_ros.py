"""Without ROS the commands say what is missing, in one text."""

import importlib.util

import pytest
from typer.testing import CliRunner

from mbf_abstract.cli import make_app

CONFIG = """
backend: costmap
global_costmap: {width: 4.0, height: 4.0, layers: [{name: area, type: keepout}], area: {zones: []}}
local_costmap: {width: 4.0, height: 4.0, layers: [{name: area, type: keepout}], area: {zones: []}}
planners: [{name: shortest, type: dijkstra}]
"""


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["ros2", "FILE"], "rclpy cannot be imported"),
        (["ros2", "FILE", "--sensor", "scan"], "--sensor must be TOPIC:TYPE=SOURCE"),
        (["ros2-interfaces", "--into", "FOLDER"], "the generators of ROS 2 are not installed"),
    ],
)
def test_what_is_missing_is_said_in_one_text(tmp_path, arguments, text):
    assert importlib.util.find_spec("rclpy") is None  # it would change the library paths of this very Python
    file = tmp_path / "robot.yaml"
    file.write_text(CONFIG)
    places = {"FILE": str(file), "FOLDER": str(tmp_path)}
    result = CliRunner().invoke(make_app(), [places.get(one, one) for one in arguments])
    assert result.exit_code == 2
    assert text in result.output and "Traceback" not in result.output
