"""What Nav2's feedback says beyond ours: recoveries of move_base, and what a behaviour has done."""

import math

import pytest

from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.goals.goal_types import RecoveryGoal
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.plugins import ControlResult
from mbf_abstract.testing.scripted_session import ScriptedSession
from mbf_ros.ros2.nav2 import Progress, RecoveryCount


@pytest.fixture
def session():
    with ScriptedSession(controller_max_retries=0, tf_timeout=100.0) as session:
        yield session


def test_recoveries_of_move_base_are_counted_and_those_of_clients_are_not(session):
    count = RecoveryCount(session.server)
    session.navigator.recover("recovery")
    assert count.ended == 0
    session.controller.play(ControlResult(ExePathOutcome.NO_VALID_CMD, "blocked"), session.controller.follow)
    assert session.navigator.go_to(Pose.planar(1.0, 0.0)).success
    assert count.ended == 1


def drive(session, command, seconds):
    """Let the robot follow a command, looked at as often as feedback is published."""
    progress = Progress(session.server, RecoveryGoal(parameters={"duration": 1.0}))
    for _ in range(round(seconds / 0.1)):
        session.robot.send_command(command)
        session.clock.sleep(0.1)
        fields = progress.look()
    session.robot.send_command(Twist())
    return fields


def test_a_turn_is_summed_up_beyond_half_a_revolution(session):
    fields = drive(session, Twist.planar(wz=-1.0), 5.0)
    assert fields["angular_distance_traveled"] == pytest.approx(-5.0, abs=0.2)
    assert fields["distance_traveled"] == pytest.approx(0.0, abs=0.01)


def test_a_distance_is_that_from_the_start_and_time_runs_out(session):
    fields = drive(session, Twist.planar(vx=-0.5), 2.0)
    assert fields["distance_traveled"] == pytest.approx(1.0, abs=0.1)
    assert fields["time_left"] == {"sec": 0, "nanosec": 0}


def test_a_lost_robot_is_where_it_was_seen_last():
    with ScriptedSession(tf_timeout=0.5) as session:
        progress = Progress(session.server, RecoveryGoal(parameters={"duration": 60.0}))
        session.clock.sleep(1.0)
        session.server.runtime.robot.max_pose_age = -math.inf
        fields = progress.look()
        assert (fields["distance_traveled"], fields["angular_distance_traveled"]) == (0.0, 0.0)
        assert 58 <= fields["time_left"]["sec"] <= 59
