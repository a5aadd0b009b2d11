"""Fault table, row 33: servers that are closed while a plugin hangs or a goal runs."""

import asyncio
from itertools import product

import pytest

from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_status import GoalStatus
from mbf_abstract.goals.goal_types import ExePathGoal, GetPathGoal, MoveBaseGoal, RecoveryGoal, RefinePathGoal
from mbf_abstract.testing.faulty import BusyHang, Hang
from mbf_abstract.testing.scripted_session import ScriptedSession
from mbf_abstract.time.clock import WallClock
from mbf_abstract.time.sim_clock import SimClock
from promises import assert_ended_once

GOALS = {
    "planner": lambda session: GetPathGoal(Pose.planar(3.0, 0.0)),
    "controller": lambda session: ExePathGoal(session.path_to(50.0)),
    "recovery": lambda session: RecoveryGoal(),
    "refiner": lambda session: RefinePathGoal(session.path_to(3.0)),
}


def hanging_goal(session, kind):
    hang = Hang(session.clock)
    getattr(session, kind).play(hang)
    handle = session.navigator.send(GOALS[kind](session))
    while not hang.entered:
        session.clock.sleep(0.01)
    return hang, handle


@pytest.mark.parametrize(("kind", "clock"), product(GOALS, [SimClock, WallClock]))
def test_a_goal_whose_plugin_hangs_ends_within_the_grace(kind, clock):
    session = ScriptedSession(
        clock=clock(), cancel_grace=0.2, planner_patience=0.0, controller_patience=0.0, recovery_patience=0.0
    )
    hang, handle = hanging_goal(session, kind)
    waiting = session.navigator.send(GOALS[kind](session))
    session.server.close()
    for each in (handle, waiting):  # F249: a client of actionlib finds such a goal LOST; here every goal ends
        each.wait(5.0)
        assert each.status is GoalStatus.CANCELED
        assert_ended_once(session, each)
    hang.release()
    session.close()


@pytest.mark.parametrize("kind", ["planner", "controller", "recovery"])
def test_a_move_base_goal_whose_plugin_hangs_ends_within_the_grace(kind):
    session = ScriptedSession(cancel_grace=0.2, planner_patience=0.0, controller_patience=0.0, recovery_patience=0.0)
    if kind == "recovery":
        session.controller.play(RuntimeError("no"))
        session.planner.play(RuntimeError("no"))
    hang = Hang(session.clock)
    getattr(session, kind).play(hang)
    handle = session.navigator.send(MoveBaseGoal(Pose.planar(50.0, 0.0)))
    session.clock.sleep(1.0)
    assert hang.entered == 1
    session.server.close()
    handle.wait(1.0)
    assert handle.status is GoalStatus.CANCELED
    hang.release()
    session.close()
    assert set(session.clock.thread_names) == {"main"}


def test_a_plugin_that_keeps_the_processor_busy_does_not_keep_its_goal_either():
    session = ScriptedSession(hang_guard=0.2, cancel_grace=0.2)
    hang = BusyHang()
    session.planner.play(hang)
    handle = session.navigator.send(GetPathGoal(Pose.planar(3.0, 0.0)))
    session.server.close()
    assert handle.wait(5.0).message.startswith("the server is shut down")
    hang.release.cancel()
    session.close()


@pytest.mark.parametrize("clock", [SimClock, WallClock])
def test_a_goal_that_is_awaited_ends_too(clock):
    session = ScriptedSession(clock=clock(), cancel_grace=0.2)
    hang, handle = hanging_goal(session, "controller")

    async def main():
        waiting = asyncio.ensure_future(handle)
        await asyncio.sleep(0.0)
        session.server.close()
        return await asyncio.wait_for(waiting, 20.0)

    assert asyncio.run(main()).message.startswith("the server is shut down")
    hang.release()
    session.close()


def test_closing_from_a_callback_ends_everything():
    with ScriptedSession() as session:
        handle = session.navigator.send(MoveBaseGoal(Pose.planar(50.0, 0.0)))
        handle.add_feedback_callback(lambda feedback: session.server.close())
        handle.wait(5.0)
        assert handle.status is GoalStatus.CANCELED
        assert session.robot.command.is_stopped()


def test_threads_are_gone_soon_after_the_close():
    with ScriptedSession() as session:
        session.navigator.send(MoveBaseGoal(Pose.planar(50.0, 0.0)))
        session.clock.sleep(1.0)
    assert set(session.clock.thread_names) == {"main"}
