"""Without ROS the commands say what is missing, in one text."""

import json
import os
import subprocess
import sys
from pathlib import Path

CONFIG = """
backend: costmap
global_costmap: {width: 4.0, height: 4.0, layers: [{name: area, type: keepout}], area: {zones: []}}
local_costmap: {width: 4.0, height: 4.0, layers: [{name: area, type: keepout}], area: {zones: []}}
planners: [{name: shortest, type: dijkstra}]
"""
RUN = """
import json, sys
from typer.testing import CliRunner
from mbf_abstract.cli import make_app
results = [CliRunner().invoke(make_app(), one) for one in json.loads(sys.argv[1])]
print(json.dumps([[one.exit_code, one.output] for one in results]))
"""


def without_ros():
    """Environment variables of a process that finds no ROS, even where one is sourced here."""
    paths = os.environ.get("PYTHONPATH", "").split(os.pathsep)
    kept = [path for path in paths if not any((Path(path) / name).is_dir() for name in ("rclpy", "rosidl_adapter"))]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(kept)}


def test_what_is_missing_is_said_in_one_text(tmp_path):
    file = tmp_path / "robot.yaml"
    file.write_text(CONFIG)
    expected = {
        "rclpy cannot be imported": ["ros2", str(file)],
        "error: rclpy cannot be imported": ["run", "indoor", "--ros2", "--out", str(tmp_path / "run")],
        "--wall-clock does not go with --ros2": ["run", "indoor", "--ros2", "--wall-clock", "--out", str(tmp_path)],
        "--ros2-lockstep": ["run", "indoor", "--ros2-lockstep", "--out", str(tmp_path / "run")],
        "it goes with --ros2 only": ["run", "indoor", "--ros2-patience", "5", "--out", str(tmp_path / "run")],
        "--sensor: expected each topic once, got 'scan' twice": [
            "ros2",
            str(file),
            *2 * ["--sensor", "scan:LaserScan=lidar"],
        ],
        "--sensor: expected TOPIC:TYPE=SOURCE": ["ros2", str(file), "--sensor", "scan"],
        "the generators of ROS 2 are not installed": ["ros2-interfaces", "--into", str(tmp_path)],
        "map_msgs, mbf_msgs, mesh_msgs, nav2_msgs, tf2_msgs, got dance_msgs": ["ros2-interfaces", "dance_msgs"],
    }
    command = [sys.executable, "-c", RUN, json.dumps(list(expected.values()))]
    ran = subprocess.run(command, env=without_ros(), capture_output=True, text=True, check=True)
    for text, (code, output) in zip(expected, json.loads(ran.stdout), strict=True):
        assert code == 2
        assert text in output and "Traceback" not in output
