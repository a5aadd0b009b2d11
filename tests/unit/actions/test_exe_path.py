"""The exe_path action: plan updates, slots, cancel both ways, pause."""

import math

import pytest

from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.goals.goal_status import GoalStatus
from mbf_abstract.goals.goal_types import ExePathGoal
from mbf_abstract.outcomes import ExePathOutcome as Outcome
from mbf_abstract.testing.faulty import Hang, drive, slow
from mbf_abstract.testing.scripted import ScriptedController

TWO = {"controller": ScriptedController, "other": ScriptedController}


def send(session, x, y=0.0, **fields):
    return session.navigator.send(ExePathGoal(session.path_to(x, y), **fields))


def stops_between(session, begin, end):
    return [stamp for stamp, command in session.robot.commands if begin <= stamp <= end and command.is_stopped()]


# --------------------------------------------------------------------------------------------- plan update
@pytest.mark.parametrize("name", ["", "controller"])
def test_a_new_plan_for_the_same_controller_is_followed_without_stopping(make_session, name):
    session = make_session()
    first = send(session, 5.0)
    session.clock.sleep(1.0)
    second = send(session, 3.0, 2.0, controller=name)
    session.clock.sleep(1.0)
    assert first.status is GoalStatus.CANCELED
    assert (first.result.outcome, first.result.message) == (Outcome.CANCELED, "preempted by a new plan")
    assert second.wait().success
    assert stops_between(session, 0.05, 3.0) == []
    assert len(session.recorded(EventKind.LEASE_GRANTED)) == 1
    assert session.robot.pose.distance_to(Pose.planar(3.0, 2.0)) < 0.15


def test_the_new_goals_tolerances_count_after_an_update(make_session):
    session = make_session()
    send(session, 5.0)
    session.clock.sleep(0.5)
    result = send(session, 5.0, dist_tolerance=1.5, angle_tolerance=3.0).wait()
    assert result.success
    assert 1.0 < result.dist_to_goal < 1.6


def test_three_plans_in_a_row_end_the_older_ones(make_session):
    session = make_session()
    handles = [send(session, 5.0)]
    session.clock.sleep(0.51)
    handles += [send(session, 4.0), send(session, 3.0)]
    assert handles[2].wait().success
    assert [handle.status for handle in handles[:2]] == [GoalStatus.CANCELED] * 2
    assert handles[1].result.message == "preempted by a new goal before it started"


def test_another_controller_stops_the_robot_and_then_starts(make_session):
    session = make_session(TWO)
    first = send(session, 5.0, controller="controller")
    session.clock.sleep(1.01)
    second = send(session, 4.0, controller="other")
    assert second.wait().success
    assert (first.status, first.result.message) == (GoalStatus.CANCELED, "preempted by a new goal")
    assert stops_between(session, 1.0, 1.1)
    assert [event.data["holder"] for event in session.recorded(EventKind.LEASE_GRANTED)] == [
        "exe_path controller",
        "exe_path other",
    ]
    assert session.plugin("other", ScriptedController).requests


def test_a_plan_that_comes_too_late_for_the_loop_is_run_on_its_own(make_session):
    session = make_session()
    first = send(session, 5.0)
    session.clock.sleep(1.0)
    session.controller.play(slow(session.clock, 0.1, ValueError("broken")), session.controller.follow)
    session.clock.sleep(0.1)
    second = send(session, 4.0)  # offered while the loop is inside the call that ends it
    assert second.wait().success
    assert first.result.outcome == Outcome.INTERNAL_ERROR
    assert len(session.recorded(EventKind.LEASE_GRANTED)) == 2


def test_an_update_in_an_unknown_frame_is_a_transform_error(make_session):
    session = make_session()
    send(session, 5.0)
    session.clock.sleep(0.5)
    lost = Path.from_points([(0, 0, 0), (1, 0, 0)], frame_id="mars")
    result = session.navigator.send(ExePathGoal(lost)).wait()
    assert result.outcome == Outcome.TF_ERROR
    assert "mars" in result.message
    assert session.robot.command == Twist()


def test_an_update_that_the_controller_refuses_ends_standing(make_session):
    session = make_session()
    send(session, 5.0)
    session.clock.sleep(0.5)
    session.controller.accepts_plan = False
    assert send(session, 3.0).wait().outcome == Outcome.INVALID_PATH
    assert session.robot.command == Twist()


def test_an_update_while_the_robot_comes_to_rest_makes_it_drive_on(make_session):
    session = make_session(goal_max_speed=1e-9)
    first = send(session, 0.5)
    session.clock.sleep(0.3)
    second = send(session, 2.0)
    assert second.wait().success
    assert first.status is GoalStatus.CANCELED


# -------------------------------------------------------------------------------------------------- cancel
def test_a_cancel_stops_the_robot_in_the_next_cycle(make_session):
    session = make_session()
    handle = send(session, 5.0)
    session.clock.sleep(1.01)
    handle.cancel()
    assert handle.status is GoalStatus.CANCELING
    result = handle.wait()
    assert (handle.status, result.outcome) == (GoalStatus.CANCELED, Outcome.CANCELED)
    assert session.clock.now() <= 1.06
    assert session.robot.command == Twist()
    assert session.controller.cancel_calls == 1


def test_without_force_stop_on_cancel_the_watchdog_stops_the_robot(make_session):
    session = make_session(force_stop_on_cancel=False)
    handle = send(session, 5.0)
    session.clock.sleep(1.0)
    handle.cancel()
    handle.wait()
    assert not session.robot.command.is_stopped()
    session.clock.sleep(0.6)
    assert session.robot.command == Twist()


def test_a_controller_that_can_stop_by_itself_is_let_to(make_session):
    session = make_session()
    session.controller.stops_itself = True
    handle = send(session, 5.0)
    session.clock.sleep(1.01)
    handle.cancel()
    result = handle.wait()
    assert result.outcome == Outcome.CANCELED
    speeds = [command.vx for stamp, command in session.robot.commands if stamp > 1.01]
    assert speeds == pytest.approx([0.2, 0.15, 0.1, 0.05, 0.0])
    assert session.controller.cancel_calls == 1


def test_a_controller_that_promises_to_stop_and_does_not_is_stopped_after_the_grace(make_session):
    session = make_session(cancel_grace=0.5)
    session.controller.cancel = lambda: True
    handle = send(session, 50.0)
    session.clock.sleep(1.0)
    handle.cancel()
    assert handle.wait().outcome == Outcome.CANCELED
    assert 1.5 <= session.clock.now() < 1.65
    assert session.robot.command == Twist()


def test_a_cancel_through_an_old_handle_does_not_touch_the_new_goal(make_session):
    session = make_session()
    first = send(session, 5.0)
    session.clock.sleep(0.5)
    second = send(session, 3.0)
    session.clock.sleep(0.5)
    first.cancel()
    assert second.wait().success


def test_a_goal_that_takes_over_from_a_canceled_one_has_its_own_time(make_session):
    session = make_session(cancel_grace=0.2, controller_patience=5.0)
    first = send(session, 5.0)
    session.clock.sleep(1.0)
    session.controller.play(slow(session.clock, 1.0, session.controller.follow), session.controller.follow)
    second = send(session, 3.0)
    first.cancel()  # the newer goal is on offer already
    assert second.wait().success
    assert first.status is GoalStatus.CANCELED


def test_a_goal_canceled_while_it_waits_for_its_slot_never_runs(make_session):
    session = make_session(TWO, cancel_grace=5.0)
    first = send(session, 5.0, controller="controller")
    session.plugin("controller", ScriptedController).play(slow(session.clock, 1.0, drive()))
    session.clock.sleep(0.5)
    second = send(session, 3.0, controller="other")
    second.cancel("changed my mind")
    first.wait()
    assert second.wait().message == "changed my mind before it started"
    assert session.plugin("other", ScriptedController).requests == []


def test_a_canceled_controller_that_hangs_ends_canceled_and_never_drives_again(make_session):
    session = make_session(cancel_grace=0.5)
    hang = Hang(session.clock, then=drive(9.0))
    session.controller.play(drive(), hang)
    handle = send(session, 50.0)
    session.clock.sleep(0.2)
    handle.cancel()
    result = handle.wait()
    assert result.outcome == Outcome.CANCELED
    assert "has not ended yet" in result.message
    hang.release()
    session.clock.sleep(1.0)
    assert all(command.vx < 9.0 for _, command in session.robot.commands)


# --------------------------------------------------------------------------------------------------- pause
def test_pause_holds_the_robot_and_stops_all_clocks(make_session):
    limits = {"controller_patience": 2.0, "cmd_vel_ignored_tolerance": 2.0, "oscillation_timeout": 3.0}
    session = make_session(**limits)
    handle = send(session, 2.0)
    session.clock.sleep(1.0)
    handle.pause()
    handle.pause()
    session.clock.sleep(0.1)
    assert handle.status is GoalStatus.PAUSED
    assert session.robot.command == Twist()
    where = session.robot.pose.x
    session.clock.sleep(60.0)
    assert session.robot.pose.x == where
    handle.resume()
    assert handle.status is GoalStatus.ACTIVE
    assert handle.wait().success
    assert len(session.recorded(EventKind.LEASE_GRANTED)) == 1


def test_a_paused_goal_can_be_canceled(make_session):
    session = make_session()
    session.controller.stops_itself = True
    handle = send(session, 2.0)
    session.clock.sleep(0.5)
    handle.pause()
    session.clock.sleep(1.0)
    handle.cancel()
    assert handle.wait().outcome == Outcome.CANCELED
    assert session.clock.now() < 1.6


def test_a_goal_paused_before_it_starts_does_not_move_the_robot(make_session):
    session = make_session()
    handle = send(session, 2.0)
    handle.pause()
    session.clock.sleep(20.0)
    assert session.robot.pose.x == 0.0
    handle.resume()
    assert handle.wait().success


def test_a_new_plan_wakes_a_paused_loop(make_session):
    session = make_session()
    first = send(session, 5.0)
    session.clock.sleep(0.5)
    first.pause()
    session.clock.sleep(0.5)
    assert send(session, 2.0).wait().success
    assert first.status is GoalStatus.CANCELED


# ------------------------------------------------------------------------------------------------ rejection
@pytest.mark.parametrize(
    ("fields", "outcome", "words"),
    [
        ({"controller": "nobody"}, Outcome.INVALID_PLUGIN, "no controller named 'nobody'"),
        ({"path": Path.from_poses([])}, Outcome.INVALID_PATH, "the path has no poses"),
        ({"dist_tolerance": 0.0}, Outcome.INVALID_PATH, "dist_tolerance must be positive"),
        ({"angle_tolerance": -1.0}, Outcome.INVALID_PATH, "angle_tolerance must be positive"),
        (
            {"dist_tolerance": math.inf},
            Outcome.INVALID_PATH,
            "dist_tolerance must be positive and at most 1000, got inf",
        ),
        ({"concurrency_slot": -1}, Outcome.INTERNAL_ERROR, "0..255"),
    ],
)
def test_a_goal_that_can_not_be_served_is_rejected_with_the_reason(make_session, fields, outcome, words):
    session = make_session()
    handle = session.navigator.send(ExePathGoal(**{"path": session.path_to(1.0), **fields}))
    assert handle.status is GoalStatus.REJECTED
    assert handle.result.outcome == outcome
    assert words in handle.result.message


def test_a_path_in_another_frame_is_followed_in_the_global_one(make_session):
    session = make_session()
    path = Path.from_points([(0, 0, 0), (1, 0, 0)], frame_id="odom")
    result = session.navigator.exe_path(path)
    assert result.success
    assert session.controller.paths[0].frame_id == "map"


def test_a_path_in_an_unknown_frame_is_a_transform_error(make_session):
    session = make_session()
    assert session.navigator.exe_path(Path.from_points([(0, 0, 0)], frame_id="mars")).outcome == Outcome.TF_ERROR
