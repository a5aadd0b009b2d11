"""move_base: newer goals that take over in every state, and goals that cannot be served."""

import pytest

from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.goals.goal_status import GoalStatus
from mbf_abstract.goals.goal_types import MoveBaseGoal
from mbf_abstract.outcomes import MoveBaseOutcome as Outcome
from mbf_abstract.plugins import RecoveryResult
from mbf_abstract.testing.faulty import slow
from mbf_abstract.testing.scripted import ScriptedRecovery, straight_plan


def test_a_newer_goal_takes_over_while_the_robot_drives_on(make_session):
    session = make_session()
    session.planner.play(straight_plan, slow(session.clock, 0.5, straight_plan))
    first = session.send(5.0)
    session.clock.sleep(1.0)
    second = session.send(3.0, 2.0)
    session.clock.sleep(0.3)
    assert (first.status, first.result.outcome) == (GoalStatus.CANCELED, Outcome.CANCELED)
    assert first.result.message == "preempted by a new goal"
    assert not session.robot.command.is_stopped()
    result = second.wait()
    assert result.success
    assert session.robot.pose.distance_to(Pose.planar(3.0, 2.0)) < 0.15
    assert len(session.recorded(EventKind.LEASE_GRANTED)) == 1


def test_arriving_at_the_old_goal_while_the_new_plan_is_made_is_no_success_of_the_new_one(make_session):
    session = make_session()
    session.planner.play(straight_plan, slow(session.clock, 3.0, straight_plan))
    session.send(1.0)
    session.clock.sleep(1.5)
    second = session.send(1.0, 2.0)
    assert second.wait().success
    assert session.robot.pose.distance_to(Pose.planar(1.0, 2.0)) < 0.15


def test_a_failed_plan_for_the_new_goal_stops_the_robot_and_recovers(make_session):
    session = make_session(retries=0)
    session.planner.play(straight_plan, session.no_path, straight_plan)
    session.send(5.0)
    session.clock.sleep(1.0)
    assert session.send(3.0).wait().success
    assert session.recoveries == ["first"]


def test_a_newer_goal_during_recovery_is_planned_for_afterwards(make_session):
    session = make_session(retries=0)
    session.planner.play(session.no_path, straight_plan)
    session.plugin("first", ScriptedRecovery).play(slow(session.clock, 2.0, RecoveryResult(0, "waited")))
    first = session.send(5.0)
    session.clock.sleep(1.0)
    second = session.send(1.0)
    assert second.wait().success
    assert first.status is GoalStatus.CANCELED
    assert [request.goal.x for request in session.planner.requests] == [5.0, 1.0]


def test_a_newer_goal_while_the_robot_stops_is_planned_for_without_the_old_recovery(make_session):
    session = make_session(retries=0, planner_frequency=2.0, replan_failed_policy="recover")
    session.controller.stops_itself = True  # takes five cycles
    session.planner.play(straight_plan, session.no_path, straight_plan)
    session.send(5.0)
    session.clock.sleep(0.6)
    second = session.send(1.0)
    assert second.wait().success
    assert session.recoveries == []


def test_a_newer_goal_in_an_unknown_frame_stops_the_robot(make_session):
    session = make_session()
    first = session.send(5.0)
    session.clock.sleep(1.0)
    second = session.navigator.send(MoveBaseGoal(Pose.planar(1.0, 0.0, frame_id="mars")))
    result = second.wait()
    assert result.outcome == Outcome.TF_ERROR
    assert "mars" in result.message
    assert first.status is GoalStatus.CANCELED
    assert session.robot.command == Twist()


def test_many_goals_at_once_leave_only_the_newest(make_session):
    session = make_session()
    handles = [session.send(float(x)) for x in range(1, 6)]
    session.clock.sleep(0.5)
    handles += [session.send(0.5), session.send(1.0)]
    assert handles[-1].wait().success
    assert {handle.status for handle in handles[:-1]} == {GoalStatus.CANCELED}


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"planner": "x"}, "no planner named 'x'"),
        ({"controller": "x"}, "no controller named 'x'"),
        ({"recovery_behaviors": ("first", "x")}, "no recovery behavior named 'x'"),
        ({"dist_tolerance": 0.0}, "dist_tolerance must be positive"),
        ({"angle_tolerance": -1.0}, "angle_tolerance must be positive"),
        ({"dist_tolerance": 1e30}, "dist_tolerance must be positive and at most 1000, got 1e+30"),
        ({"angle_tolerance": 360}, "angle_tolerance must be positive and at most 6.28319, got 360"),
    ],
)
def test_a_goal_that_can_not_be_served_is_rejected_with_the_reason(make_session, fields, words):
    session = make_session()
    handle = session.send(**fields)
    assert handle.status is GoalStatus.REJECTED
    assert handle.result.outcome == Outcome.FAILURE
    assert words in handle.result.message


def test_without_a_robot_pose_the_goal_is_a_transform_error(make_session):
    session = make_session()
    session.robot.publishes_pose = False
    session.transforms.clear()
    result = session.send().wait()
    assert (result.outcome, result.final_pose) == (Outcome.TF_ERROR, None)


def test_a_target_in_an_unknown_frame_is_a_transform_error(make_session):
    session = make_session()
    result = session.navigator.go_to(Pose.planar(1.0, 0.0, frame_id="mars"))
    assert result.outcome == Outcome.TF_ERROR
