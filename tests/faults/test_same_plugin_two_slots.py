"""Fault table, row 19: one plugin instance asked for in two slots at once."""

from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_types import ExePathGoal, GetPathGoal
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.testing.bench import SCRIPTED, Bench
from mbf_abstract.testing.promises import assert_ended_once
from mbf_abstract.testing.scripted import ScriptedController, straight_plan


class Overlap:
    """An answer that takes a second and notices if it is asked again meanwhile."""

    def __init__(self, clock):
        self.clock, self.running, self.most = clock, 0, 0

    def __call__(self, request):
        self.running += 1
        self.most = max(self.most, self.running)
        self.clock.sleep(1.0)
        self.running -= 1
        return straight_plan(request)


def test_the_second_goal_waits_for_the_instance():
    with Bench() as bench:
        overlap = Overlap(bench.clock)
        bench.planner.play(overlap)
        handles = [bench.navigator.send(GetPathGoal(Pose.planar(2.0, 0.0), concurrency_slot=i)) for i in range(3)]
        assert all(handle.wait().success for handle in handles)
        assert overlap.most == 1
        assert 3.0 <= bench.clock.now() < 3.5


def test_it_waits_no_longer_than_its_patience():
    with Bench(planner_patience=1.5) as bench:
        bench.planner.play(Overlap(bench.clock))
        handles = [bench.navigator.send(GetPathGoal(Pose.planar(2.0, 0.0), concurrency_slot=i)) for i in range(3)]
        outcomes = [handle.wait().outcome for handle in handles]
        assert outcomes.count(GetPathOutcome.PAT_EXCEEDED) >= 1
        assert outcomes[0] == GetPathOutcome.SUCCESS
        for handle in handles:
            assert_ended_once(bench, handle)


def test_two_controllers_never_drive_the_robot_at_once():
    with Bench({**SCRIPTED, "other": ScriptedController}) as bench:
        first = bench.navigator.send(ExePathGoal(bench.path_to(2.0), "controller", concurrency_slot=0))
        bench.clock.sleep(0.5)
        second = bench.navigator.send(ExePathGoal(bench.path_to(2.0), "other", concurrency_slot=1))
        refused = second.wait()
        assert not refused.success
        assert "driven by exe_path controller" in refused.message
        assert first.wait().success
