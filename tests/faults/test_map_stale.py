"""Fault table, row 13, the core's half: the map is stale and must not be driven on."""

from mbf_abstract.goals.goal_types import ExePathGoal
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.testing.scripted_session import ScriptedSession
from promises import assert_next_goals_work, assert_stops


def test_the_robot_holds_and_the_goal_ends_with_map_error_after_patience():
    with ScriptedSession(controller_patience=1.0) as session:
        handle = session.navigator.send(ExePathGoal(session.path_to(50.0)))
        session.clock.sleep(1.0)
        session.server.map_trouble = "the lidar has been silent for 1.0 s"
        asked = len(session.controller.requests)
        result = handle.wait()
        assert len(session.controller.requests) <= asked + 1
        assert (result.outcome, result.message) == (ExePathOutcome.MAP_ERROR, "the lidar has been silent for 1.0 s")
        assert_stops(session, 1.0)
        session.server.map_trouble = ""
        assert_next_goals_work(session)


def test_the_robot_drives_on_when_the_map_is_current_again():
    with ScriptedSession(controller_patience=2.0) as session:
        handle = session.navigator.send(ExePathGoal(session.path_to(2.0)))
        session.clock.sleep(1.0)
        session.server.map_trouble = "silent"
        session.clock.sleep(1.0)
        assert session.robot.command.is_stopped()
        session.server.map_trouble = ""
        assert handle.wait().success
