"""Goals that are awaited or waited for: what ends the wait, and what becomes of the goal."""

import asyncio
import gc

import pytest

from mbf_abstract.geometry import Pose
from mbf_abstract.goals.awaiting import awaited
from mbf_abstract.goals.goal_status import GoalStatus
from mbf_abstract.goals.goal_types import ExePathGoal, GetPathGoal
from mbf_abstract.testing.scripted_session import ScriptedSession
from mbf_abstract.time.clock import WallClock
from mbf_abstract.time.sim_clock import SimClock

CLOCKS = pytest.mark.parametrize("clock", [SimClock, WallClock])


def drive(session):
    return session.navigator.send(ExePathGoal(session.path_to(500.0)))


@CLOCKS
def test_a_canceled_task_cancels_the_goal_it_awaits_and_the_robot_stands(clock):
    async def main():
        task = asyncio.ensure_future(handle)
        await asyncio.sleep(0.05)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task

    with ScriptedSession(clock=clock(), controller_frequency=50.0) as session:
        handle = drive(session)
        asyncio.run(main())
        result = handle.wait(5.0)
        assert handle.status is GoalStatus.CANCELED
        assert result.message == "the task that awaited the goal was canceled"
        assert session.robot.command.is_stopped()


@CLOCKS
def test_a_task_that_times_out_cancels_the_goal_it_awaits(clock):
    async def main():
        with pytest.raises(asyncio.TimeoutError):
            await asyncio.wait_for(handle, 0.05)

    with ScriptedSession(clock=clock()) as session:
        handle = drive(session)
        asyncio.run(main())
        handle.wait(5.0)
        assert handle.status is GoalStatus.CANCELED
        assert session.robot.command.is_stopped()


def test_a_shielded_goal_goes_on_when_its_waiter_times_out():
    async def main():
        with pytest.raises(asyncio.TimeoutError):
            await asyncio.wait_for(asyncio.shield(waiting := asyncio.ensure_future(handle)), 0.05)
        assert not handle.cancel_requested
        assert not session.robot.command.is_stopped()
        return await waiting

    with ScriptedSession(clock=WallClock()) as session:
        handle = session.navigator.send(ExePathGoal(session.path_to(0.4)))
        assert asyncio.run(main()).success


def test_of_several_goals_awaited_together_all_are_canceled():
    async def main():
        group = asyncio.gather(*handles)
        await asyncio.sleep(0.05)
        group.cancel()
        with pytest.raises(asyncio.CancelledError):
            await group

    with ScriptedSession(clock=WallClock()) as session:
        session.planner.play(lambda request: session.clock.sleep(0.2))
        handles = [drive(session), session.navigator.send(GetPathGoal(Pose.planar(1.0, 0.0)))]
        asyncio.run(main())
        assert all(handle.cancel_requested for handle in handles)
        for handle in handles:
            handle.wait(5.0)


def test_an_event_loop_that_is_closed_first_harms_neither_the_goal_nor_others():
    with ScriptedSession(clock=WallClock()) as session:
        handle = session.navigator.send(ExePathGoal(session.path_to(0.4)))
        loop = asyncio.new_event_loop()
        task = loop.create_task(awaited(handle, session.navigator.server.runtime.clock))
        loop.run_until_complete(asyncio.sleep(0.02))
        loop.close()
        assert handle.wait(10.0).success
        assert session.navigator.get_path(Pose.planar(1.0, 0.0)).success
        task._log_destroy_pending = False  # that the task is never finished is what is tested
        del task
        gc.collect()


@CLOCKS
@pytest.mark.parametrize("timeout", [float("inf"), 1e300, 1e10])
def test_an_endless_timeout_is_none(clock, timeout):
    with ScriptedSession(clock=clock()) as session:
        assert session.navigator.send(GetPathGoal(Pose.planar(1.0, 0.0))).wait(timeout).success


def test_a_timeout_that_is_no_number_is_refused():
    with ScriptedSession() as session:
        with pytest.raises(ValueError, match="not a number"):
            session.navigator.send(GetPathGoal(Pose.planar(1.0, 0.0))).wait(float("nan"))


@pytest.mark.parametrize("timeout", [0.0, -1.0, float("-inf")])
def test_a_timeout_of_nothing_is_over_at_once(timeout):
    with ScriptedSession() as session:
        handle = drive(session)
        with pytest.raises(TimeoutError):
            handle.wait(timeout)
        assert session.clock.now() == 0.0
