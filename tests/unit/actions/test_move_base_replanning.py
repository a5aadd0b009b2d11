"""move_base: plans made anew while the robot drives, and what happens where they fail."""

import pytest

from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.goals.goal_types import MoveBaseGoal
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import PlanResult
from mbf_abstract.testing.faulty import obedient
from mbf_abstract.testing.scripted import ScriptedController, ScriptedPlanner, ScriptedRecovery, straight_plan

NO_PATH = PlanResult(GetPathOutcome.NO_PATH_FOUND, "walled in")
PLUGINS = {
    "planner": ScriptedPlanner,
    "controller": ScriptedController,
    "first": ScriptedRecovery,
    "second": ScriptedRecovery,
    "third": ScriptedRecovery,
}
ONCE = {"planner_max_retries": 0, "controller_max_retries": 0}


@pytest.fixture
def make_bench(make_bench):
    return lambda **parameters: make_bench(PLUGINS, **parameters)


def send(bench, x=2.0, y=0.0, **fields):
    return bench.navigator.send(MoveBaseGoal(Pose.planar(x, y), **fields))


def recoveries(bench):
    return [event.data["plugin"] for event in bench.events(EventKind.RECOVERY)]


def plans(bench):
    return len(bench.planner.requests)


def _fails_after_the_first_plan(bench):
    bench.planner.play(straight_plan, NO_PATH)
    return send(bench, 3.0)


def test_replanning_swaps_the_path_without_stopping(make_bench):
    bench = make_bench(planner_frequency=2.0)
    assert send(bench, 3.0).wait().success
    assert plans(bench) > 8
    begin, end = bench.robot.commands[0][0], bench.clock.now() - 1.5
    assert not [1 for stamp, command in bench.robot.commands if begin < stamp < end and command.is_stopped()]
    assert len(bench.events(EventKind.LEASE_GRANTED)) == 1


def test_without_a_frequency_nothing_is_planned_anew(make_bench):
    bench = make_bench(planner_frequency=0.0)
    send(bench).wait()
    assert plans(bench) == 1


def test_policy_keep_drives_on_with_the_old_path(make_bench):
    bench = make_bench(planner_frequency=2.0, replan_failed_policy="keep", **ONCE)
    assert _fails_after_the_first_plan(bench).wait().success
    assert plans(bench) > 5


def test_policy_stop_ends_the_goal_standing(make_bench):
    bench = make_bench(planner_frequency=2.0, replan_failed_policy="stop", **ONCE)
    result = _fails_after_the_first_plan(bench).wait()
    assert (result.outcome, result.message) == (GetPathOutcome.NO_PATH_FOUND, "replanning failed: walled in")
    assert bench.robot.command == Twist()
    assert recoveries(bench) == []


def test_policy_recover_stops_recovers_and_plans_anew(make_bench):
    bench = make_bench(planner_frequency=2.0, replan_failed_policy="recover", **ONCE)
    bench.planner.play(straight_plan, NO_PATH, straight_plan)
    assert send(bench, 3.0).wait().success
    assert recoveries(bench) == ["first"]


def test_a_replanning_under_way_at_the_goal_is_canceled(make_bench):
    bench = make_bench(planner_frequency=1.0)
    canceled = PlanResult(GetPathOutcome.CANCELED, "as told")
    bench.planner.play(straight_plan, obedient(bench.clock, 4.0, straight_plan, canceled))
    assert send(bench, 1.0).wait().success
    bench.clock.sleep(0.1)
    assert not bench.server.get_path.busy
