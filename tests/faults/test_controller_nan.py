"""Fault table, row 6: a controller computes NaN, or claims success without a command."""

import pytest

from mbf_abstract.geometry import Twist
from mbf_abstract.goals.goal_types import ExePathGoal
from mbf_abstract.outcomes import ExePathOutcome, RecoveryOutcome
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


class Faster(Twist):
    """A type of the user's own: its numbers may change with each access."""


def overwritten(request):
    command = Twist.planar(0.5)
    object.__setattr__(command, "linear", (float("nan"), 0.0, 0.0))
    return ControlResult(0, "go", command)


@pytest.mark.parametrize(
    ("command", "name"), [((0.5, 0.0), "tuple"), ("forward", "str"), (Faster.planar(0.5), "Faster"), (0.5, "float")]
)
def test_what_is_no_command_ends_at_once_and_is_named(command, name):
    with ScriptedSession(controller_max_retries=-1, controller_patience=5.0) as session:
        session.controller.play(drive(), lambda request: ControlResult(0, "go", command))
        handle = session.navigator.send(ExePathGoal(session.path_to(50.0)))
        result = handle.wait()
        assert result.outcome == ExePathOutcome.INTERNAL_ERROR
        text = f"plugin 'controller' returned a command of type {name}, not Twist or AckermannCommand"
        assert text in result.message and len(session.controller.requests) == 2
        assert session.robot.command.is_stopped()
        assert_ended_once(session, handle)
        assert_next_goals_work(session)


def test_a_command_that_was_overwritten_is_not_finite_and_the_plugin_is_named():
    with ScriptedSession(controller_max_retries=0) as session:
        session.controller.play(drive(), overwritten)
        result = session.navigator.exe_path(session.path_to(50.0))
        assert result.outcome == ExePathOutcome.NO_VALID_CMD
        assert "plugin 'controller': a command must be finite, got Twist(linear=(nan" in result.message


def test_a_recovery_that_sends_what_is_no_command_ends_with_the_type():
    with ScriptedSession() as session:
        session.recovery.play(lambda request: request.motion.send((0.1, 0.0)))
        result = session.navigator.recover("recovery")
        assert result.outcome == RecoveryOutcome.INTERNAL_ERROR
        assert "'recovery' raised TypeError in run_behavior" in result.message and "got tuple" in result.message
        assert session.robot.command.is_stopped()
