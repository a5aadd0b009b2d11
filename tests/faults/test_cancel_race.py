"""Fault table, row 15: cancels at every awkward moment, and interleavings enumerated by seeded schedules."""

import numpy as np
import pytest

from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_status import GoalStatus
from mbf_abstract.goals.goal_types import ExePathGoal, GetPathGoal, MoveBaseGoal, RecoveryGoal
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome, MoveBaseOutcome, RecoveryOutcome
from mbf_abstract.plugins import PlanResult, RecoveryResult
from mbf_abstract.testing.faulty import obedient, slow
from mbf_abstract.testing.scripted import straight_plan
from mbf_abstract.testing.scripted_session import ScriptedSession
from mbf_abstract.time.sim_clock import SimClock
from promises import assert_ended_once, assert_next_goals_work

GOAL = Pose.planar(3.0, 0.0)


def test_a_cancel_before_the_start_is_honoured():
    with ScriptedSession() as session:
        session.planner.play(slow(session.clock, 1.0, straight_plan))
        running = session.navigator.send(GetPathGoal(GOAL))
        waiting = session.navigator.send(GetPathGoal(GOAL, concurrency_slot=1))  # same plugin: waits for it
        waiting.cancel()
        assert waiting.wait().outcome == GetPathOutcome.CANCELED
        assert running.wait().success
        assert len(session.planner.requests) == 1
        assert_ended_once(session, waiting)


def test_a_second_cancel_and_one_after_the_end_change_nothing():
    with ScriptedSession() as session:
        session.planner.play(obedient(session.clock, 5.0, straight_plan, PlanResult(GetPathOutcome.CANCELED, "")))
        handle = session.navigator.send(GetPathGoal(GOAL))
        session.clock.sleep(0.5)
        handle.cancel("first")
        handle.cancel("second")
        result = handle.wait()
        handle.cancel("third")
        session.clock.sleep(0.1)
        assert (handle.status, handle.result) == (GoalStatus.CANCELED, result)
        assert result.message == "first"
        assert_ended_once(session, handle)
        done = session.navigator.send(GetPathGoal(GOAL, concurrency_slot=2))
        session.planner.play(straight_plan)
        assert done.wait().success
        done.cancel()
        assert done.status is GoalStatus.SUCCEEDED


def test_a_cancel_from_a_feedback_callback_works():
    with ScriptedSession() as session:
        handle = session.navigator.send(ExePathGoal(session.path_to(50.0)))
        handle.add_feedback_callback(lambda feedback: handle.cancel("from a callback"))
        result = handle.wait()
        assert (result.outcome, result.message) == (ExePathOutcome.CANCELED, "from a callback")
        assert session.robot.command.is_stopped()
        assert_ended_once(session, handle)


@pytest.mark.parametrize("moment", ["plan", "drive", "recovery"])
def test_a_move_base_goal_can_be_canceled_in_each_of_its_phases(moment):
    with ScriptedSession(planner_max_retries=0) as session:
        if moment == "plan":
            session.planner.play(obedient(session.clock, 50.0, straight_plan, PlanResult(GetPathOutcome.CANCELED, "")))
        if moment == "recovery":
            session.planner.play(PlanResult(GetPathOutcome.NO_PATH_FOUND, "walled in"))
            canceled = RecoveryResult(RecoveryOutcome.CANCELED, "")
            session.recovery.play(obedient(session.clock, 50.0, RecoveryResult(0, ""), canceled))
        handle = session.navigator.send(MoveBaseGoal(Pose.planar(50.0, 0.0)))
        session.clock.sleep(2.0)
        assert bool(session.recovery.requests) == (moment == "recovery")
        assert bool(session.controller.requests) == (moment == "drive")
        handle.cancel()
        assert handle.wait(2.0).outcome == MoveBaseOutcome.CANCELED
        assert session.robot.command.is_stopped()
        assert_ended_once(session, handle)
        assert_next_goals_work(session)


ACTIONS = (
    lambda session: GetPathGoal(GOAL),
    lambda session: ExePathGoal(session.path_to(0.3)),
    lambda session: RecoveryGoal(),
    lambda session: MoveBaseGoal(Pose.planar(0.4, 0.0)),
)


def run_schedule(seed):
    """Send, preempt, pause, resume and cancel goals of all actions at random instants and interleavings."""
    rng = np.random.default_rng(seed)
    with ScriptedSession(clock=SimClock(schedule=rng), planner_patience=2.0, controller_patience=2.0) as session:
        session.planner.play(slow(session.clock, 0.02, straight_plan), straight_plan)
        handles = []
        for _ in range(rng.integers(2, 7)):
            step = rng.integers(6) if handles else 0
            if step <= 1:
                handles.append(session.navigator.send(ACTIONS[rng.integers(len(ACTIONS))](session)))
            elif step == 2:
                handles[rng.integers(len(handles))].cancel()
            elif step == 3:
                handles[rng.integers(len(handles))].pause()
            elif step == 4:
                handles[rng.integers(len(handles))].resume()
            else:
                session.clock.sleep(float(rng.choice([0.0, 0.01, 0.05, 0.3])))
        for handle in handles:
            handle.resume()
        for handle in handles:
            handle.wait(30.0)
        for handle in handles:
            assert_ended_once(session, handle)
        session.clock.sleep(1.0)
        assert session.robot.command.is_stopped()


@pytest.mark.parametrize("block", range(4))
def test_under_every_schedule_each_goal_ends_exactly_once_and_the_robot_stands(block):
    for seed in range(block * 25, (block + 1) * 25):
        run_schedule(seed)
