"""Fault table, row 12: the localisation jumps (map -> odom)."""

from dataclasses import replace

from mbf_abstract.goals.goal_types import ExePathGoal
from mbf_abstract.testing.bench import Bench
from mbf_abstract.testing.promises import assert_ended_once


def jump(bench, x, y):
    """Let the localisation notice that the robot stands somewhere else than it thought."""
    bench.robot.T_map_odom = replace(bench.robot.T_map_odom, translation=(x, y, 0.0))


def test_after_a_jump_the_path_is_followed_from_the_new_pose():
    with Bench(oscillation_timeout=5.0) as bench:
        handle = bench.navigator.send(ExePathGoal(bench.path_to(4.0)))
        bench.clock.sleep(2.0)
        before = bench.robot.pose
        jump(bench, 0.0, 0.6)
        assert bench.robot.pose.distance_to(before) > 0.59  # the fault happened
        result = handle.wait()
        assert result.success
        assert result.final_pose.distance_to(bench.path_to(4.0)[-1]) < 0.11
        assert_ended_once(bench, handle)


def test_a_jump_away_from_the_goal_is_no_arrival_and_one_onto_it_is():
    with Bench() as bench:
        handle = bench.navigator.send(ExePathGoal(bench.path_to(4.0)))
        bench.clock.sleep(7.0)
        jump(bench, -1.0, 0.0)
        bench.clock.sleep(1.0)
        assert not handle.done
        jump(bench, 4.0 - (bench.robot.pose.x + 1.0), 0.0)
        assert handle.wait().success
