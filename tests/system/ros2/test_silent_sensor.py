"""A sensor that a layer takes is awaited: when it falls silent, the robot is stopped."""

import pytest

from tests.system.ros2.conftest import ROBOT

pytestmark = [pytest.mark.ros2, pytest.mark.timeout(900)]

CONFIG = ROBOT.replace("type: keepout}]", "type: keepout}, {name: seen, type: obstacle}]").replace(
    "area: {zones: []}", "area: {zones: []}, seen: {sources: {scan: {}}}"
)


def test_a_robot_whose_scans_fail_to_come_is_stopped_and_goes_on_when_they_come_again(trio):
    goal = trio.drive()
    before = len(trio.robot.lines)
    trio.robot.set("scan", "off")
    trio.robot.wait_for_speed(lambda speed: speed == 0.0, before)
    trio.robot.set("scan", "on")
    trio.robot.wait_for_speed(lambda speed: speed > 0.0, len(trio.robot.lines))
    assert trio.cancel(goal)["status"] == "canceled"
