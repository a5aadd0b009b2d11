"""Fault table, rows 2 and 5: calls that hang, are given up, and come back after all; cancels that hang."""

import threading

import pytest

from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_types import ExePathGoal, GetPathGoal
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import PlanResult
from mbf_abstract.testing.faulty import BusyHang, Hang, drive, obedient
from mbf_abstract.testing.scripted import ScriptedPlanner, straight_plan
from mbf_abstract.testing.scripted_session import SCRIPTED, ScriptedSession
from mbf_abstract.time.clock import WallClock
from mbf_abstract.time.sim_clock import SimClock
from promises import assert_next_goals_work

GOAL = GetPathGoal(Pose.planar(3.0, 0.0))


def wait_until_nothing_hangs(session):
    """Let the late threads, which are on the real processor's time, come back."""
    while session.server.runtime.hanging:
        session.clock.sleep(0.01)


def test_plugins_that_the_wall_clock_guard_gave_up_are_back_after_their_calls_return():
    with ScriptedSession(hang_guard=0.1, max_quarantined=2) as session:
        for _ in range(3):  # more than max_quarantined
            hang = BusyHang()
            session.planner.play(hang)
            assert session.navigator.send(GOAL).wait().outcome == GetPathOutcome.PAT_EXCEEDED
            hang.release.cancel()
            wait_until_nothing_hangs(session)
            hang = BusyHang()
            session.controller.play(drive(), hang)
            assert not session.navigator.send(ExePathGoal(session.path_to(50.0))).wait().success
            hang.release.cancel()
            wait_until_nothing_hangs(session)
            assert_next_goals_work(session)


class DeafPlanner(ScriptedPlanner):
    """Obeys its token; its ``cancel`` hangs until ``release``."""

    def __init__(self, context):
        super().__init__(context)
        self.released, self.entered = threading.Event(), 0

    def cancel(self):
        self.entered += 1
        self.released.wait()
        return True


def test_a_cancel_that_hangs_costs_one_thread_however_many_goals_are_canceled():
    with ScriptedSession({**SCRIPTED, "planner": DeafPlanner}, clock=WallClock(), planner_patience=0.0) as session:
        canceled = PlanResult(GetPathOutcome.CANCELED, "canceled")
        session.planner.play(obedient(session.clock, 60.0, straight_plan, canceled))
        threads = []
        for _ in range(20):
            handle = session.navigator.send(GOAL)
            while not session.planner.requests:
                session.clock.sleep(0.001)
            session.planner.requests.clear()
            handle.cancel()
            assert handle.wait(5.0).outcome == GetPathOutcome.CANCELED
            threads.append(threading.active_count())
        assert max(threads) - min(threads) <= 1
        assert session.planner.entered == 1
        session.planner.released.set()
        assert_next_goals_work(session)


@pytest.mark.parametrize("still_runs", [True, False])
def test_a_cancel_that_comes_back_late_is_made_up_for_only_while_its_goal_still_runs(still_runs):
    class SlowToCancel(ScriptedPlanner):
        calls = 0

        def cancel(self):
            type(self).calls += 1
            if self.calls == 1:
                self.clock.sleep(3.0)
            return True

    with ScriptedSession(
        {**SCRIPTED, "planner": SlowToCancel}, clock=SimClock(), planner_patience=0.0, cancel_grace=9.0
    ) as session:
        ignored = Hang(session.clock, then=straight_plan)
        session.planner.play(obedient(session.clock, 60.0, straight_plan, straight_plan), ignored, straight_plan)
        for _ in range(2):
            handle = session.navigator.send(GOAL)
            session.clock.sleep(0.5)
            handle.cancel()
            session.clock.sleep(0.5)
        if not still_runs:
            ignored.release()
        session.clock.sleep(5.0)
        assert SlowToCancel.calls == (2 if still_runs else 1)
        ignored.release()
