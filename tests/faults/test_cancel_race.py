"""Fault table, row 15: cancels at every awkward moment, and interleavings enumerated by seeded schedules."""

import numpy as np
import pytest

from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_types import ExePathGoal, GetPathGoal, MoveBaseGoal, RecoveryGoal
from mbf_abstract.goals.handle import GoalStatus
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome, MoveBaseOutcome, RecoveryOutcome
from mbf_abstract.plugins import PlanResult, RecoveryResult
from mbf_abstract.testing.bench import Bench
from mbf_abstract.testing.faulty import obedient, slow
from mbf_abstract.testing.promises import assert_ended_once, assert_next_goals_work
from mbf_abstract.testing.scripted import straight_plan
from mbf_abstract.time.sim_clock import SimClock

GOAL = Pose.planar(3.0, 0.0)


def test_a_cancel_before_the_start_is_honoured():
    with Bench() as bench:
        bench.planner.play(slow(bench.clock, 1.0, straight_plan))
        running = bench.navigator.send(GetPathGoal(GOAL))
        waiting = bench.navigator.send(GetPathGoal(GOAL, concurrency_slot=1))  # same plugin: waits for it
        waiting.cancel()
        assert waiting.wait().outcome == GetPathOutcome.CANCELED
        assert running.wait().success
        assert len(bench.planner.requests) == 1
        assert_ended_once(bench, waiting)


def test_a_second_cancel_and_one_after_the_end_change_nothing():
    with Bench() as bench:
        bench.planner.play(obedient(bench.clock, 5.0, straight_plan, PlanResult(GetPathOutcome.CANCELED, "")))
        handle = bench.navigator.send(GetPathGoal(GOAL))
        bench.clock.sleep(0.5)
        handle.cancel("first")
        handle.cancel("second")
        result = handle.wait()
        handle.cancel("third")
        bench.clock.sleep(0.1)
        assert (handle.status, handle.result) == (GoalStatus.CANCELED, result)
        assert result.message == "first"
        assert_ended_once(bench, handle)
        done = bench.navigator.send(GetPathGoal(GOAL, concurrency_slot=2))
        bench.planner.play(straight_plan)
        assert done.wait().success
        done.cancel()
        assert done.status is GoalStatus.SUCCEEDED


def test_a_cancel_from_a_feedback_callback_works():
    with Bench() as bench:
        handle = bench.navigator.send(ExePathGoal(bench.path_to(50.0)))
        handle.add_feedback_callback(lambda feedback: handle.cancel("from a callback"))
        result = handle.wait()
        assert (result.outcome, result.message) == (ExePathOutcome.CANCELED, "from a callback")
        assert bench.robot.command.is_stopped()
        assert_ended_once(bench, handle)


@pytest.mark.parametrize("moment", ["plan", "drive", "recovery"])
def test_a_move_base_goal_can_be_canceled_in_each_of_its_phases(moment):
    with Bench(planner_max_retries=0) as bench:
        if moment == "plan":
            bench.planner.play(obedient(bench.clock, 50.0, straight_plan, PlanResult(GetPathOutcome.CANCELED, "")))
        if moment == "recovery":
            bench.planner.play(PlanResult(GetPathOutcome.NO_PATH_FOUND, "walled in"))
            canceled = RecoveryResult(RecoveryOutcome.CANCELED, "")
            bench.recovery.play(obedient(bench.clock, 50.0, RecoveryResult(0, ""), canceled))
        handle = bench.navigator.send(MoveBaseGoal(Pose.planar(50.0, 0.0)))
        bench.clock.sleep(2.0)
        assert bool(bench.recovery.requests) == (moment == "recovery")
        assert bool(bench.controller.requests) == (moment == "drive")
        handle.cancel()
        assert handle.wait(2.0).outcome == MoveBaseOutcome.CANCELED
        assert bench.robot.command.is_stopped()
        assert_ended_once(bench, handle)
        assert_next_goals_work(bench)


ACTIONS = (
    lambda bench: GetPathGoal(GOAL),
    lambda bench: ExePathGoal(bench.path_to(0.3)),
    lambda bench: RecoveryGoal(),
    lambda bench: MoveBaseGoal(Pose.planar(0.4, 0.0)),
)


def run_schedule(seed):
    """Send, preempt, pause, resume and cancel goals of all actions at random instants and interleavings."""
    rng = np.random.default_rng(seed)
    with Bench(clock=SimClock(schedule=rng), planner_patience=2.0, controller_patience=2.0) as bench:
        bench.planner.play(slow(bench.clock, 0.02, straight_plan), straight_plan)
        handles = []
        for _ in range(rng.integers(2, 7)):
            step = rng.integers(6) if handles else 0
            if step <= 1:
                handles.append(bench.navigator.send(ACTIONS[rng.integers(len(ACTIONS))](bench)))
            elif step == 2:
                handles[rng.integers(len(handles))].cancel()
            elif step == 3:
                handles[rng.integers(len(handles))].pause()
            elif step == 4:
                handles[rng.integers(len(handles))].resume()
            else:
                bench.clock.sleep(float(rng.choice([0.0, 0.01, 0.05, 0.3])))
        for handle in handles:
            handle.resume()
        for handle in handles:
            handle.wait(30.0)
        for handle in handles:
            assert_ended_once(bench, handle)
        bench.clock.sleep(1.0)
        assert bench.robot.command.is_stopped()


@pytest.mark.parametrize("block", range(4))
def test_under_every_schedule_each_goal_ends_exactly_once_and_the_robot_stands(block):
    for seed in range(block * 25, (block + 1) * 25):
        run_schedule(seed)
