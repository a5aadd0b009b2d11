"""Fault table, row 19: one plugin instance asked for in two slots at once."""

from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_types import ExePathGoal, GetPathGoal
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.testing.scripted import ScriptedController, straight_plan
from mbf_abstract.testing.scripted_session import SCRIPTED, ScriptedSession
from promises import assert_ended_once


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
    with ScriptedSession() as session:
        overlap = Overlap(session.clock)
        session.planner.play(overlap)
        handles = [session.navigator.send(GetPathGoal(Pose.planar(2.0, 0.0), concurrency_slot=i)) for i in range(3)]
        assert all(handle.wait().success for handle in handles)
        assert overlap.most == 1
        assert 3.0 <= session.clock.now() < 3.5


def test_it_waits_no_longer_than_its_patience():
    with ScriptedSession(planner_patience=1.5) as session:
        session.planner.play(Overlap(session.clock))
        handles = [session.navigator.send(GetPathGoal(Pose.planar(2.0, 0.0), concurrency_slot=i)) for i in range(3)]
        outcomes = [handle.wait().outcome for handle in handles]
        assert outcomes.count(GetPathOutcome.PAT_EXCEEDED) >= 1
        assert outcomes[0] == GetPathOutcome.SUCCESS
        for handle in handles:
            assert_ended_once(session, handle)


def test_two_controllers_never_drive_the_robot_at_once():
    with ScriptedSession({**SCRIPTED, "other": ScriptedController}) as session:
        first = session.navigator.send(ExePathGoal(session.path_to(2.0), "controller", concurrency_slot=0))
        session.clock.sleep(0.5)
        second = session.navigator.send(ExePathGoal(session.path_to(2.0), "other", concurrency_slot=1))
        refused = second.wait()
        assert not refused.success
        assert "driven by exe_path controller" in refused.message
        assert first.wait().success
