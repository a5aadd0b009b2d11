"""A server with trivial plugins and a robot that moves as commanded: what Move Base Flex checks of its simple server.

One expectation goes beyond it: upstream could not get move_base to recover a stuck robot in its own test.
"""

import pytest

from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_status import GoalStatus
from mbf_abstract.goals.goal_types import ExePathGoal, GetPathGoal, MoveBaseGoal, RecoveryGoal, RefinePathGoal
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome, MoveBaseOutcome, RecoveryOutcome, RefinePathOutcome
from mbf_abstract.plugins import RecoveryResult
from mbf_abstract.testing.scripted import ScriptedController, ScriptedPlanner, ScriptedRecovery

TARGET = Pose.planar(-3.2, 0.8)
GOALS = {
    GetPathOutcome.INVALID_PLUGIN: lambda session: GetPathGoal(TARGET),
    ExePathOutcome.INVALID_PLUGIN: lambda session: ExePathGoal(session.path_to(1.0)),
    RecoveryOutcome.INVALID_PLUGIN: lambda session: RecoveryGoal(),
    RefinePathOutcome.INVALID_PLUGIN: lambda session: RefinePathGoal(session.path_to(1.0)),
    MoveBaseOutcome.FAILURE: lambda session: MoveBaseGoal(TARGET),
}


@pytest.mark.parametrize("outcome", GOALS, ids=lambda outcome: type(outcome).__name__)
def test_without_a_plugin_every_action_rejects_and_with_one_it_accepts(make_session, outcome):
    bare, loaded = make_session({"only": ScriptedRecovery}), make_session()
    if outcome is RecoveryOutcome.INVALID_PLUGIN:
        bare = make_session({"only": ScriptedPlanner})
    handle = bare.navigator.send(GOALS[outcome](bare))
    assert (handle.status, handle.result.outcome) == (GoalStatus.REJECTED, outcome)
    assert loaded.navigator.send(GOALS[outcome](loaded)).wait().success


def test_a_path_begins_at_the_start_and_ends_at_the_target(make_session):
    start = Pose.planar(1.0, 2.0, 0.5)
    path = make_session().navigator.get_path(TARGET, start_pose=start).path
    assert (path[0].position, path[-1].position) == (start.position, TARGET.position)


def test_a_path_is_followed_to_within_the_tolerance_in_truth_and_in_the_result(make_session):
    session = make_session()
    result = session.navigator.exe_path(session.path_to(-1.0, 0.5), dist_tolerance=0.05, angle_tolerance=3.2)
    assert result.success
    assert result.dist_to_goal <= 0.05
    assert session.robot.pose.distance_to(Pose.planar(-1.0, 0.5)) <= 0.05


def test_move_base_reaches_its_target(make_session):
    session = make_session()
    assert session.navigator.go_to(TARGET, dist_tolerance=0.05, angle_tolerance=0.1).success
    assert session.robot.pose.distance_to(TARGET) <= 0.05


def test_a_stuck_robot_is_freed_by_a_recovery_and_move_base_arrives(make_session):
    session = make_session(oscillation_timeout=2.0, oscillation_distance=0.2)

    def free(request):
        session.robot.stuck = False
        return RecoveryResult(RecoveryOutcome.SUCCESS, "free")

    session.recovery.play(free)
    handle = session.navigator.send(MoveBaseGoal(TARGET))
    session.clock.sleep(1.0)
    session.robot.stuck = True
    assert handle.wait(60.0).success
    assert len(session.recorded(EventKind.RECOVERY)) == 1
    assert session.robot.pose.distance_to(TARGET) <= 0.1


def test_a_type_loaded_twice_gives_two_instances_each_with_its_name(make_session):
    session = make_session({"a": ScriptedController, "b": ScriptedController, "planner": ScriptedPlanner})
    first, second = (session.plugin(name, ScriptedController) for name in "ab")
    assert first is not second
    assert (first.name, second.name) == ("a", "b")
    assert session.navigator.exe_path(session.path_to(0.5), controller="b").success
    assert (len(first.paths), len(second.paths)) == (0, 1)


def test_ten_goals_one_after_the_other_without_waiting_are_as_safe_as_ten_cancels_of_an_idle_server(make_session):
    session = make_session()
    handles = [session.navigator.send(GetPathGoal(TARGET, concurrency_slot=slot)) for slot in range(10)]
    handles += [session.navigator.send(MoveBaseGoal(TARGET)) for _ in range(10)]
    session.navigator.cancel_all()
    assert all(handle.wait(1.0).message for handle in handles)
    for _ in range(10):
        session.navigator.cancel_all()
    assert session.navigator.get_path(TARGET).success
