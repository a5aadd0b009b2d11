"""Old plugins behind the new actions: nav_core classes named in a configuration, driven through a costmap server."""

import sys
from pathlib import Path

import pytest

from mbf_abstract.config.findings import ConfigError
from mbf_abstract.geometry import Path as RobotPath
from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.goals.goal_types import MoveBaseGoal
from mbf_abstract.navigator import Navigator
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome
from mbf_abstract.testing.loopback import LoopbackRobot
from mbf_abstract.time.sim_clock import SimClock

CONFIG = """
backend: costmap
planner_max_retries: 0
controller_max_retries: 0
planners: [{name: planner, type: "old_plugins:OldPlanner"}]
controllers: [{name: controller, type: "old_plugins:OldController"}]
recovery_behaviors: [{name: recovery, type: "old_plugins:OldRecovery"}]
global_costmap: {width: 20.0, height: 20.0, origin_x: -10.0, origin_y: -10.0}
local_costmap: {rolling_window: true, width: 4.0, height: 4.0}
"""


@pytest.fixture
def navigator(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "path", [str(Path(__file__).parent), *sys.path])
    file = tmp_path / "old.yaml"
    file.write_text(CONFIG)
    clock, transforms = SimClock(), TransformBuffer()
    robot = LoopbackRobot(clock, transforms, Pose.planar(0.0, 0.0))
    with Navigator.from_file(file, robot, clock, transforms) as made:
        clock.sleep(0.5)
        yield made
    robot.close()


def test_an_old_planner_answers_through_get_path(navigator):
    found = navigator.get_path(Pose.planar(2.0, 0.0))
    assert (found.outcome, found.message, len(found.path)) == (GetPathOutcome.SUCCESS, "Plan found", 2)
    failed = navigator.get_path(Pose.planar(-2.0, 0.0))
    assert (failed.outcome, failed.message) == (GetPathOutcome.FAILURE, "Planner failed")


def test_an_old_planner_is_asked_once_for_each_leg_between_via_poses(navigator):
    via = (Pose.planar(1.0, 1.0), Pose.planar(2.0, 1.0))
    found = navigator.get_path(Pose.planar(3.0, 0.0), via=via)
    assert found.path.positions[:, :2].tolist() == [[0.0, 0.0], [1.0, 1.0], [2.0, 1.0], [3.0, 0.0]]


def test_an_old_controller_drives_a_plan_to_its_end(navigator):
    path = navigator.get_path(Pose.planar(1.5, 0.0)).path
    driven = navigator.exe_path(path)
    assert driven.success
    assert driven.final_pose.x == pytest.approx(1.5, abs=0.1)


def test_an_old_controller_without_a_command_has_failed(navigator):
    goal = Pose.planar(200.0, 0.0)
    planned = navigator.get_path(goal)
    assert planned.outcome == GetPathOutcome.INTERNAL_ERROR and "is outside the map" in planned.message
    driven = navigator.exe_path(RobotPath.from_poses([Pose.planar(0.0, 0.0), goal]))
    assert (driven.outcome, driven.message) == (ExePathOutcome.FAILURE, "Controller failed")


def test_an_old_recovery_always_succeeds(navigator):
    assert navigator.recover().success


def test_a_bare_pose_runs_move_base_and_the_newest_counts(navigator):
    first, second = (navigator.send(MoveBaseGoal(Pose.planar(x, 0.0))) for x in (5.0, 1.0))
    assert second.wait(60.0).success
    assert first.status.value == "canceled"
    third = navigator.send(MoveBaseGoal(Pose.planar(9.0, 0.0)))
    third.cancel()
    assert third.wait(10.0).outcome_name == "CANCELED"


def test_a_class_that_is_neither_is_refused(tmp_path):
    file = tmp_path / "wrong.yaml"
    file.write_text(CONFIG.replace("old_plugins:OldPlanner", "pathlib:Path"))
    with pytest.raises(ConfigError, match="is no AbstractPlanner"):
        Navigator.from_file(file, object(), SimClock())
