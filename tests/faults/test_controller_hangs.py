"""Fault table, row 5: a controller hangs while the robot drives."""

from mbf_abstract.events import EventKind
from mbf_abstract.goals.goal_status import GoalStatus
from mbf_abstract.goals.goal_types import ExePathGoal
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.testing.faulty import BusyHang, Hang, drive
from mbf_abstract.testing.scripted_session import ScriptedSession
from promises import assert_ended_once, assert_next_goals_work, assert_stops


def test_the_watchdog_stops_the_robot_and_the_goal_ends_after_patience_and_grace():
    with ScriptedSession(controller_patience=2.0, cancel_grace=1.0, command_timeout=0.5) as session:
        hang = Hang(session.clock, then=drive(9.0))
        session.controller.play(drive(), drive(), hang)
        handle = session.navigator.send(ExePathGoal(session.path_to(50.0)))
        session.clock.sleep(0.2)
        assert hang.entered == 1
        assert not session.robot.command.is_stopped()
        session.clock.sleep(0.6)
        assert session.robot.command.is_stopped()  # long before the goal ends
        assert not handle.done
        result = handle.wait()
        assert result.outcome == ExePathOutcome.PAT_EXCEEDED
        assert 3.0 < session.clock.now() < 3.3
        assert_ended_once(session, handle)
        assert session.navigator.send(ExePathGoal(session.path_to(1.0))).status is GoalStatus.REJECTED
        hang.release()  # the late command must not reach the robot
        session.clock.sleep(1.0)
        assert hang.left == 1
        assert_stops(session, 0.2)
        assert_next_goals_work(session)


def test_a_controller_that_keeps_the_processor_busy_is_found_by_the_wall_clock_guard():
    with ScriptedSession(hang_guard=0.2) as session:
        hang = BusyHang()
        session.controller.play(drive(), hang)
        handle = session.navigator.send(ExePathGoal(session.path_to(50.0)))
        result = handle.wait()
        fault_time = session.clock.now()
        hang.release.cancel()
        assert (hang.entered, result.outcome) == (1, ExePathOutcome.PAT_EXCEEDED)
        assert len(session.recorded(EventKind.QUARANTINE)) == 1
        session.clock.sleep(2.0)
        assert_stops(session, fault_time)
        assert_ended_once(session, handle)
