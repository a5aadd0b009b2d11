"""Conditions, steps of one's own, shortened paths, and what they say when the robot's pose is lost."""

import pytest
from py_trees.common import Status
from py_trees.composites import Sequence

from mbf_abstract.executives.conditions import Do, GoalReached, TruncatePath, WouldRecoveryHelp
from mbf_abstract.executives.leaves import ExePath, GetPath
from mbf_abstract.executives.tree_executive import TreeExecutive
from mbf_abstract.geometry import Path, Pose
from mbf_abstract.goals.result_types import ActionResult
from mbf_abstract.outcomes import GetPathOutcome
from terrain.experiments.classic_move_base.settings import ClassicSettings
from terrain.experiments.classic_move_base.state_machine import ClassicMoveBase

GOAL = Pose.planar(2.0, 0.0)


@pytest.fixture
def session(make_session):
    return make_session(tf_timeout=0.5)


def run(session, *nodes, **given):
    return TreeExecutive(Sequence("all", memory=True, children=list(nodes)), session.navigator).run(**given)


def lose_the_pose(session):
    session.robot.publishes_pose = False
    session.clock.sleep(1.0)


def test_a_step_of_ones_own_reads_and_writes_the_mission(session):
    def aim(mission):
        mission.target = GOAL
        return True

    assert run(session, Do("aim", aim), GetPath()).mission.path[-1].distance_to(GOAL) < 1e-6


def test_a_step_that_returns_false_fails(session):
    assert run(session, Do("no", lambda mission: False)).status == Status.FAILURE


@pytest.mark.parametrize(
    ("outcome", "status"),
    [(GetPathOutcome.NO_PATH_FOUND, Status.SUCCESS), (GetPathOutcome.INVALID_GOAL, Status.FAILURE)],
)
def test_the_filter_looks_at_the_last_failure(session, outcome, status):
    def fail(mission):
        mission.failure = ActionResult(int(outcome), "")
        return True

    assert run(session, Do("fail", fail), WouldRecoveryHelp()).status == status


def test_the_robot_stops_before_the_end_of_a_shortened_path(session):
    result = run(session, GetPath(), TruncatePath("keep away", 0.8), ExePath(), target=GOAL)
    assert result.success
    assert session.robot.pose.distance_to(GOAL) == pytest.approx(0.8, abs=0.2)


def test_a_short_path_is_left_as_it_is_and_no_path_is_a_failure(session):
    path = Path.from_points([(0.0, 0.0, 0.0), (0.3, 0.0, 0.0)])
    assert run(session, TruncatePath("keep away", 1.0), path=path).mission.path is path
    assert run(session, TruncatePath("keep away", 1.0)).status == Status.FAILURE


def test_a_lost_pose_is_a_failure_with_a_text(session):
    lose_the_pose(session)
    node = GoalReached()
    assert run(session, node, target=GOAL).status == Status.FAILURE
    assert "no fresh robot pose" in node.feedback_message


def test_the_classic_machine_ends_without_a_pose(session):
    lose_the_pose(session)
    result = ClassicMoveBase(session.navigator, ClassicSettings(max_planning_retries=0)).run(GOAL)
    assert not result.success
    assert result.final_pose is None


@pytest.mark.parametrize(("node", "text"), [(GetPath(), "needs a target"), (ExePath(), "needs a path")])
def test_a_mission_without_what_a_leaf_needs_is_misuse(session, node, text):
    with pytest.raises(ValueError, match=text):
        TreeExecutive(node, session.navigator).run()
