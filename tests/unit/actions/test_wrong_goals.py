"""A goal with something else where a pose or a path belongs is refused where it is made, with what was expected."""

import pytest

from mbf_abstract.geometry import Path, Pose
from mbf_abstract.goals.goal_types import (
    ExePathGoal,
    FollowWaypointsGoal,
    GetPathGoal,
    MoveBaseGoal,
    RefinePathGoal,
)

HERE = Pose.planar(0.0, 0.0)
PATH = Path.from_poses([HERE, Pose.planar(1.0, 0.0)])


@pytest.mark.parametrize(
    ("make", "field"),
    [
        (lambda wrong: MoveBaseGoal(wrong), "target_pose"),
        (lambda wrong: GetPathGoal(wrong), "target_pose"),
        (lambda wrong: GetPathGoal(HERE, start_pose=wrong), "start_pose"),
        (lambda wrong: MoveBaseGoal(HERE, via=(HERE, wrong)), r"via\[1\]"),
        (lambda wrong: FollowWaypointsGoal((HERE, wrong)), r"waypoints\[1\]"),
    ],
)
@pytest.mark.parametrize("wrong", [(1.0, 2.0, 0.5), [1.0, 2.0], "kitchen", PATH])
def test_what_is_no_pose_is_named_with_its_field_and_what_was_expected(make, field, wrong):
    with pytest.raises(TypeError, match=rf"^{field} must be a Pose, such as .*, got {type(wrong).__name__}$"):
        make(wrong)


@pytest.mark.parametrize("make", [ExePathGoal, RefinePathGoal])
@pytest.mark.parametrize("wrong", [[HERE], None, HERE])
def test_what_is_no_path_is_refused_with_what_was_expected(make, wrong):
    with pytest.raises(TypeError, match=rf"^path must be a Path, such as .*, got {type(wrong).__name__}$"):
        make(wrong)
