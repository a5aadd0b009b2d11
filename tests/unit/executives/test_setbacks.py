"""A newer path that leads the robot back counts as a setback where it replaces one that is driven, and only there."""

from dataclasses import replace

import pytest
from py_trees.composites import Sequence

from mbf_abstract.executives.conditions import Do
from mbf_abstract.executives.detours import UpdatePath
from mbf_abstract.executives.leaves import GetPath
from mbf_abstract.executives.tree_executive import TreeExecutive
from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_types import ExePathGoal
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.testing.faulty import drive
from mbf_abstract.testing.scripted import straight_plan


def longer(session):
    """Let each plan be 2 m longer than the one before: there and back, then on to the goal."""

    def answer(request):
        behind = Pose.planar(1.0 - len(session.planner.requests), 0.0)
        return straight_plan(replace(request, via=(behind,)))

    session.planner.play(answer)


@pytest.fixture
def updated(make_session):
    """``updated(*before)``: the failure and the length of the path after four longer plans, and these nodes before."""

    def run(*before):
        session, seen = make_session(), []

        def look(mission):
            seen.append((mission.failure, mission.path.length))
            return True

        longer(session)
        session.controller.play(drive(0.0))
        updates = [UpdatePath(f"update {number}") for number in range(4)]
        nodes = [GetPath(), *before, *updates, Do("look", look)]
        tree = Sequence("updates", memory=True, children=nodes)
        assert TreeExecutive(tree, session.navigator).run(Pose.planar(2.0, 0.0)).success
        return seen[0]

    return run


def set_off(mission):
    mission.send(ExePathGoal(mission.path_to_follow()))
    return True


def test_the_third_longer_path_beside_a_drive_is_a_failure_of_that(updated):
    failure, length = updated(Do("set off", set_off))
    assert failure.outcome == ExePathOutcome.BLOCKED_PATH
    assert length == pytest.approx(6.0, abs=0.1), "of the second update; later ones are not taken"


def test_where_nothing_drives_a_longer_path_is_no_setback(updated):
    """As after giving way, where the next path begins somewhere else."""
    failure, length = updated()
    assert failure is None
    assert length == pytest.approx(10.0, abs=0.1)
