"""Fault table, row 4: a controller raises while the robot drives."""

import pytest

from mbf_abstract.goals.goal_types import ExePathGoal
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.testing.bench import Bench
from mbf_abstract.testing.faulty import drive
from mbf_abstract.testing.promises import assert_ended_once, assert_next_goals_work, assert_stops


def test_a_raising_controller_stops_the_robot_and_ends_the_goal():
    with Bench() as bench:
        bench.controller.play(*[drive()] * 20, RuntimeError("boom"))
        handle = bench.navigator.send(ExePathGoal(bench.path_to(50.0)))
        result = handle.wait()
        fault_time = bench.clock.now()
        assert len(bench.controller.requests) == 21
        assert len(bench.robot.moved_after(-1.0)) == 20  # it drove before
        assert result.outcome == ExePathOutcome.INTERNAL_ERROR
        assert "'controller' raised RuntimeError in compute_velocity_commands: boom" in result.message
        assert bench.robot.command.is_stopped()  # at once, not by the watchdog
        bench.clock.sleep(3.0)
        assert_stops(bench, fault_time)
        assert_ended_once(bench, handle)
        assert_next_goals_work(bench)


@pytest.mark.parametrize("method", ["set_plan", "is_goal_reached", "cancel"])
def test_every_other_method_may_raise_too(method, monkeypatch):
    def boom(self, *arguments):
        raise RuntimeError(f"boom in {method}")

    with Bench() as bench:
        monkeypatch.setattr(type(bench.controller), method, boom)
        handle = bench.navigator.send(ExePathGoal(bench.path_to(50.0)))
        bench.clock.sleep(1.0)
        handle.cancel()
        result = handle.wait()
        fault_time = bench.clock.now()
        expected = {ExePathOutcome.INTERNAL_ERROR, ExePathOutcome.CANCELED}
        assert result.outcome in expected if method == "cancel" else result.outcome == ExePathOutcome.INTERNAL_ERROR
        bench.clock.sleep(2.0)
        assert_stops(bench, fault_time)
        monkeypatch.undo()
        assert_next_goals_work(bench)
