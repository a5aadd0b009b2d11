"""Waypoint sequences, one move_base goal after the other: order, failures, feedback, cancel, pause, tasks."""

import asyncio

import pytest

from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_status import GoalStatus
from mbf_abstract.goals.goal_types import FollowWaypointsGoal, MoveBaseGoal
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome, MoveBaseOutcome
from mbf_abstract.plugins import ControlResult, PlanResult
from mbf_abstract.testing.faulty import BusyHang, Hang
from mbf_abstract.testing.scripted import straight_plan
from mbf_abstract.testing.scripted_session import ScriptedSession
from mbf_abstract.time.clock import WallClock
from mbf_abstract.time.sim_clock import SimClock
from promises import assert_ended_once, assert_next_goals_work

NO_PATH = PlanResult(GetPathOutcome.NO_PATH_FOUND, "walled in")
NEAR = (Pose.planar(0.3, 0.0), Pose.planar(0.6, 0.0), Pose.planar(0.9, 0.0))
FAR = tuple(Pose.planar(x, 0.0) for x in (50.0, 100.0, 150.0))
EVERY_WAY = [True, False]


def test_waypoints_are_visited_in_order_with_a_task_at_each(make_session):
    session = make_session()
    visited = []

    def task(index, pose):
        visited.append((index, round(session.navigator.robot_pose().distance_to(pose), 1)))

    sequence = session.navigator.follow_waypoints([Pose.planar(0.5, 0), Pose.planar(0.5, 0.5)], loops=2, task=task)
    assert sequence.success
    assert [index for index, _ in visited] == [0, 1, 0, 1]
    assert max(distance for _, distance in visited) <= 0.1


@pytest.mark.parametrize(("stop", "visits"), [(True, 2), (False, 3)])
def test_a_failed_waypoint_ends_the_waypoint_sequence_or_not(make_session, stop, visits):
    session = make_session(recovery_enabled=False, planner_max_retries=0)
    session.planner.play(straight_plan, NO_PATH, straight_plan)
    sequence = session.navigator.follow_waypoints(NEAR, stop_on_failure=stop)
    assert len(sequence.results) == visits
    assert sequence.failed == (1,)
    assert (sequence.success, sequence.outcome) == (False, GetPathOutcome.NO_PATH_FOUND)
    assert "1 of 3 visit(s) failed, first visit 1: walled in" in sequence.message
    assert ("; 1 visit(s) left out" in sequence.message) == stop


def test_a_waypoint_sequence_of_no_loops_is_refused_and_one_of_no_waypoints_is_over_at_once(make_session):
    session = make_session()
    with pytest.raises(ValueError, match="loops"):
        session.navigator.follow_waypoints([], loops=0)
    assert session.navigator.follow_waypoints([]).success


@pytest.mark.parametrize("fields", [{"planner": "none"}, {"controller": "none"}, {"dist_tolerance": -1.0}])
def test_a_waypoint_sequence_whose_visits_would_be_rejected_is_rejected(make_session, fields):
    handle = make_session().navigator.send(FollowWaypointsGoal(NEAR, **fields))
    assert (handle.status, handle.result.outcome) == (GoalStatus.REJECTED, MoveBaseOutcome.FAILURE)


def test_feedback_reports_the_visit_and_how_it_gets_on(make_session):
    session = make_session()
    seen = []
    handle = session.navigator.send(FollowWaypointsGoal(NEAR[:2], loops=2))
    handle.add_feedback_callback(seen.append)
    handle.wait()
    session.clock.sleep(0.1)
    assert list(dict.fromkeys((reported.visit, reported.waypoint) for reported in seen)) == [
        (0, 0),
        (1, 1),
        (2, 0),
        (3, 1),
    ]
    assert all(reported.driving is not None or len(reported.results) == reported.visit + 1 for reported in seen)
    first = [reported.driving.dist_to_goal for reported in seen if reported.driving is not None and reported.visit == 0]
    assert first[0] > first[-1]


# ----------------------------------------------------------------------------------------------------- cancel
@pytest.mark.parametrize("stop", EVERY_WAY)
@pytest.mark.parametrize("end", ["cancel", "cancel_all", "preempt", "close", "asyncio"])
def test_whatever_cancels_the_waypoint_sequence_the_robot_stands_and_sets_off_no_more(make_session, stop, end):
    session = make_session()
    handle = session.navigator.send(FollowWaypointsGoal(FAR, stop_on_failure=stop))
    session.clock.sleep(2.0)
    assert not session.robot.command.is_stopped()

    async def give_up():
        task = asyncio.ensure_future(handle)
        await asyncio.sleep(0.0)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)

    {
        "cancel": handle.cancel,
        "cancel_all": session.navigator.cancel_all,
        "preempt": lambda: session.navigator.send(FollowWaypointsGoal(())),
        "close": session.server.close,
        "asyncio": lambda: asyncio.run(give_up()),
    }[end]()
    result = handle.wait(2.0)
    ended = session.clock.now()
    assert (handle.status, result.outcome) == (GoalStatus.CANCELED, MoveBaseOutcome.CANCELED)
    assert len(result.results) == 1
    session.clock.sleep(5.0)
    assert not session.robot.moved_after(ended)
    assert session.robot.command.is_stopped()
    assert_ended_once(session, handle)


@pytest.mark.parametrize("stop", EVERY_WAY)
def test_a_goal_that_takes_the_robot_away_ends_the_waypoint_sequence(make_session, stop):
    session = make_session()
    handle = session.navigator.send(FollowWaypointsGoal(FAR, stop_on_failure=stop))
    session.clock.sleep(2.0)
    other = session.navigator.send(MoveBaseGoal(Pose.planar(2.0, 0.0)))
    assert other.wait().success
    assert handle.wait().message == "visit 0 was canceled: preempted by a new goal"
    assert handle.status is GoalStatus.CANCELED
    session.clock.sleep(5.0)
    assert session.robot.pose.x < 2.2


def test_a_visit_that_its_controller_gives_up_is_a_failure_not_a_cancel(make_session):
    session = make_session(recovery_enabled=False, controller_max_retries=0)
    blocked = ControlResult(ExePathOutcome.BLOCKED_PATH, "no")
    session.controller.play(blocked, session.controller.follow)
    sequence = session.navigator.follow_waypoints(NEAR, stop_on_failure=False)
    assert sequence.failed == (0,)
    assert len(sequence.results) == 3


def test_a_rejected_visit_ends_the_waypoint_sequence_whatever_it_says(make_session):
    session = make_session(max_quarantined=1)
    sequence = session.navigator.send(
        FollowWaypointsGoal(NEAR, 10**6, False, lambda *_: session.server.runtime.hanging.add("a call"))
    )
    result = sequence.wait(60.0)
    assert [visit.success for visit in result.results] == [True, False]
    assert "plugin calls hang" in result.message


# ------------------------------------------------------------------------------------------------------ pause
@pytest.mark.parametrize("clock", [SimClock, WallClock])
def test_a_paused_waypoint_sequence_holds_and_goes_on_also_after_pausing_all(make_session, clock):
    session = make_session(clock=clock())
    handle = session.navigator.send(FollowWaypointsGoal(NEAR))
    for pause in (handle.pause, session.server.pause_all):
        session.clock.sleep(0.2)
        pause()
        session.clock.sleep(0.3)
        here = session.robot.pose
        session.clock.sleep(0.3)
        assert session.robot.pose.position == here.position
        handle.resume()
    assert handle.wait(60.0).success


def test_a_waypoint_sequence_paused_during_its_task_does_not_set_off(make_session):
    session = make_session()
    handle = session.navigator.send(FollowWaypointsGoal(NEAR, task=lambda index, pose: handle.pause()))
    for visit in range(2):
        session.clock.sleep(10.0)
        assert (handle.status, len(handle.feedback.results)) == (GoalStatus.PAUSED, visit + 1)
        handle.resume()
    assert handle.wait(10.0).success


# ------------------------------------------------------------------------------------------------------- task
@pytest.mark.parametrize("error", [ValueError("no box here"), SystemExit("no box here")])
def test_a_task_that_raises_ends_the_waypoint_sequence_and_the_next_one_works(make_session, error):
    def task(index, pose):
        raise error

    session = make_session()
    sequence = session.navigator.follow_waypoints(NEAR, task=task)
    assert sequence.outcome == MoveBaseOutcome.INTERNAL_ERROR
    assert sequence.message == f"the task at waypoint 0 raised {type(error).__name__}: no box here"
    assert session.navigator.follow_waypoints(NEAR).success


def test_a_task_may_use_the_navigator(make_session):
    session = make_session()

    def task(index, pose):
        assert session.navigator.recover().success
        assert session.navigator.exe_path(session.path_to(pose.x, 0.2)).success

    assert session.navigator.follow_waypoints(NEAR, task=task).success


def test_a_task_that_cancels_all_ends_the_waypoint_sequence_after_itself(make_session):
    session = make_session()
    sequence = session.navigator.follow_waypoints(
        NEAR, stop_on_failure=False, task=lambda index, pose: session.navigator.cancel_all()
    )
    assert (sequence.outcome, len(sequence.results)) == (MoveBaseOutcome.CANCELED, 1)


def test_a_cancel_waits_for_a_hanging_task_no_longer_than_the_grace(make_session):
    session = make_session(cancel_grace=0.5)
    hang = Hang(session.clock)
    handle = session.navigator.send(FollowWaypointsGoal(NEAR, task=lambda index, pose: hang(pose)))
    session.clock.sleep(20.0)
    assert (hang.entered, handle.done) == (1, False)
    handle.cancel("enough")
    result = handle.wait(0.6)
    assert (handle.status, len(result.results)) == (GoalStatus.CANCELED, 1)
    assert result.message == "enough; the task at waypoint 0 has not ended yet"
    assert session.navigator.follow_waypoints(NEAR).success
    assert len(session.server.runtime.hanging) == 1
    hang.release()
    session.clock.sleep(0.1)
    assert not session.server.runtime.hanging
    assert_ended_once(session, handle)
    assert_next_goals_work(session)


def test_a_task_that_stops_simulated_time_is_found_by_the_wall_clock_guard():
    with ScriptedSession(hang_guard=0.2, max_quarantined=1) as session:
        for _ in range(2):  # more than max_quarantined
            hang = BusyHang()
            handle = session.navigator.send(FollowWaypointsGoal(NEAR, task=lambda index, pose, hang=hang: hang(pose)))
            result = handle.wait()
            assert (result.outcome, len(result.results)) == (MoveBaseOutcome.INTERNAL_ERROR, 1)
            assert "the task at waypoint 0 stopped the clock for too long" in result.message
            assert_ended_once(session, handle)
            hang.release.cancel()
            while session.server.runtime.hanging:
                session.clock.sleep(0.01)
            assert_next_goals_work(session)
