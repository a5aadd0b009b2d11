"""Fault table, row 1: a planner raises."""

import pytest

from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_types import GetPathGoal
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.testing.scripted_session import ScriptedSession
from promises import assert_ended_once, assert_next_goals_work


@pytest.mark.parametrize("error", [RuntimeError("boom"), KeyError("x"), ZeroDivisionError(), RecursionError("deep")])
def test_a_raising_planner_ends_the_goal_with_type_message_and_plugin(error):
    with ScriptedSession() as session:
        session.planner.play(error)
        handle = session.navigator.send(GetPathGoal(Pose.planar(3.0, 0.0)))
        result = handle.wait()
        assert len(session.planner.requests) == 1  # the fault happened, and is not retried
        assert result.outcome == GetPathOutcome.INTERNAL_ERROR
        assert "planner" in result.message
        assert type(error).__name__ in result.message
        assert str(error) in result.message
        assert_ended_once(session, handle)
        assert_next_goals_work(session)


def test_the_traceback_is_in_the_event():
    with ScriptedSession() as session:
        session.planner.play(RuntimeError("boom"))
        session.navigator.get_path(Pose.planar(3.0, 0.0))
        (fault,) = session.recorded(EventKind.FAULT)
        assert fault.data["type"] == "RuntimeError"
        assert any("scripted.py" in line for line in fault.data["traceback"])
