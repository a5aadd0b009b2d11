"""Goals of Nav2's clients of three distributions, our results with Nav2's error codes."""

import pytest

from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.goals.goal_types import (
    ExePathFeedback,
    ExePathResult,
    FollowWaypointsFeedback,
    FollowWaypointsResult,
    GetPathResult,
    MoveBaseResult,
    RefinePathResult,
)
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome, MoveBaseOutcome, RefinePathOutcome
from mbf_ros.messages import nav2_actions as nav2
from mbf_ros.messages import nav2_codes as codes
from mbf_ros.messages.action_mapping import RefusedGoal
from mbf_ros.messages.geometry import MessageContext
from mbf_ros.messages.interfaces import MessageError, completed, fields_of

CONTEXT = MessageContext()
PATH = Path([[0, 0, 0], [1, 0, 0]])


def at(x, y=0.0):
    return {"header": {"frame_id": "map"}, "pose": {"position": {"x": x, "y": y}}}


@pytest.mark.parametrize("goals", [[at(1), at(2), at(3)], {"goals": [at(1), at(2), at(3)]}], ids=["jazzy", "kilted"])
def test_a_path_through_poses_is_asked_for_by_clients_of_jazzy_and_kilted_alike(goals):
    goal = nav2.COMPUTE_PATH_THROUGH_POSES.goal({"goals": goals, "planner_id": "astar"}, CONTEXT)
    assert [pose.x for pose in (*goal.via, goal.target_pose)] == [1, 2, 3]
    assert (goal.planner, goal.start_pose) == ("astar", None)


def test_the_start_of_a_plan_counts_only_if_it_is_asked_for():
    values = {"goal": at(3), "start": at(1)}
    assert nav2.COMPUTE_PATH_TO_POSE.goal(values, CONTEXT).start_pose is None
    assert nav2.COMPUTE_PATH_TO_POSE.goal({**values, "use_start": True}, CONTEXT).start_pose.x == 1


def test_nav2_counts_the_loops_after_the_first():
    goal = nav2.FOLLOW_WAYPOINTS.goal({"poses": [at(1), at(2)], "number_of_loops": 2}, CONTEXT)
    assert (goal.loops, goal.visits, goal.stop_on_failure) == (3, 6, False)
    later = nav2.FOLLOW_WAYPOINTS.goal({"poses": [at(1), at(2)], "goal_index": 1}, CONTEXT)
    assert [pose.x for pose in later.waypoints] == [2]


@pytest.mark.parametrize(
    ("mapping", "values", "text"),
    [
        (nav2.NAVIGATE_TO_POSE, {"pose": at(1), "behavior_tree": "mine.xml"}, "behavior_tree 'mine.xml'"),
        (nav2.FOLLOW_PATH, {"path": {"poses": [at(1)]}, "goal_checker_id": "strict"}, "goal_checker_id 'strict'"),
        (nav2.FOLLOW_WAYPOINTS, {"poses": [at(1)], "goal_index": 1, "number_of_loops": 1}, "goal_index 1 together"),
        (nav2.COMPUTE_PATH_TO_POSE, {"goal": at(1), "viapoints": []}, "has no field 'viapoints'"),
    ],
)
def test_what_cannot_be_respected_is_refused_and_not_ignored(mapping, values, text):
    with pytest.raises(MessageError, match=text):
        mapping.goal(values, CONTEXT)


@pytest.mark.parametrize(
    ("mapping", "values"),
    [
        (nav2.COMPUTE_PATH_THROUGH_POSES, {"goals": []}),
        (nav2.FOLLOW_WAYPOINTS, {"poses": [at(1)], "goal_index": 1}),
        (nav2.NAVIGATE_TO_POSE, {"pose": at(float("nan"))}),
        (nav2.FOLLOW_WAYPOINTS, {"poses": [at(1), at(float("inf"))]}),
    ],
)
def test_a_goal_without_a_place_is_an_invalid_goal(mapping, values):
    with pytest.raises(RefusedGoal) as refused:
        mapping.goal(values, CONTEXT)
    assert refused.value.outcome == GetPathOutcome.INVALID_GOAL


RESULTS = [
    (nav2.COMPUTE_PATH_TO_POSE, GetPathResult(0, "", PATH), 0),
    (nav2.COMPUTE_PATH_TO_POSE, GetPathResult(GetPathOutcome.NO_PATH_FOUND, "blocked"), 208),
    (nav2.COMPUTE_PATH_TO_POSE, GetPathResult(75, "a planner's own"), 200),
    (nav2.COMPUTE_PATH_THROUGH_POSES, GetPathResult(GetPathOutcome.PAT_EXCEEDED, "late"), 307),
    (nav2.FOLLOW_PATH, ExePathResult(ExePathOutcome.ROBOT_STUCK, "stuck"), 105),
    (nav2.NAVIGATE_TO_POSE, MoveBaseResult(GetPathOutcome.BLOCKED_GOAL, "occupied"), 206),
    (nav2.NAVIGATE_TO_POSE, MoveBaseResult(MoveBaseOutcome.TF_ERROR, "no pose"), 9002),
    (nav2.NAVIGATE_TO_POSE, MoveBaseResult(MoveBaseOutcome.FAILURE, "no such planner"), 9000),
    (nav2.FOLLOW_WAYPOINTS, FollowWaypointsResult(GetPathOutcome.NO_PATH_FOUND, "missed one"), 600),
    (nav2.SMOOTH_PATH, RefinePathResult(0, "", PATH), 0),
    (nav2.SMOOTH_PATH, RefinePathResult(RefinePathOutcome.DEPLETED, "late", PATH), 502),
]


@pytest.mark.parametrize(("mapping", "result", "code"), RESULTS)
def test_a_result_has_the_fields_of_its_type_and_the_error_code_of_nav2(mapping, result, code):
    message = mapping.result(result, CONTEXT)
    kind = f"{mapping.type}_Result"
    assert set(message) == {field.name for field in fields_of(kind)}
    assert completed(kind, message)["error_code"] == code
    assert (message["error_msg"] == "") == result.success


def test_missed_waypoints_are_listed_with_their_error():
    reached, missed = MoveBaseResult(0, ""), MoveBaseResult(GetPathOutcome.NO_PATH_FOUND, "blocked")
    result = FollowWaypointsResult(missed.outcome, "one missed", (reached, missed, reached))
    (status,) = nav2.FOLLOW_WAYPOINTS.result(result, CONTEXT)["missed_waypoints"]
    assert (status["waypoint_index"], status["error_code"], status["error_msg"]) == (1, 208, "NO_PATH_FOUND: blocked")


def test_feedback_has_the_fields_of_its_type():
    driving = ExePathFeedback(0, "", Pose.planar(1, 2), 3.0, 0.1, 4.0, float("inf"), Twist.planar(0.5))
    for mapping, feedback in (
        (nav2.NAVIGATE_TO_POSE, driving),
        (nav2.FOLLOW_PATH, driving),
        (nav2.FOLLOW_WAYPOINTS, FollowWaypointsFeedback(4, 1, (), driving)),
    ):
        message = mapping.feedback(feedback, CONTEXT)
        completed(f"{mapping.type}_Feedback", message)
        assert set(message) == {field.name for field in fields_of(f"{mapping.type}_Feedback")}
    assert nav2.NAVIGATE_TO_POSE.feedback(driving, CONTEXT)["estimated_time_remaining"] == {"sec": 0, "nanosec": 0}
    assert nav2.FOLLOW_PATH.feedback(driving, CONTEXT) == {"distance_to_goal": 4.0, "speed": 0.5}


@pytest.mark.parametrize(
    ("code_of", "outcomes", "allowed"),
    [
        (codes.planning_code, GetPathOutcome, range(200, 209)),
        (codes.through_poses_code, GetPathOutcome, range(300, 310)),
        (codes.following_code, ExePathOutcome, range(100, 108)),
        (codes.smoothing_code, RefinePathOutcome, range(500, 506)),
        (codes.waypoints_code, MoveBaseOutcome, range(600, 604)),
        (codes.navigating_code, MoveBaseOutcome, [*range(100, 108), *range(200, 209), *range(9000, 9004)]),
        (codes.navigating_code, GetPathOutcome, [*range(200, 209), 9000]),
        (codes.navigating_code, ExePathOutcome, [*range(100, 108), 9000]),
    ],
)
def test_every_outcome_has_a_code_in_the_range_of_its_action_and_only_success_is_0(code_of, outcomes, allowed):
    assert all(code_of(outcome) in allowed for outcome in outcomes if outcome != 0)
    assert all(code_of(outcome) == 0 for outcome in range(10))
