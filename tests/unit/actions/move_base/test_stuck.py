"""move_base: what happens where the same failure comes again and again at one place."""

import pytest

from mbf_abstract.events import EventKind
from mbf_abstract.goals.goal_status import GoalStatus
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome, RecoveryOutcome
from mbf_abstract.outcomes import MoveBaseOutcome as Outcome
from mbf_abstract.plugins import ControlResult, RecoveryResult
from mbf_abstract.testing.faulty import drive
from mbf_abstract.testing.scripted import ScriptedRecovery, straight_plan

BLOCKED = ControlResult(ExePathOutcome.BLOCKED_PATH, "a chair")


def test_behaviours_of_the_escalation_are_not_among_those_run_by_default(make_session):
    session = make_session(retries=0, stuck_time=0.0, escalation_behaviors=("second",), stuck_failures=0)
    session.planner.play(session.no_path)
    session.send().wait()
    assert session.recoveries == ["first", "third", "second"]  # after the list, as nothing else is left


def test_a_robot_that_is_stuck_gets_the_escalation_instead_of_the_list(make_session):
    session = make_session(retries=0, stuck_time=0.0, escalation_behaviors=("third", "second"))
    session.controller.play(BLOCKED)
    result = session.send(recovery_behaviors=("first",) * 9).wait()
    assert session.recoveries == ["first", "first", "third", "second"]
    assert result.outcome == ExePathOutcome.BLOCKED_PATH
    assert result.message == "a chair; stuck at (0.00, 0.00): BLOCKED_PATH 5 times; tried first, third, second"
    assert [event.data["failures"] for event in session.recorded(EventKind.STUCK)] == [3]


def test_an_escalation_that_helps_lets_the_goal_succeed(make_session):
    session = make_session(retries=0, stuck_time=0.0, escalation_behaviors=("third",))
    session.controller.play(BLOCKED, BLOCKED, BLOCKED, session.controller.follow)
    assert session.send().wait().success
    assert session.recoveries == ["first", "second", "third"]


def test_a_list_that_motion_resets_for_ever_ends_at_the_place_it_comes_back_to(make_session):
    """Without the escalation this goes on for ever: the way to the place resets the list each time."""
    session = make_session(
        retries=0, stuck_time=0.0, oscillation_distance=0.1, escalation_behaviors=("third",), stuck_distance=0.3
    )
    forth, back = [drive(0.5)] * 10, [drive(-0.5)] * 10
    session.controller.play(*([BLOCKED, *forth, *back] * 40))
    result = session.send(4.0, recovery_behaviors=("first", "second")).wait()
    assert result.outcome == ExePathOutcome.BLOCKED_PATH
    assert "tried first, third" in result.message


def test_a_plan_that_is_found_each_time_and_refused_each_time_is_no_progress(make_session):
    session = make_session(retries=0, stuck_time=0.0, escalation_behaviors=("third",))
    session.controller.play(BLOCKED)
    session.planner.play(*[session.no_path, straight_plan] * 20)
    result = session.send(recovery_behaviors=("first", "second", "first", "second", "first")).wait()
    assert not result.success and "3 times" in result.message
    assert session.recoveries.count("third") == 1


def test_a_failed_behaviour_of_the_escalation_is_named_with_its_outcome(make_session):
    session = make_session(retries=0, stuck_time=0.0, escalation_behaviors=("third",))
    session.plugin("third", ScriptedRecovery).play(RecoveryResult(RecoveryOutcome.IMPASSABLE, "a wall"))
    session.planner.play(session.no_path)
    result = session.send(recovery_behaviors=()).wait()
    assert result.outcome == GetPathOutcome.NO_PATH_FOUND
    assert session.recoveries == ["third"]
    assert "stuck" not in result.message  # two failures are not three


def test_where_recovery_is_off_nothing_is_escalated(make_session):
    session = make_session(
        retries=0, stuck_time=0.0, recovery_enabled=False, escalation_behaviors=("third",), stuck_failures=1
    )
    session.planner.play(session.no_path)
    session.send().wait()
    assert session.recoveries == []


def test_a_new_goal_has_the_whole_escalation_again(make_session):
    session = make_session(retries=0, stuck_time=0.0, escalation_behaviors=("third",), stuck_failures=1)
    session.controller.play(BLOCKED)
    for _ in range(2):
        session.send(recovery_behaviors=()).wait()
    assert session.recoveries == ["third", "third"]


def test_a_goal_that_takes_over_has_the_whole_escalation_again(make_session):
    session = make_session(retries=0, stuck_time=0.0, escalation_behaviors=("third",), stuck_failures=1)
    newer = []

    def send_another(request):
        if not newer:
            newer.append(session.send(3.0, recovery_behaviors=()))
        return RecoveryResult(RecoveryOutcome.SUCCESS, "recovered")

    session.plugin("third", ScriptedRecovery).play(send_another)
    session.controller.play(BLOCKED)
    first = session.send(recovery_behaviors=())
    assert first.wait().outcome == Outcome.CANCELED
    assert not newer[0].wait().success
    assert session.recoveries == ["third", "third"]


def test_a_cancel_ends_a_behaviour_of_the_escalation(make_session):
    session = make_session(retries=0, stuck_time=0.0, escalation_behaviors=("third",), stuck_failures=1)
    handles = []

    def slow(request):
        handles[0].cancel("enough")
        return RecoveryResult(RecoveryOutcome.SUCCESS if request.motion.sleep(60.0) else RecoveryOutcome.CANCELED)

    session.plugin("third", ScriptedRecovery).play(slow)
    session.planner.play(session.no_path)
    handles.append(session.send(recovery_behaviors=()))
    assert handles[0].wait().outcome == Outcome.CANCELED
    assert handles[0].status is GoalStatus.CANCELED
    assert session.clock.now() < 5.0


@pytest.mark.parametrize("name", ["fourth", "planner"])
def test_a_name_that_is_no_recovery_behaviour_refuses_the_goal(make_session, name):
    session = make_session(escalation_behaviors=(name,))
    handle = session.send()
    assert handle.status is GoalStatus.REJECTED
    assert name in handle.wait().message


def test_the_list_starts_again_with_each_place_that_plans_avoid_from_now_on(make_session):
    """A robot that finds no hold backs up and plans around the place; where it finds none again, it may do so again."""
    stuck = ControlResult(ExePathOutcome.ROBOT_STUCK, "no hold")
    session = make_session(retries=0, oscillation_distance=5.0)

    def one_metre_back(request):
        session.robot._x -= 1.0
        session.clock.sleep(0.1)
        return RecoveryResult(RecoveryOutcome.SUCCESS)

    session.plugin("first", ScriptedRecovery).play(*[one_metre_back] * 5)
    session.controller.play(stuck, stuck, stuck, session.controller.follow)
    assert session.send(recovery_behaviors=("first",)).wait().success
    assert session.recoveries == ["first"] * 3
