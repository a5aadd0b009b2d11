"""Fault table, row 13, the core's half: the map's server says that it must not be driven on."""

from mbf_abstract.goals.goal_types import ExePathGoal
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.testing.bench import Bench
from mbf_abstract.testing.promises import assert_next_goals_work, assert_stops


def test_the_robot_holds_and_the_goal_ends_with_map_error_after_patience():
    with Bench(controller_patience=1.0) as bench:
        handle = bench.navigator.send(ExePathGoal(bench.path_to(50.0)))
        bench.clock.sleep(1.0)
        bench.server.map_trouble = "the lidar has been silent for 1.0 s"
        asked = len(bench.controller.requests)
        result = handle.wait()
        assert len(bench.controller.requests) <= asked + 1
        assert (result.outcome, result.message) == (ExePathOutcome.MAP_ERROR, "the lidar has been silent for 1.0 s")
        assert_stops(bench, 1.0)
        bench.server.map_trouble = ""
        assert_next_goals_work(bench)


def test_the_robot_drives_on_when_the_map_is_current_again():
    with Bench(controller_patience=2.0) as bench:
        handle = bench.navigator.send(ExePathGoal(bench.path_to(2.0)))
        bench.clock.sleep(1.0)
        bench.server.map_trouble = "silent"
        bench.clock.sleep(1.0)
        assert bench.robot.command.is_stopped()
        bench.server.map_trouble = ""
        assert handle.wait().success
