"""Fault table, row 9: the robot ignores its commands."""

from mbf_abstract.goals.goal_types import ExePathGoal
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.testing.bench import Bench
from mbf_abstract.testing.promises import assert_ended_once, assert_next_goals_work, assert_stops


def test_a_stuck_robot_ends_the_goal_with_robot_stuck_and_zero():
    with Bench(cmd_vel_ignored_tolerance=2.0) as bench:
        handle = bench.navigator.send(ExePathGoal(bench.path_to(50.0)))
        bench.clock.sleep(2.0)
        bench.robot.stuck = True
        result = handle.wait()
        fault_time = bench.clock.now()
        assert result.outcome == ExePathOutcome.ROBOT_STUCK
        assert 4.0 <= fault_time < 4.3
        assert bench.robot.command.is_stopped()
        bench.clock.sleep(2.0)
        assert_stops(bench, fault_time)
        assert_ended_once(bench, handle)
        bench.robot.stuck = False
        assert_next_goals_work(bench)


def test_a_robot_that_gets_free_in_time_drives_on():
    with Bench(cmd_vel_ignored_tolerance=2.0) as bench:
        handle = bench.navigator.send(ExePathGoal(bench.path_to(2.0)))
        bench.robot.stuck = True
        bench.clock.sleep(1.5)
        assert abs(bench.robot.pose.x) < 1e-9
        bench.robot.stuck = False
        assert handle.wait().success
