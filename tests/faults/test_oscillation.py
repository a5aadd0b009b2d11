"""Fault table, row 34: a robot that moves without getting anywhere."""

from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.goals.goal_types import ExePathGoal, MoveBaseGoal
from mbf_abstract.outcomes import ExePathOutcome, MoveBaseOutcome
from mbf_abstract.plugins import ControlResult
from mbf_abstract.testing.bench import Bench
from mbf_abstract.testing.promises import assert_ended_once, assert_next_goals_work, assert_stops


def to_and_fro(request):
    """Drive half a second forward, half a second back."""
    forward = int(request.pose.stamp / 0.5) % 2 == 0
    return ControlResult(0, "driving", Twist.planar(0.2 if forward else -0.2))


def test_exe_path_ends_with_oscillation_and_names_distance_and_time():
    with Bench(oscillation_timeout=4.0, oscillation_distance=0.4) as bench:
        bench.controller.play(to_and_fro)
        handle = bench.navigator.send(ExePathGoal(bench.path_to(50.0)))
        result = handle.wait()
        fault_time = bench.clock.now()
        assert len({round(command.vx, 3) for _, command in bench.robot.commands} & {0.2, -0.2}) == 2
        assert result.outcome == ExePathOutcome.OSCILLATION
        assert "0.4 m" in result.message
        assert "4 s" in result.message
        bench.clock.sleep(2.0)
        assert_stops(bench, fault_time)
        assert_ended_once(bench, handle)
        assert_next_goals_work(bench)


def test_move_base_recovers_and_then_gives_up():
    with Bench(oscillation_timeout=3.0) as bench:
        bench.controller.play(to_and_fro)
        handle = bench.navigator.send(MoveBaseGoal(Pose.planar(50.0, 0.0)))
        result = handle.wait(60.0)
        assert len(bench.recovery.requests) == 1
        assert result.outcome == MoveBaseOutcome.OSCILLATION
        assert bench.robot.command.is_stopped()
        assert_ended_once(bench, handle)


def test_a_robot_that_gets_on_does_not_oscillate():
    with Bench(oscillation_timeout=1.5, oscillation_distance=0.5) as bench:
        assert bench.navigator.exe_path(bench.path_to(5.0)).success
