"""The recovery and refiner executions with their actions."""

import pytest

from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Path, Twist
from mbf_abstract.goals.goal_status import GoalStatus
from mbf_abstract.goals.goal_types import RecoveryGoal, RefinePathGoal
from mbf_abstract.outcomes import RecoveryOutcome, RefinePathOutcome
from mbf_abstract.plugins import RecoveryResult, RefineResult
from mbf_abstract.testing.faulty import Hang, obedient, slow
from mbf_abstract.time.clock import WallClock
from mbf_abstract.time.sim_clock import SimClock

DONE = RecoveryResult(RecoveryOutcome.SUCCESS, "")


def wait_for(seconds):
    """A behaviour that waits as a good one does: through its motion."""
    return lambda request: DONE if request.motion.sleep(seconds) else RecoveryResult(RecoveryOutcome.CANCELED, "ended")


def drive_for(seconds, speed=0.3):
    def run(request):
        for _ in range(round(seconds / 0.1)):
            request.motion.send(Twist.planar(speed))
            if not request.motion.sleep(0.1):
                return RecoveryResult(RecoveryOutcome.CANCELED, "ended")
        return DONE

    return run


def test_a_behaviour_that_succeeds_names_itself_also_as_the_default(make_session):
    session = make_session()
    session.recovery.play(DONE)
    handle = session.navigator.send(RecoveryGoal())
    result = handle.wait()
    assert handle.status is GoalStatus.SUCCEEDED
    assert (result.used_plugin, result.message) == ("recovery", "recovery 'recovery' done")


def test_a_behaviour_that_fails_aborts_its_goal_with_its_own_code(make_session):
    session = make_session()
    session.recovery.play(RecoveryResult(RecoveryOutcome.IMPASSABLE, ""))
    handle = session.navigator.send(RecoveryGoal())
    result = handle.wait()
    assert (handle.status, result.outcome) == (GoalStatus.ABORTED, RecoveryOutcome.IMPASSABLE)
    assert result.message == "plugin 'recovery' failed with IMPASSABLE and gave no reason"


@pytest.mark.parametrize(
    ("driver_takes", "reason"),
    [
        (0.0, "no command for 0.500 s (command_timeout 0.5 s)"),
        (0.8, "send_command has not returned for 0.500 s (command_timeout 0.5 s)"),
    ],
)
def test_a_stop_by_the_watchdog_names_who_is_late_and_the_limit(make_session, monkeypatch, driver_takes, reason):
    session = make_session()
    send = session.robot.send_command

    def late_send(command):
        if not command.is_stopped():
            session.clock.sleep(driver_takes)
        send(command)

    def drive_once(request):
        request.motion.send(Twist.planar(0.3))
        request.motion.sleep(0.8 - driver_takes)
        return DONE

    monkeypatch.setattr(session.robot, "send_command", late_send)
    session.recovery.play(drive_once)
    assert session.navigator.recover().success

    assert [event.data["reason"] for event in session.recorded(EventKind.ROBOT_STOPPED)][:1] == [reason]


def test_a_behaviour_is_called_once_whatever_it_says(make_session):
    session = make_session(planner_max_retries=5)
    session.recovery.play(RecoveryResult(RecoveryOutcome.FAILURE, "no"))
    assert session.navigator.recover().outcome == RecoveryOutcome.FAILURE
    assert len(session.recovery.requests) == 1


def test_a_canceled_behaviour_ends_canceled(make_session):
    session = make_session()
    session.recovery.play(wait_for(10.0))
    handle = session.navigator.send(RecoveryGoal())
    session.clock.sleep(1.0)
    handle.cancel()
    assert handle.wait().outcome == RecoveryOutcome.CANCELED
    assert handle.status is GoalStatus.CANCELED
    assert session.clock.now() == pytest.approx(1.0)


def test_after_a_cancel_the_driver_has_a_grace_of_its_own(make_session):
    session = make_session(cancel_grace=1.0, command_timeout=5.0)
    send, clock = session.robot.send_command, session.clock

    def send_slowly(command):
        clock.sleep(0.5 if command.is_stopped() else 0.0)
        send(command)

    def ends_late(request):
        request.motion.send(Twist.planar(0.3))
        clock.sleep(0.8)  # without a look at its token
        return DONE

    session.robot.send_command = send_slowly
    session.recovery.play(ends_late)
    handle = session.navigator.send(RecoveryGoal())
    clock.sleep(0.0)
    handle.cancel()
    assert handle.wait().message == "recovery 'recovery' canceled"
    assert clock.now() == pytest.approx(1.3)


def test_a_behaviour_that_outlasts_its_patience_ends_with_pat_exceeded(make_session):
    session = make_session(recovery_patience=2.0)
    session.recovery.play(wait_for(10.0))
    handle = session.navigator.send(RecoveryGoal())
    result = handle.wait()
    assert (handle.status, result.outcome) == (GoalStatus.ABORTED, RecoveryOutcome.PAT_EXCEEDED)
    assert "longer than 2 s; last message: ended" in result.message
    assert session.clock.now() == pytest.approx(2.0, abs=0.01)


def test_a_behaviour_without_patience_limit_may_take_for_ever(make_session):
    session = make_session(recovery_patience=0.0)
    session.recovery.play(wait_for(100.0))
    assert session.navigator.recover().success


def test_a_behaviour_that_raises_is_an_internal_error_and_the_robot_stands(make_session):
    session = make_session()

    def drives_and_raises(request):
        request.motion.send(Twist.planar(0.5))
        raise RuntimeError("lost my way")

    session.recovery.play(drives_and_raises)
    result = session.navigator.recover()
    assert result.outcome == RecoveryOutcome.INTERNAL_ERROR
    assert "RuntimeError in run_behavior: lost my way" in result.message
    assert session.robot.command == Twist()


def test_a_behaviour_that_hangs_is_stopped_and_its_goal_ended(make_session):
    session = make_session(recovery_patience=1.0, cancel_grace=0.5)
    hang = Hang(session.clock, then=DONE)

    def drives_and_hangs(request):
        request.motion.send(Twist.planar(0.5))
        return hang(request)

    session.recovery.play(drives_and_hangs)
    result = session.navigator.recover()
    assert result.outcome == RecoveryOutcome.PAT_EXCEEDED
    assert session.robot.command == Twist()
    assert session.clock.now() == pytest.approx(1.5, abs=0.01)
    assert session.navigator.recover().outcome == RecoveryOutcome.INVALID_PLUGIN  # quarantined
    hang.release()
    session.clock.sleep(0.1)
    session.recovery.play(DONE)
    assert session.navigator.recover().success


def test_a_canceled_behaviour_that_hangs_ends_canceled_after_the_grace(make_session):
    session = make_session(cancel_grace=0.5)
    hang = Hang(session.clock, then=DONE)
    session.recovery.play(hang)
    handle = session.navigator.send(RecoveryGoal())
    session.clock.sleep(1.0)
    handle.cancel()
    assert handle.wait().outcome == RecoveryOutcome.CANCELED
    assert session.clock.now() == pytest.approx(1.5)
    hang.release()


def test_a_behaviour_that_ignores_patience_but_succeeds_within_the_grace_succeeds(make_session):
    session = make_session(recovery_patience=1.0, cancel_grace=1.0)
    session.recovery.play(slow(session.clock, 1.5, DONE))
    assert session.navigator.recover().success


@pytest.mark.parametrize("clock", [SimClock, WallClock])
@pytest.mark.parametrize("seconds", [float("inf"), 1e30])
def test_a_behaviour_may_wait_for_ever_until_it_is_canceled(make_session, clock, seconds):
    session = make_session(clock=clock(), recovery_patience=0.0)
    session.recovery.play(wait_for(seconds))
    handle = session.navigator.send(RecoveryGoal())
    session.clock.sleep(0.1)
    handle.cancel()
    assert handle.wait(5.0).outcome == RecoveryOutcome.CANCELED
    assert session.clock.now() < 1e6


def test_a_pause_stops_the_robot_at_once_and_does_not_use_up_patience(make_session):
    session = make_session(recovery_patience=3.0)
    session.recovery.play(drive_for(2.0))
    handle = session.navigator.send(RecoveryGoal())
    session.clock.sleep(1.05)
    handle.pause()
    session.clock.sleep(0.0)
    assert session.robot.command == Twist()
    assert handle.status is GoalStatus.PAUSED
    paused_at = session.robot.pose.x
    session.clock.sleep(100.0)
    assert session.robot.pose.x == paused_at
    handle.resume()
    assert handle.wait().success
    assert session.robot.pose.x == pytest.approx(0.6, abs=0.05)


def test_an_unknown_behaviour_is_rejected(make_session):
    session = make_session()
    handle = session.navigator.send(RecoveryGoal("dance"))
    assert handle.status is GoalStatus.REJECTED
    assert handle.result.outcome == RecoveryOutcome.INVALID_PLUGIN
    assert "no recovery behavior named 'dance'; loaded: recovery" in handle.result.message


def test_a_behaviour_that_returns_no_recovery_result_is_an_internal_error(make_session):
    session = make_session()
    session.recovery.play(None)
    assert "returned NoneType" in session.navigator.recover().message


def test_a_motion_reads_the_robot(make_session):
    session = make_session()
    seen = []

    def look(request):
        seen.append((request.motion.pose().x, request.motion.velocity()))
        return DONE

    session.recovery.play(look)
    session.navigator.recover()
    assert seen == [(0.0, Twist())]


# ---------------------------------------------------------------------------------------------- refine_path
BENT = Path.from_points([(0, 0, 0), (1, 1, 0), (2, 0, 0)])
STRAIGHT = Path.from_points([(0, 0, 0), (1, 0, 0), (2, 0, 0)])
NO = RefineResult(RefinePathOutcome.FAILURE, "too bent")


def test_a_refined_path_comes_with_its_three_measures(make_session):
    session = make_session()
    session.refiner.play(RefineResult(0, "smooth", STRAIGHT))
    result = session.navigator.refine_path(BENT)
    assert result.success
    assert result.refined_path is STRAIGHT
    assert result.final_position_error == 0.0
    assert result.final_orientation_error == pytest.approx(0.785, abs=1e-3)
    assert result.path_length_ratio == pytest.approx(2.0 / BENT.length)
    assert result.refiner == "refiner"


def test_success_after_five_failures_of_a_refiner(make_session):
    session = make_session(refiner_max_retries=5)
    session.refiner.play(*[NO] * 5, RefineResult(0, "", STRAIGHT))
    assert session.navigator.refine_path(BENT).success
    assert len(session.refiner.requests) == 6


def test_a_refiner_that_uses_up_its_five_retries_is_depleted_after_six_calls(make_session):
    session = make_session(refiner_max_retries=5)
    session.refiner.play(NO)
    result = session.navigator.refine_path(BENT)
    assert len(session.refiner.requests) == 6
    assert result.outcome == RefinePathOutcome.DEPLETED
    assert result.message == "6 attempts failed, the last with: too bent"


def test_without_retries_the_refiners_own_code_is_the_end(make_session):
    session = make_session()
    session.refiner.play(NO)
    result = session.navigator.refine_path(BENT)
    assert result.outcome == RefinePathOutcome.FAILURE
    assert result.refined_path is BENT  # it can be driven as it could before
    assert len(session.refiner.requests) == 1


def test_a_refiner_that_never_succeeds_is_stopped_by_patience(make_session):
    session = make_session(refiner_max_retries=-1, planner_patience=1.0)
    session.refiner.play(NO)
    assert session.navigator.refine_path(BENT).outcome == RefinePathOutcome.STOPPED


def test_a_refiner_that_raises_is_an_internal_error(make_session):
    session = make_session()
    session.refiner.play(ZeroDivisionError("oops"))
    assert session.navigator.refine_path(BENT).outcome == RefinePathOutcome.INTERNAL_ERROR


@pytest.mark.parametrize("path", [None, Path.from_poses([])])
def test_a_refiner_that_succeeds_without_poses_is_an_internal_error(make_session, path):
    session = make_session()
    session.refiner.play(RefineResult(0, "done", path))
    assert session.navigator.refine_path(BENT).outcome == RefinePathOutcome.INTERNAL_ERROR


@pytest.mark.parametrize(
    ("points", "frame", "message"),
    [
        ([(0, 0, 0), (1, 0, 0)], "map", "it ends 1.00 m from where the plan ends, allowed 0.50 m"),
        ([(0, -0.6, 0), (2, 0, 0)], "map", "it begins 0.60 m from where the plan begins, allowed 0.50 m"),
        ([(0, 0, -3), (2, 0, -3)], "map", "it begins 3.00 m from where the plan begins, allowed 0.50 m"),
        ([(0, 0, 0), (2, 0, 0)], "nowhere", "no transform from 'nowhere' to 'map'"),
    ],
)
def test_a_refined_path_that_leads_elsewhere_is_refused_by_the_name_of_its_refiner(
    make_session, points, frame, message
):
    session = make_session(plan_end_tolerance=0.5)
    session.refiner.play(RefineResult(0, "done", Path.from_points(points, frame_id=frame)))
    result = session.navigator.refine_path(BENT)
    assert (result.outcome, result.refined_path) == (RefinePathOutcome.INTERNAL_ERROR, BENT)
    assert f"the path of refiner 'refiner' is refused: {message}" in result.message


def test_a_canceled_refiner_ends_canceled(make_session):
    session = make_session()
    session.refiner.play(slow(session.clock, 0.5, RefineResult(0, "", STRAIGHT)))
    handle = session.navigator.send(RefinePathGoal(BENT))
    session.clock.sleep(0.1)
    handle.cancel()
    assert handle.wait().outcome == RefinePathOutcome.CANCELED


def test_a_canceled_refiner_that_hangs_ends_canceled_too(make_session):
    session = make_session(planner_patience=0.0, cancel_grace=0.5)
    hang = Hang(session.clock, then=NO)
    session.refiner.play(hang)
    handle = session.navigator.send(RefinePathGoal(BENT))
    session.clock.sleep(0.1)
    handle.cancel("enough")
    result = handle.wait(1.0)
    assert (handle.status, result.outcome) == (GoalStatus.CANCELED, RefinePathOutcome.CANCELED)
    assert result.message == "enough; refiner 'refiner' has not ended yet"
    hang.release()


def test_a_refiner_that_hangs_is_given_up(make_session):
    session = make_session(planner_patience=1.0, cancel_grace=0.5)
    hang = Hang(session.clock, then=NO)
    session.refiner.play(hang)
    assert session.navigator.refine_path(BENT).outcome == RefinePathOutcome.STOPPED
    hang.release()


@pytest.mark.parametrize(
    ("goal", "words"),
    [
        (RefinePathGoal(BENT, refiner="polish"), "no refiner named 'polish'"),
        (RefinePathGoal(Path.from_poses([])), "the path has no poses"),
    ],
)
def test_a_refine_goal_that_can_not_be_served_is_rejected(make_session, goal, words):
    session = make_session()
    handle = session.navigator.send(goal)
    assert handle.status is GoalStatus.REJECTED
    assert words in handle.result.message


def test_an_obedient_behaviour_returns_soon_after_its_token_is_set(make_session):
    session = make_session(recovery_patience=0.5)
    session.recovery.play(obedient(session.clock, 9.0, DONE, RecoveryResult(RecoveryOutcome.CANCELED, "as ordered")))
    assert session.navigator.recover().outcome == RecoveryOutcome.PAT_EXCEEDED
    assert session.clock.now() < 0.6
