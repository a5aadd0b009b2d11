"""Fault table, row 33: servers that are closed while a plugin hangs or a goal runs."""

import asyncio
from itertools import product

import pytest

from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_types import ExePathGoal, GetPathGoal, MoveBaseGoal, RecoveryGoal, RefinePathGoal
from mbf_abstract.goals.handle import GoalStatus
from mbf_abstract.testing.bench import Bench
from mbf_abstract.testing.faulty import BusyHang, Hang
from mbf_abstract.testing.promises import assert_ended_once
from mbf_abstract.time.clock import WallClock
from mbf_abstract.time.sim_clock import SimClock

GOALS = {
    "planner": lambda bench: GetPathGoal(Pose.planar(3.0, 0.0)),
    "controller": lambda bench: ExePathGoal(bench.path_to(50.0)),
    "recovery": lambda bench: RecoveryGoal(),
    "refiner": lambda bench: RefinePathGoal(bench.path_to(3.0)),
}


def hanging_goal(bench, kind):
    hang = Hang(bench.clock)
    getattr(bench, kind).play(hang)
    handle = bench.navigator.send(GOALS[kind](bench))
    while not hang.entered:
        bench.clock.sleep(0.01)
    return hang, handle


@pytest.mark.parametrize(("kind", "clock"), product(GOALS, [SimClock, WallClock]))
def test_a_goal_whose_plugin_hangs_ends_within_the_grace(kind, clock):
    bench = Bench(clock=clock(), cancel_grace=0.2, planner_patience=0.0, controller_patience=0.0, recovery_patience=0.0)
    hang, handle = hanging_goal(bench, kind)
    waiting = bench.navigator.send(GOALS[kind](bench))
    bench.server.close()
    for each in (handle, waiting):
        each.wait(5.0)
        assert each.status is GoalStatus.CANCELED
        assert_ended_once(bench, each)
    hang.release()
    bench.close()


@pytest.mark.parametrize("kind", ["planner", "controller", "recovery"])
def test_a_move_base_goal_whose_plugin_hangs_ends_within_the_grace(kind):
    bench = Bench(cancel_grace=0.2, planner_patience=0.0, controller_patience=0.0, recovery_patience=0.0)
    if kind == "recovery":
        bench.controller.play(RuntimeError("no"))
        bench.planner.play(RuntimeError("no"))
    hang = Hang(bench.clock)
    getattr(bench, kind).play(hang)
    handle = bench.navigator.send(MoveBaseGoal(Pose.planar(50.0, 0.0)))
    bench.clock.sleep(1.0)
    assert hang.entered == 1
    bench.server.close()
    handle.wait(1.0)
    assert handle.status is GoalStatus.CANCELED
    hang.release()
    bench.close()
    assert set(bench.clock.thread_names) == {"main"}


def test_a_plugin_that_keeps_the_processor_busy_does_not_keep_its_goal_either():
    bench = Bench(hang_guard=0.2, cancel_grace=0.2)
    hang = BusyHang()
    bench.planner.play(hang)
    handle = bench.navigator.send(GetPathGoal(Pose.planar(3.0, 0.0)))
    bench.server.close()
    assert handle.wait(5.0).message.startswith("the server is shut down")
    hang.release.cancel()
    bench.close()


@pytest.mark.parametrize("clock", [SimClock, WallClock])
def test_a_goal_that_is_awaited_ends_too(clock):
    bench = Bench(clock=clock(), cancel_grace=0.2)
    hang, handle = hanging_goal(bench, "controller")

    async def main():
        waiting = asyncio.ensure_future(handle)
        await asyncio.sleep(0.0)
        bench.server.close()
        return await asyncio.wait_for(waiting, 20.0)

    assert asyncio.run(main()).message.startswith("the server is shut down")
    hang.release()
    bench.close()


def test_closing_from_a_callback_ends_everything():
    with Bench() as bench:
        handle = bench.navigator.send(MoveBaseGoal(Pose.planar(50.0, 0.0)))
        handle.add_feedback_callback(lambda feedback: bench.server.close())
        handle.wait(5.0)
        assert handle.status is GoalStatus.CANCELED
        assert bench.robot.command.is_stopped()


def test_threads_are_gone_soon_after_the_close():
    with Bench() as bench:
        bench.navigator.send(MoveBaseGoal(Pose.planar(50.0, 0.0)))
        bench.clock.sleep(1.0)
    assert set(bench.clock.thread_names) == {"main"}
