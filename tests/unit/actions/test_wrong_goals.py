"""A goal with a field of the wrong type is refused where it is made, with what was expected."""

import pytest

from mbf_abstract.geometry import Path, Pose
from mbf_abstract.goals.goal_types import (
    ExePathGoal,
    FollowWaypointsGoal,
    GetPathGoal,
    MoveBaseGoal,
    RecoveryGoal,
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
        (lambda wrong: GetPathGoal(HERE, via=[wrong]), r"via\[0\]"),
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


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (
            lambda: MoveBaseGoal(HERE, recovery_behaviors="rotate"),
            "recovery_behaviors must be a sequence of names, got str",
        ),
        (
            lambda: MoveBaseGoal(HERE, recovery_behaviors=(1,)),
            "recovery_behaviors[0] must be the name of a plugin, got int",
        ),
        (lambda: MoveBaseGoal(HERE, via=HERE), "via must be a sequence of poses, got Pose"),
        (lambda: FollowWaypointsGoal(HERE), "waypoints must be a sequence of poses, got Pose"),
        (lambda: FollowWaypointsGoal((HERE,), loops="2"), "loops must be a whole number, got str"),
        (lambda: MoveBaseGoal(HERE, dist_tolerance="0.2"), "dist_tolerance must be a number, got str"),
        (lambda: ExePathGoal(PATH, angle_tolerance=(0.1,)), "angle_tolerance must be a number, got tuple"),
        (lambda: ExePathGoal(PATH, goal_area=[(0, 0), (1, 1)]), "goal_area must be a GoalArea, got list"),
        (lambda: GetPathGoal(HERE, planner=None), "planner must be the name of a plugin, got NoneType"),
        (lambda: GetPathGoal(HERE, concurrency_slot=1.5), "concurrency_slot must be a whole number, got float"),
        (lambda: RecoveryGoal("rotate", parameters=[1]), "parameters must be a mapping of names to values, got list"),
    ],
)
def test_every_field_of_a_wrong_type_is_named(make, text):
    with pytest.raises(TypeError) as error:
        make()
    assert str(error.value) == text


def test_sequences_become_tuples():
    assert GetPathGoal(HERE, via=[HERE]).via == (HERE,)
    assert MoveBaseGoal(HERE, recovery_behaviors=["rotate"]).recovery_behaviors == ("rotate",)
