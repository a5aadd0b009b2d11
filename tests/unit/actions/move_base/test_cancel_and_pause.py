"""move_base: cancel and pause in every state."""

import pytest

from mbf_abstract.geometry import Twist
from mbf_abstract.goals.goal_status import GoalStatus
from mbf_abstract.outcomes import GetPathOutcome, RecoveryOutcome
from mbf_abstract.outcomes import MoveBaseOutcome as Outcome
from mbf_abstract.plugins import PlanResult, RecoveryResult
from mbf_abstract.testing.faulty import obedient
from mbf_abstract.testing.scripted import ScriptedRecovery, straight_plan


def _planning(session):
    canceled = PlanResult(GetPathOutcome.CANCELED, "as ordered")
    session.planner.play(obedient(session.clock, 4.0, straight_plan, canceled))


def _following(session):
    pass


def _recovering(session):
    session.planner.play(session.no_path)
    session.plugin("first", ScriptedRecovery).play(
        lambda request: RecoveryResult(0 if request.motion.sleep(9.0) else RecoveryOutcome.CANCELED, "")
    )


@pytest.mark.parametrize("begin", [_planning, _following, _recovering])
def test_a_cancel_ends_the_goal_and_its_parts_in_every_state(make_session, begin):
    session = make_session(retries=0)
    begin(session)
    handle = session.send(5.0)
    session.clock.sleep(1.0)
    handle.cancel("enough")
    result = handle.wait()
    assert (handle.status, result.outcome, result.message) == (GoalStatus.CANCELED, Outcome.CANCELED, "enough")
    assert session.clock.now() < 1.1
    assert session.robot.command == Twist()
    server = session.server
    session.clock.sleep(0.1)
    assert not any(action.busy for action in (server.get_path, server.exe_path, server.recovery, server.move_base))


def test_a_cancel_in_the_instant_the_plan_is_there_is_not_lost(make_session):
    session = make_session()
    handle = session.send(5.0)

    def plan_and_cancel(request):
        handle.cancel()
        return straight_plan(request)

    session.planner.play(plan_and_cancel)
    assert handle.wait().outcome == Outcome.CANCELED
    session.clock.sleep(1.0)
    assert not session.robot.moved_after(-1.0)


@pytest.mark.parametrize("begin", [_planning, _following, _recovering])
def test_a_pause_holds_the_robot_in_every_state_and_the_goal_goes_on_after_it(make_session, begin):
    session = make_session(retries=0, oscillation_timeout=5.0)
    begin(session)
    handle = session.send(2.0)
    session.clock.sleep(1.0)
    handle.pause()
    session.clock.sleep(0.1)
    where = session.robot.pose.x
    session.clock.sleep(30.0)
    assert handle.status is GoalStatus.PAUSED
    assert session.robot.pose.x == where
    session.planner.play(straight_plan)
    handle.resume()
    assert handle.wait().success
