"""Fault table, row 11: the localisation falls silent while the robot drives."""

from mbf_abstract.events import EventKind
from mbf_abstract.execution.controller_state import ControllerState
from mbf_abstract.goals.goal_types import ExePathGoal
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome
from mbf_abstract.testing.scripted_session import ScriptedSession
from promises import assert_ended_once, assert_next_goals_work, assert_stops


def test_the_robot_holds_and_the_goal_ends_with_the_age_after_patience():
    with ScriptedSession(tf_timeout=0.5, controller_patience=2.0) as session:
        handle = session.navigator.send(ExePathGoal(session.path_to(50.0)))
        session.clock.sleep(1.0)
        session.robot.publishes_pose = False
        silent_since = session.clock.now()
        result = handle.wait()
        assert result.outcome == ExePathOutcome.TF_ERROR
        assert "s old, limit 0.500 s" in result.message
        assert "odom->base_link" in result.message
        assert not session.robot.moved_after(silent_since + 0.6)  # P6: no command on an old pose
        assert_stops(session, silent_since + 0.5)
        assert_ended_once(session, handle)
        assert session.navigator.get_path(session.path_to(1.0)[-1]).outcome == GetPathOutcome.TF_ERROR
        session.robot.publishes_pose = True
        session.clock.sleep(0.1)
        assert_next_goals_work(session)


def test_the_robot_drives_on_if_the_pose_comes_back_within_patience():
    with ScriptedSession(tf_timeout=0.5, controller_patience=3.0) as session:
        handle = session.navigator.send(ExePathGoal(session.path_to(3.0)))
        session.clock.sleep(1.0)
        session.robot.publishes_pose = False
        session.clock.sleep(2.0)
        assert session.robot.command.is_stopped()
        assert not handle.done
        session.robot.publishes_pose = True
        assert handle.wait().success
        states = [event.data["new"] for event in session.recorded(EventKind.STATE_CHANGED)]
        assert ControllerState.HOLDING.value in states
