"""move_base: cancel and pause in every state."""

import pytest

from mbf_abstract.geometry import Twist
from mbf_abstract.goals.handle import GoalStatus
from mbf_abstract.outcomes import GetPathOutcome, RecoveryOutcome
from mbf_abstract.outcomes import MoveBaseOutcome as Outcome
from mbf_abstract.plugins import PlanResult, RecoveryResult
from mbf_abstract.testing.faulty import obedient
from mbf_abstract.testing.scripted import ScriptedRecovery, straight_plan


def _planning(bench):
    canceled = PlanResult(GetPathOutcome.CANCELED, "as told")
    bench.planner.play(obedient(bench.clock, 4.0, straight_plan, canceled))


def _following(bench):
    pass


def _recovering(bench):
    bench.planner.play(bench.no_path)
    bench.plugin("first", ScriptedRecovery).play(
        lambda request: RecoveryResult(0 if request.motion.sleep(9.0) else RecoveryOutcome.CANCELED, "")
    )


@pytest.mark.parametrize("begin", [_planning, _following, _recovering])
def test_a_cancel_ends_the_goal_and_its_parts_in_every_state(make_bench, begin):
    bench = make_bench(retries=0)
    begin(bench)
    handle = bench.send(5.0)
    bench.clock.sleep(1.0)
    handle.cancel("enough")
    result = handle.wait()
    assert (handle.status, result.outcome, result.message) == (GoalStatus.CANCELED, Outcome.CANCELED, "enough")
    assert bench.clock.now() < 1.1
    assert bench.robot.command == Twist()
    server = bench.server
    bench.clock.sleep(0.1)
    assert not any(action.busy for action in (server.get_path, server.exe_path, server.recovery, server.move_base))


def test_a_cancel_in_the_instant_the_plan_is_there_is_not_lost(make_bench):
    bench = make_bench()
    handle = bench.send(5.0)

    def plan_and_cancel(request):
        handle.cancel()
        return straight_plan(request)

    bench.planner.play(plan_and_cancel)
    assert handle.wait().outcome == Outcome.CANCELED
    bench.clock.sleep(1.0)
    assert not bench.robot.moved_after(-1.0)


@pytest.mark.parametrize("begin", [_planning, _following, _recovering])
def test_a_pause_holds_the_robot_in_every_state_and_the_goal_goes_on_after_it(make_bench, begin):
    bench = make_bench(retries=0, oscillation_timeout=5.0)
    begin(bench)
    handle = bench.send(2.0)
    bench.clock.sleep(1.0)
    handle.pause()
    bench.clock.sleep(0.1)
    where = bench.robot.pose.x
    bench.clock.sleep(30.0)
    assert handle.status is GoalStatus.PAUSED
    assert bench.robot.pose.x == where
    bench.planner.play(straight_plan)
    handle.resume()
    assert handle.wait().success
