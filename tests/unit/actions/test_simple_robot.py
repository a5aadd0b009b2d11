"""A server with trivial plugins and a robot that does as it is told: what Move Base Flex checks of its simple server.

One expectation goes beyond it: upstream could not get move_base to recover a stuck robot in its own test.
"""

import pytest

from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_types import ExePathGoal, GetPathGoal, MoveBaseGoal, RecoveryGoal, RefinePathGoal
from mbf_abstract.goals.handle import GoalStatus
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome, MoveBaseOutcome, RecoveryOutcome, RefinePathOutcome
from mbf_abstract.plugins import RecoveryResult
from mbf_abstract.testing.scripted import ScriptedController, ScriptedPlanner, ScriptedRecovery

TARGET = Pose.planar(-3.2, 0.8)
GOALS = {
    GetPathOutcome.INVALID_PLUGIN: lambda bench: GetPathGoal(TARGET),
    ExePathOutcome.INVALID_PLUGIN: lambda bench: ExePathGoal(bench.path_to(1.0)),
    RecoveryOutcome.INVALID_PLUGIN: lambda bench: RecoveryGoal(),
    RefinePathOutcome.FAILURE: lambda bench: RefinePathGoal(bench.path_to(1.0)),
    MoveBaseOutcome.FAILURE: lambda bench: MoveBaseGoal(TARGET),
}


@pytest.mark.parametrize("outcome", GOALS, ids=lambda outcome: type(outcome).__name__)
def test_without_a_plugin_every_action_rejects_and_with_one_it_accepts(make_bench, outcome):
    bare, loaded = make_bench({"only": ScriptedRecovery}), make_bench()
    if outcome is RecoveryOutcome.INVALID_PLUGIN:
        bare = make_bench({"only": ScriptedPlanner})
    handle = bare.navigator.send(GOALS[outcome](bare))
    assert (handle.status, handle.result.outcome) == (GoalStatus.REJECTED, outcome)
    assert loaded.navigator.send(GOALS[outcome](loaded)).wait().success


def test_a_path_begins_at_the_start_and_ends_at_the_target(make_bench):
    start = Pose.planar(1.0, 2.0, 0.5)
    path = make_bench().navigator.get_path(TARGET, start_pose=start).path
    assert (path[0].position, path[-1].position) == (start.position, TARGET.position)


def test_a_path_is_followed_to_within_the_tolerance_in_truth_and_in_the_result(make_bench):
    bench = make_bench()
    result = bench.navigator.exe_path(bench.path_to(-1.0, 0.5), dist_tolerance=0.05, angle_tolerance=3.2)
    assert result.success
    assert result.dist_to_goal <= 0.05
    assert bench.robot.pose.distance_to(Pose.planar(-1.0, 0.5)) <= 0.05


def test_move_base_reaches_its_target(make_bench):
    bench = make_bench()
    assert bench.navigator.go_to(TARGET, dist_tolerance=0.05, angle_tolerance=0.1).success
    assert bench.robot.pose.distance_to(TARGET) <= 0.05


def test_a_stuck_robot_is_freed_by_a_recovery_and_move_base_arrives(make_bench):
    bench = make_bench(oscillation_timeout=2.0, oscillation_distance=0.2)

    def free(request):
        bench.robot.stuck = False
        return RecoveryResult(RecoveryOutcome.SUCCESS, "free")

    bench.recovery.play(free)
    handle = bench.navigator.send(MoveBaseGoal(TARGET))
    bench.clock.sleep(1.0)
    bench.robot.stuck = True
    assert handle.wait(60.0).success
    assert len(bench.events(EventKind.RECOVERY)) == 1
    assert bench.robot.pose.distance_to(TARGET) <= 0.1


def test_a_type_loaded_twice_gives_two_instances_each_with_its_name(make_bench):
    bench = make_bench({"a": ScriptedController, "b": ScriptedController, "planner": ScriptedPlanner})
    first, second = (bench.plugin(name, ScriptedController) for name in "ab")
    assert first is not second
    assert (first.name, second.name) == ("a", "b")
    assert bench.navigator.exe_path(bench.path_to(0.5), controller="b").success
    assert (len(first.paths), len(second.paths)) == (0, 1)


def test_ten_goals_one_after_the_other_without_waiting_are_as_safe_as_ten_cancels_of_an_idle_server(make_bench):
    bench = make_bench()
    handles = [bench.navigator.send(GetPathGoal(TARGET, concurrency_slot=slot)) for slot in range(10)]
    handles += [bench.navigator.send(MoveBaseGoal(TARGET)) for _ in range(10)]
    bench.navigator.cancel_all()
    assert all(handle.wait(1.0).message for handle in handles)
    for _ in range(10):
        bench.navigator.cancel_all()
    assert bench.navigator.get_path(TARGET).success
