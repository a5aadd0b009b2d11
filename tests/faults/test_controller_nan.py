"""Fault table, row 6: a controller computes NaN, or claims success without a command."""

import pytest

from mbf_abstract.geometry import Twist
from mbf_abstract.goals.goal_types import ExePathGoal
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.plugins import ControlResult
from mbf_abstract.testing.faulty import drive, nan_command, no_command
from mbf_abstract.testing.scripted_session import ScriptedSession
from promises import assert_ended_once, assert_next_goals_work, assert_stops

INFINITE = [lambda request: ControlResult(0, "go", Twist.planar(wz=float("inf")))]


@pytest.mark.parametrize("bad", [nan_command, no_command, *INFINITE])
def test_it_counts_as_no_valid_command_and_the_robot_stands(bad):
    with ScriptedSession(controller_max_retries=0) as session:
        session.controller.play(drive(), bad)
        handle = session.navigator.send(ExePathGoal(session.path_to(50.0)))
        result = handle.wait()
        assert len(session.controller.requests) == 2
        assert result.outcome == ExePathOutcome.NO_VALID_CMD
        assert session.robot.command.is_stopped()
        assert_ended_once(session, handle)
        assert_next_goals_work(session)


def test_retries_and_patience_apply_and_the_robot_stands_meanwhile():
    with ScriptedSession(controller_max_retries=-1, controller_patience=1.0) as session:
        session.controller.play(drive(), nan_command)
        result = session.navigator.exe_path(session.path_to(50.0))
        assert len(session.controller.requests) > 15
        assert result.outcome == ExePathOutcome.PAT_EXCEEDED
        assert "must be finite, got nan" in result.message
        assert_stops(session, 0.05)


def test_one_bad_cycle_is_forgiven():
    with ScriptedSession() as session:
        session.controller.play(drive(0.1), nan_command, session.controller.follow)
        assert session.navigator.exe_path(session.path_to(2.0)).success
