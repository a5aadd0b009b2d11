"""Fault table, row 5: a controller hangs while the robot drives."""

from mbf_abstract.events import EventKind
from mbf_abstract.goals.goal_types import ExePathGoal
from mbf_abstract.goals.handle import GoalStatus
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.testing.bench import Bench
from mbf_abstract.testing.faulty import BusyHang, Hang, drive
from mbf_abstract.testing.promises import assert_ended_once, assert_next_goals_work, assert_stops


def test_the_watchdog_stops_the_robot_and_the_goal_ends_after_patience_and_grace():
    with Bench(controller_patience=2.0, cancel_grace=1.0, command_timeout=0.5) as bench:
        hang = Hang(bench.clock, then=drive(9.0))
        bench.controller.play(drive(), drive(), hang)
        handle = bench.navigator.send(ExePathGoal(bench.path_to(50.0)))
        bench.clock.sleep(0.2)
        assert hang.entered == 1
        assert not bench.robot.command.is_stopped()
        bench.clock.sleep(0.6)
        assert bench.robot.command.is_stopped()  # long before the goal ends
        assert not handle.done
        result = handle.wait()
        assert result.outcome == ExePathOutcome.PAT_EXCEEDED
        assert 3.0 < bench.clock.now() < 3.3
        assert_ended_once(bench, handle)
        assert bench.navigator.send(ExePathGoal(bench.path_to(1.0))).status is GoalStatus.REJECTED
        hang.release()  # the late command must not reach the robot
        bench.clock.sleep(1.0)
        assert hang.left == 1
        assert_stops(bench, 0.2)
        assert_next_goals_work(bench)


def test_a_controller_that_keeps_the_processor_busy_is_found_by_the_wall_clock_guard():
    with Bench(hang_guard=0.2) as bench:
        hang = BusyHang()
        bench.controller.play(drive(), hang)
        handle = bench.navigator.send(ExePathGoal(bench.path_to(50.0)))
        result = handle.wait()
        fault_time = bench.clock.now()
        hang.release.cancel()
        assert (hang.entered, result.outcome) == (1, ExePathOutcome.PAT_EXCEEDED)
        assert len(bench.events(EventKind.QUARANTINE)) == 1
        bench.clock.sleep(2.0)
        assert_stops(bench, fault_time)
        assert_ended_once(bench, handle)
