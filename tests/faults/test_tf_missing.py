"""Fault table, row 10: a transform is missing."""

import pytest

from mbf_abstract.geometry import Path, Pose
from mbf_abstract.goals.goal_types import ExePathGoal, GetPathGoal, MoveBaseGoal
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome, MoveBaseOutcome
from mbf_abstract.testing.scripted_session import ScriptedSession
from promises import assert_ended_once, assert_next_goals_work

NOWHERE = Pose.planar(1.0, 0.0, frame_id="nowhere")


@pytest.mark.parametrize(
    ("goal", "outcome"),
    [
        (GetPathGoal(NOWHERE), GetPathOutcome.TF_ERROR),
        (GetPathGoal(Pose.planar(1.0, 0.0), start_pose=NOWHERE), GetPathOutcome.TF_ERROR),
        (ExePathGoal(Path.from_poses([NOWHERE, NOWHERE])), ExePathOutcome.TF_ERROR),
        (MoveBaseGoal(NOWHERE), MoveBaseOutcome.TF_ERROR),
    ],
)
def test_a_goal_in_an_unknown_frame_names_both_frames_and_what_exists(goal, outcome):
    with ScriptedSession() as session:
        handle = session.navigator.send(goal)
        result = handle.wait()
        assert result.outcome == outcome
        assert "from 'nowhere' to 'map'" in result.message
        assert "map->odom" in result.message
        assert not session.robot.moved_after(-1.0)
        assert_ended_once(session, handle)
        assert_next_goals_work(session)


def test_a_robot_without_a_pose_gets_no_plan_and_no_command():
    with ScriptedSession(tf_timeout=0.5, controller_patience=1.0) as session:
        path = session.path_to(3.0)
        session.robot.publishes_pose = False
        session.transforms.clear()
        plan = session.navigator.get_path(Pose.planar(3.0, 0.0))
        assert plan.outcome == GetPathOutcome.TF_ERROR
        assert "'base_link'" in plan.message
        assert "'map'" in plan.message
        assert session.navigator.exe_path(path).outcome == ExePathOutcome.TF_ERROR
        assert not session.robot.moved_after(-1.0)
        assert not session.planner.requests
        session.robot.publishes_pose = True
        session.clock.sleep(0.1)
        assert_next_goals_work(session)
