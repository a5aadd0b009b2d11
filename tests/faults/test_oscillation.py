"""Fault table, row 34: a robot that moves without getting anywhere."""

from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.goals.goal_types import ExePathGoal, MoveBaseGoal
from mbf_abstract.outcomes import ExePathOutcome, MoveBaseOutcome
from mbf_abstract.plugins import ControlResult
from mbf_abstract.testing.scripted_session import ScriptedSession
from promises import assert_ended_once, assert_next_goals_work, assert_stops


def to_and_fro(request):
    """Drive half a second forward, half a second back."""
    forward = int(request.pose.stamp / 0.5) % 2 == 0
    return ControlResult(0, "driving", Twist.planar(0.2 if forward else -0.2))


def test_exe_path_ends_with_oscillation_and_names_distance_and_time():
    with ScriptedSession(oscillation_timeout=4.0, oscillation_distance=0.4) as session:
        session.controller.play(to_and_fro)
        handle = session.navigator.send(ExePathGoal(session.path_to(50.0)))
        result = handle.wait()
        fault_time = session.clock.now()
        assert len({round(command.vx, 3) for _, command in session.robot.commands} & {0.2, -0.2}) == 2
        assert result.outcome == ExePathOutcome.OSCILLATION
        assert "0.4 m" in result.message
        assert "4 s" in result.message
        session.clock.sleep(2.0)
        assert_stops(session, fault_time)
        assert_ended_once(session, handle)
        assert_next_goals_work(session)


def test_move_base_recovers_and_then_gives_up():
    with ScriptedSession(oscillation_timeout=3.0) as session:
        session.controller.play(to_and_fro)
        handle = session.navigator.send(MoveBaseGoal(Pose.planar(50.0, 0.0)))
        result = handle.wait(60.0)
        assert len(session.recovery.requests) == 1
        assert result.outcome == MoveBaseOutcome.OSCILLATION
        assert session.robot.command.is_stopped()
        assert_ended_once(session, handle)


def test_a_robot_that_gets_on_does_not_oscillate():
    with ScriptedSession(oscillation_timeout=1.5, oscillation_distance=0.5) as session:
        assert session.navigator.exe_path(session.path_to(5.0)).success
