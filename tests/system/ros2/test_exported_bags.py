"""The messages of an exported bag are what rclpy takes them for."""

import base64
import json
import subprocess

import pytest

from mbf_ros.bags.export import messages_of
from mbf_ros.bags.reading import open_bag
from mbf_ros.bags.writing import write_bag
from mbf_ros.messages.json_text import json_text
from tests.system.ros2.conftest import PEERS, WITHIN
from tests.system.ros2.environments import clean_variables
from tests.unit.bags.test_export import make_log

pytestmark = [pytest.mark.ros2, pytest.mark.timeout(900, func_only=True)]


def test_rclpy_reads_every_type_of_an_exported_bag_as_we_do(tmp_path, ros_folder):
    write_bag(tmp_path / "bag", messages_of(make_log(1)))
    with open_bag(tmp_path / "bag") as bag:
        last = {one.topic: one for one in bag.messages()}
        ours = [json.loads(json_text(bag.decode(one))) for one in last.values()]
        lines = [f"{bag.types[topic]} {base64.b64encode(one.raw).decode()}" for topic, one in last.items()]
    python = [str(ros_folder / "venv" / "bin" / "python"), str(PEERS / "cdr.py")]
    variables = clean_variables(ros_folder)
    answer = subprocess.run(
        python, input="\n".join(lines), env=variables, capture_output=True, text=True, timeout=WITHIN, check=False
    )
    assert answer.returncode == 0, answer.stderr
    assert [json.loads(line) for line in answer.stdout.splitlines()] == ours
    assert len(ours) == 8 and ours[list(last).index("/cmd_vel")]["linear"]["x"] == 0.0
