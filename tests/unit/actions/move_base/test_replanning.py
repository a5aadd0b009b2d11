"""move_base: plans made anew while the robot drives, and what happens where they fail."""

from dataclasses import replace

import pytest

from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import PlanResult
from mbf_abstract.testing.faulty import drive, obedient, slow
from mbf_abstract.testing.scripted import straight_plan


def _fails_after_the_first_plan(session):
    session.planner.play(straight_plan, session.no_path)
    return session.send(3.0)


def test_replanning_swaps_the_path_without_stopping(make_session):
    session = make_session(planner_frequency=2.0)
    assert session.send(3.0).wait().success
    assert session.plans > 8
    begin, end = session.robot.commands[0][0], session.clock.now() - 1.5
    assert not [1 for stamp, command in session.robot.commands if begin < stamp < end and command.is_stopped()]
    assert len(session.recorded(EventKind.LEASE_GRANTED)) == 1


def test_without_a_frequency_nothing_is_planned_anew(make_session):
    session = make_session(planner_frequency=0.0)
    session.send().wait()
    assert session.plans == 1


def test_policy_keep_drives_on_with_the_old_path(make_session):
    session = make_session(retries=0, planner_frequency=2.0, replan_failed_policy="keep")
    assert _fails_after_the_first_plan(session).wait().success
    assert session.plans > 5


def test_policy_stop_ends_the_goal_standing(make_session):
    session = make_session(retries=0, planner_frequency=2.0, replan_failed_policy="stop")
    result = _fails_after_the_first_plan(session).wait()
    assert (result.outcome, result.message) == (GetPathOutcome.NO_PATH_FOUND, "replanning failed: walled in")
    assert session.robot.command == Twist()
    assert session.recoveries == []


def test_policy_recover_stops_recovers_and_plans_anew(make_session):
    session = make_session(retries=0, planner_frequency=2.0, replan_failed_policy="recover")
    session.planner.play(straight_plan, session.no_path, straight_plan)
    assert session.send(3.0).wait().success
    assert session.recoveries == ["first"]


def test_a_replanning_under_way_at_the_goal_is_canceled(make_session):
    session = make_session(planner_frequency=1.0)
    canceled = PlanResult(GetPathOutcome.CANCELED, "as ordered")
    session.planner.play(straight_plan, obedient(session.clock, 4.0, straight_plan, canceled))
    assert session.send(1.0).wait().success
    session.clock.sleep(0.1)
    assert not session.server.get_path.busy


def test_the_time_to_the_next_plan_counts_from_when_the_robot_sets_off(make_session):
    session = make_session(planner_frequency=1.0)
    session.planner.play(slow(session.clock, 1.5, straight_plan), straight_plan)
    handle = session.send(5.0)
    session.clock.sleep(2.3)
    assert session.plans == 1
    session.clock.sleep(0.4)
    assert session.plans == 2
    handle.cancel()
    handle.wait()


def by_the_side(request):
    """A way of some three metres more."""
    return straight_plan(replace(request, via=(Pose.planar(1.0, 2.5),)))


@pytest.mark.parametrize(("speed", "recovered"), [(0.02, ["first"]), (0.5, [])], ids=["at one place", "on the way"])
def test_a_robot_between_two_ways_recovers_instead_of_changing_its_mind_for_ever(make_session, speed, recovered):
    session = make_session(retries=0, planner_frequency=2.0)
    session.planner.play(*[straight_plan, by_the_side] * 3, straight_plan)
    session.controller.play(*[drive(speed)] * 60, session.controller.follow)
    assert session.send(6.0).wait().success
    assert session.recoveries == recovered
