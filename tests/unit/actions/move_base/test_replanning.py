"""move_base: plans made anew while the robot drives, and what happens where they fail."""

from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Twist
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import PlanResult
from mbf_abstract.testing.faulty import obedient
from mbf_abstract.testing.scripted import straight_plan


def _fails_after_the_first_plan(bench):
    bench.planner.play(straight_plan, bench.no_path)
    return bench.send(3.0)


def test_replanning_swaps_the_path_without_stopping(make_bench):
    bench = make_bench(planner_frequency=2.0)
    assert bench.send(3.0).wait().success
    assert bench.plans > 8
    begin, end = bench.robot.commands[0][0], bench.clock.now() - 1.5
    assert not [1 for stamp, command in bench.robot.commands if begin < stamp < end and command.is_stopped()]
    assert len(bench.events(EventKind.LEASE_GRANTED)) == 1


def test_without_a_frequency_nothing_is_planned_anew(make_bench):
    bench = make_bench(planner_frequency=0.0)
    bench.send().wait()
    assert bench.plans == 1


def test_policy_keep_drives_on_with_the_old_path(make_bench):
    bench = make_bench(retries=0, planner_frequency=2.0, replan_failed_policy="keep")
    assert _fails_after_the_first_plan(bench).wait().success
    assert bench.plans > 5


def test_policy_stop_ends_the_goal_standing(make_bench):
    bench = make_bench(retries=0, planner_frequency=2.0, replan_failed_policy="stop")
    result = _fails_after_the_first_plan(bench).wait()
    assert (result.outcome, result.message) == (GetPathOutcome.NO_PATH_FOUND, "replanning failed: walled in")
    assert bench.robot.command == Twist()
    assert bench.recoveries == []


def test_policy_recover_stops_recovers_and_plans_anew(make_bench):
    bench = make_bench(retries=0, planner_frequency=2.0, replan_failed_policy="recover")
    bench.planner.play(straight_plan, bench.no_path, straight_plan)
    assert bench.send(3.0).wait().success
    assert bench.recoveries == ["first"]


def test_a_replanning_under_way_at_the_goal_is_canceled(make_bench):
    bench = make_bench(planner_frequency=1.0)
    canceled = PlanResult(GetPathOutcome.CANCELED, "as told")
    bench.planner.play(straight_plan, obedient(bench.clock, 4.0, straight_plan, canceled))
    assert bench.send(1.0).wait().success
    bench.clock.sleep(0.1)
    assert not bench.server.get_path.busy
