"""Goals of Nav2's clients of three distributions, our results with Nav2's error codes."""

from functools import partial

import pytest

from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.goals.feedback_types import ExePathFeedback, FollowWaypointsFeedback, MoveBaseFeedback
from mbf_abstract.goals.goal_types import MoveBaseGoal
from mbf_abstract.goals.result_types import (
    ExePathResult,
    FollowWaypointsResult,
    GetPathResult,
    MoveBaseResult,
    RefinePathResult,
)
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome, MoveBaseOutcome, RecoveryOutcome, RefinePathOutcome
from mbf_ros.messages.action_mapping import RefusedGoal
from mbf_ros.messages.geometry import MessageContext
from mbf_ros.messages.interfaces import MessageError, completed, fields_of
from mbf_ros.messages.nav2 import actions as nav2
from mbf_ros.messages.nav2 import codes, waypoints

CONTEXT = MessageContext()
PATH = Path([[0, 0, 0], [1, 0, 0]])


def at(x, y=0.0):
    return {"header": {"frame_id": "map"}, "pose": {"position": {"x": x, "y": y}}}


LISTS = pytest.mark.parametrize(
    "goals", [[at(1), at(2), at(3)], {"goals": [at(1), at(2), at(3)]}], ids=["jazzy", "kilted"]
)


@LISTS
def test_a_way_through_poses_leads_to_the_last_one_by_way_of_the_others(goals):
    goal = waypoints.NAVIGATE_THROUGH_POSES.goal({"poses": goals}, CONTEXT)
    assert ([pose.x for pose in goal.via], goal.target_pose.x) == ([1, 2], 3)


def test_a_way_through_no_poses_is_refused():
    with pytest.raises(RefusedGoal, match="expected at least one pose, got none"):
        waypoints.NAVIGATE_THROUGH_POSES.goal({"poses": []}, CONTEXT)


def test_goals_of_jazzy_lack_fields_that_came_later():
    path = completed("nav_msgs/Path", {"poses": [at(1)]})
    assert len(nav2.FOLLOW_PATH.goal_of({"path": path, "controller_id": "", "goal_checker_id": ""}, CONTEXT).path) == 1
    poses = path["poses"]
    assert waypoints.FOLLOW_WAYPOINTS.goal_of({"poses": poses}, CONTEXT).visits == 1
    assert len(waypoints.NAVIGATE_THROUGH_POSES.goal_of({"poses": poses}, CONTEXT).via) == 0


@LISTS
def test_a_path_through_poses_is_asked_for_by_clients_of_jazzy_and_kilted_alike(goals):
    goal = nav2.COMPUTE_PATH_THROUGH_POSES.goal({"goals": goals, "planner_id": "astar"}, CONTEXT)
    assert [pose.x for pose in (*goal.via, goal.target_pose)] == [1, 2, 3]
    assert (goal.planner, goal.start_pose) == ("astar", None)


def test_the_start_of_a_plan_counts_only_if_it_is_asked_for():
    values = {"goal": at(3), "start": at(1)}
    assert nav2.COMPUTE_PATH_TO_POSE.goal(values, CONTEXT).start_pose is None
    assert nav2.COMPUTE_PATH_TO_POSE.goal({**values, "use_start": True}, CONTEXT).start_pose.x == 1


def test_nav2_counts_the_loops_after_the_first():
    goal = waypoints.FOLLOW_WAYPOINTS.goal({"poses": [at(1), at(2)], "number_of_loops": 2}, CONTEXT)
    assert (goal.loops, goal.visits, goal.stop_on_failure) == (3, 6, False)
    later = waypoints.FOLLOW_WAYPOINTS.goal({"poses": [at(1), at(2)], "goal_index": 1}, CONTEXT)
    assert [pose.x for pose in later.waypoints] == [2]


@pytest.mark.parametrize(
    ("mapping", "values", "text"),
    [
        (nav2.NAVIGATE_TO_POSE, {"pose": at(1), "behavior_tree": "mine.xml"}, "behavior_tree 'mine.xml'"),
        (nav2.FOLLOW_PATH, {"path": {"poses": [at(1)]}, "goal_checker_id": "strict"}, "goal_checker_id 'strict'"),
        (
            waypoints.FOLLOW_WAYPOINTS,
            {"poses": [at(1)], "goal_index": 1, "number_of_loops": 1},
            "goal_index 1 together",
        ),
        (nav2.COMPUTE_PATH_TO_POSE, {"goal": at(1), "viapoints": []}, "has no field 'viapoints'"),
    ],
)
def test_what_cannot_be_respected_is_refused_and_not_ignored(mapping, values, text):
    with pytest.raises(MessageError, match=text):
        mapping.goal(values, CONTEXT)


@pytest.mark.parametrize(
    ("mapping", "values", "text"),
    [
        (nav2.COMPUTE_PATH_THROUGH_POSES, {"goals": []}, "goals: expected at least one pose, got none"),
        (waypoints.FOLLOW_WAYPOINTS, {"poses": []}, "poses: expected at least one pose, got none"),
        (
            waypoints.FOLLOW_WAYPOINTS,
            {"poses": [at(1)], "goal_index": 1},
            r"goal_index: expected one below .* \(1\), got 1",
        ),
        (nav2.NAVIGATE_TO_POSE, {"pose": at(float("nan"))}, "nan"),
        (waypoints.FOLLOW_WAYPOINTS, {"poses": [at(1), at(float("inf"))]}, "inf"),
    ],
)
def test_a_goal_without_a_place_is_an_invalid_goal(mapping, values, text):
    with pytest.raises(RefusedGoal, match=text) as refused:
        mapping.goal(values, CONTEXT)
    assert refused.value.outcome == GetPathOutcome.INVALID_GOAL


REFUSALS = [
    (nav2.COMPUTE_PATH_THROUGH_POSES, {"goals": []}, "NO_VIAPOINTS_GIVEN"),
    (nav2.NAVIGATE_TO_POSE, {"pose": at(1), "behavior_tree": "t.xml"}, "FAILED_TO_LOAD_BEHAVIOR_TREE"),
    (waypoints.NAVIGATE_THROUGH_POSES, {"poses": [at(1)], "behavior_tree": "t"}, "FAILED_TO_LOAD_BEHAVIOR_TREE"),
    (waypoints.FOLLOW_WAYPOINTS, {"poses": []}, "NO_VALID_WAYPOINTS"),
    (waypoints.FOLLOW_WAYPOINTS, {"poses": [at(1), at(float("nan"))]}, "NO_VALID_WAYPOINTS"),
    (nav2.SMOOTH_PATH, {"path": {"poses": []}}, "INVALID_PATH"),
    (nav2.SMOOTH_PATH, {"path": {"poses": [at(float("nan"))]}}, "INVALID_PATH"),
    (nav2.FOLLOW_PATH, {"path": {"poses": [at(float("nan"))]}}, "INVALID_PATH"),
]
CODES = {
    nav2.COMPUTE_PATH_THROUGH_POSES: codes.ThroughPosesCode,
    nav2.NAVIGATE_TO_POSE: codes.NavigateCode,
    waypoints.NAVIGATE_THROUGH_POSES: codes.NavigateThroughPosesCode,
    waypoints.FOLLOW_WAYPOINTS: codes.WaypointsCode,
    nav2.SMOOTH_PATH: codes.SmoothingCode,
    nav2.FOLLOW_PATH: codes.FollowPathCode,
}


@pytest.mark.parametrize(("mapping", "values", "name"), REFUSALS)
def test_a_refused_goal_ends_with_the_code_of_its_cause(mapping, values, name):
    with pytest.raises(RefusedGoal) as refused:
        mapping.goal(values, CONTEXT)
    message = mapping.refusal(refused.value, CONTEXT)
    assert CODES[mapping](completed(f"{mapping.type}_Result", message)["error_code"]).name == name
    assert str(refused.value) in message["error_msg"]


RESULTS = [
    (nav2.COMPUTE_PATH_TO_POSE, GetPathResult(0, "", PATH), 0),
    (nav2.COMPUTE_PATH_TO_POSE, GetPathResult(GetPathOutcome.NO_PATH_FOUND, "blocked"), 208),
    (nav2.COMPUTE_PATH_TO_POSE, GetPathResult(75, "a planner's own"), 200),
    (nav2.COMPUTE_PATH_THROUGH_POSES, GetPathResult(GetPathOutcome.PAT_EXCEEDED, "late"), 307),
    (nav2.FOLLOW_PATH, ExePathResult(ExePathOutcome.ROBOT_STUCK, "stuck"), 105),
    (nav2.NAVIGATE_TO_POSE, MoveBaseResult(GetPathOutcome.BLOCKED_GOAL, "occupied"), 206),
    (nav2.NAVIGATE_TO_POSE, MoveBaseResult(MoveBaseOutcome.TF_ERROR, "no pose"), 9002),
    (nav2.NAVIGATE_TO_POSE, MoveBaseResult(MoveBaseOutcome.FAILURE, "no such planner"), 9000),
    (waypoints.FOLLOW_WAYPOINTS, FollowWaypointsResult(GetPathOutcome.NO_PATH_FOUND, "missed one"), 600),
    (waypoints.NAVIGATE_THROUGH_POSES, MoveBaseResult(0, ""), 0),
    (waypoints.NAVIGATE_THROUGH_POSES, MoveBaseResult(GetPathOutcome.BLOCKED_GOAL, "occupied"), 306),
    (waypoints.NAVIGATE_THROUGH_POSES, MoveBaseResult(MoveBaseOutcome.TF_ERROR, "no pose"), 9102),
    (waypoints.NAVIGATE_THROUGH_POSES, MoveBaseResult(ExePathOutcome.ROBOT_STUCK, "stuck"), 105),
    (nav2.SMOOTH_PATH, RefinePathResult(0, "", PATH), 0),
    (nav2.SMOOTH_PATH, RefinePathResult(RefinePathOutcome.INVALID_PLUGIN, "no such refiner", PATH), 501),
    (nav2.SMOOTH_PATH, RefinePathResult(RefinePathOutcome.STOPPED, "late", PATH), 502),
    (nav2.SMOOTH_PATH, RefinePathResult(RefinePathOutcome.DEPLETED, "tried often", PATH), 504),
    (nav2.SMOOTH_PATH, RefinePathResult(RefinePathOutcome.FAILURE, "too bent", PATH), 504),
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
    (status,) = waypoints.FOLLOW_WAYPOINTS.result(result, CONTEXT)["missed_waypoints"]
    assert (status["waypoint_index"], status["error_code"], status["error_msg"]) == (1, 208, "NO_PATH_FOUND: blocked")
    assert status["waypoint_status"] == codes.WaypointState.FAILED


def test_waypoints_are_numbered_as_in_the_list_of_the_client():
    goal = waypoints.FOLLOW_WAYPOINTS.goal({"poses": [at(1), at(2), at(3)], "goal_index": 1}, CONTEXT)
    reached, missed = MoveBaseResult(0, ""), MoveBaseResult(GetPathOutcome.NO_PATH_FOUND, "blocked")
    result = FollowWaypointsResult(missed.outcome, "one missed", (reached, missed))
    seen = waypoints.waypoints_of_client(goal, 1, FollowWaypointsFeedback(1, 1, (), None), CONTEXT)
    assert seen == {"current_waypoint": 2}
    (status,) = waypoints.waypoints_of_client(goal, 1, result, CONTEXT)["missed_waypoints"]
    assert (status["waypoint_index"], status["index"]) == (2, 2)
    assert status["waypoint_pose"]["pose"]["position"]["x"] == status["goal"]["pose"]["position"]["x"] == 3.0


def test_a_waypoint_that_is_missed_in_every_loop_is_the_same_one():
    goal = waypoints.FOLLOW_WAYPOINTS.goal({"poses": [at(1), at(2)], "number_of_loops": 1}, CONTEXT)
    reached, missed = MoveBaseResult(0, ""), MoveBaseResult(GetPathOutcome.NO_PATH_FOUND, "blocked")
    result = FollowWaypointsResult(missed.outcome, "two missed", (reached, missed, reached, missed))
    seen = waypoints.waypoints_of_client(goal, 0, result, CONTEXT)["missed_waypoints"]
    assert [one["waypoint_index"] for one in seen] == [1, 1]


def test_feedback_has_the_fields_of_its_type():
    driving = ExePathFeedback(0, "", Pose.planar(1, 2), 3.0, 0.1, 4.0, float("inf"), Twist.planar(0.5))
    for mapping, feedback in (
        (nav2.NAVIGATE_TO_POSE, driving),
        (nav2.FOLLOW_PATH, driving),
        (waypoints.FOLLOW_WAYPOINTS, FollowWaypointsFeedback(4, 1, (), driving)),
        (waypoints.NAVIGATE_THROUGH_POSES, MoveBaseFeedback(**vars(driving), via_left=1)),
    ):
        message = mapping.feedback(feedback, CONTEXT)
        completed(f"{mapping.type}_Feedback", message)
        assert set(message) == {field.name for field in fields_of(f"{mapping.type}_Feedback")}
    assert nav2.NAVIGATE_TO_POSE.feedback(driving, CONTEXT)["estimated_time_remaining"] == {"sec": 0, "nanosec": 0}
    assert nav2.FOLLOW_PATH.feedback(driving, CONTEXT) == {"distance_to_goal": 4.0, "speed": 0.5}


def on_the_way(via_left):
    return MoveBaseFeedback(0, "", Pose.planar(0, 0), 3.0, 0.1, 5.0, 4.0, via_left=via_left)


def test_progress_through_poses_is_that_of_the_whole_way():
    message = waypoints.NAVIGATE_THROUGH_POSES.feedback(on_the_way(via_left=2), CONTEXT)
    assert (message["number_of_poses_remaining"], message["distance_remaining"]) == (3, 5.0)
    assert message["estimated_time_remaining"] == {"sec": 4, "nanosec": 0}


FAILED = MoveBaseResult(GetPathOutcome.NO_PATH_FOUND, "blocked")


@pytest.mark.parametrize(
    ("feedback", "result", "states"),
    [
        (None, None, [0, 0, 0]),
        (on_the_way(via_left=1), None, [1, 0, 0]),
        (on_the_way(via_left=1), FAILED, [1, 3, 0]),
        (on_the_way(via_left=0), FAILED, [1, 1, 3]),
        (None, FAILED, [3, 0, 0]),
        (on_the_way(via_left=0), MoveBaseResult(0, ""), [1, 1, 1]),
        (None, MoveBaseResult(0, ""), [1, 1, 1]),
    ],
)
def test_each_pose_has_a_status_whether_it_was_passed_missed_or_is_still_to_come(feedback, result, states):
    goal = MoveBaseGoal(Pose.planar(3, 0), via=(Pose.planar(1, 0), Pose.planar(2, 0)))
    statuses = waypoints.waypoint_statuses(goal, feedback, result, CONTEXT)
    for status in statuses:
        assert completed("nav2_msgs/WaypointStatus", status) == status
    assert [one["waypoint_status"] for one in statuses] == states
    assert [one["waypoint_pose"]["pose"]["position"]["x"] for one in statuses] == [1, 2, 3]
    for status, state in zip(statuses, states, strict=True):
        wanted = (308, "NO_PATH_FOUND: blocked") if state == codes.WaypointState.FAILED else (0, "")
        assert (status["error_code"], status["error_msg"]) == wanted


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
        (codes.navigating_through_poses_code, GetPathOutcome, [*range(300, 310), 9100]),
        (codes.navigating_through_poses_code, ExePathOutcome, [*range(100, 108), 9100]),
        (codes.navigating_through_poses_code, MoveBaseOutcome, [*range(100, 108), *range(300, 310), 9100, 9102]),
        (partial(codes.behavior_code, codes.SpinCode), RecoveryOutcome, range(700, 704)),
        (partial(codes.behavior_code, codes.BackUpCode), RecoveryOutcome, range(710, 715)),
        (partial(codes.behavior_code, codes.DriveOnHeadingCode), RecoveryOutcome, range(720, 725)),
        (partial(codes.behavior_code, codes.WaitCode), RecoveryOutcome, range(740, 742)),
        (codes.navigating_code, ExePathOutcome, [*range(100, 108), 9000]),
    ],
)
def test_every_outcome_has_a_code_in_the_range_of_its_action_and_only_success_is_0(code_of, outcomes, allowed):
    assert all(code_of(outcome) in allowed for outcome in outcomes if outcome != 0)
    assert all(code_of(outcome) == 0 for outcome in range(10))
