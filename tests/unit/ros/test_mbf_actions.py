"""Goals, results and feedback of mbf_msgs pass through JSON unchanged; what means nothing is refused."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mbf_abstract.geometry import AckermannCommand, Path, Pose, Twist
from mbf_abstract.goals.feedback_types import ExePathFeedback
from mbf_abstract.goals.goal_types import ExePathGoal, GetPathGoal, MoveBaseGoal, RecoveryGoal
from mbf_abstract.goals.result_types import ExePathResult, GetPathResult, MoveBaseResult, RecoveryResultMessage
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome
from mbf_ros.messages import mbf_actions as mbf
from mbf_ros.messages.action_mapping import RefusedGoal
from mbf_ros.messages.geometry import MessageContext, path_message, path_of, pose_of, pose_stamped, twist_of
from mbf_ros.messages.interfaces import completed, fields_of
from mbf_ros.messages.json_text import json_text

CONTEXT = MessageContext("map", epoch=1_700_000_000.0)

coordinates = st.floats(-1e6, 1e6)
vectors = st.tuples(coordinates, coordinates, coordinates)
frames = st.sampled_from(["map", "odom", "lidar/front"])
stamps = st.integers(0, 10**6).map(lambda n: n / 64.0)  # exact beside the epoch in a float
names = st.text(st.characters(exclude_categories=["Cs"]), max_size=8)
slots = st.integers(0, 255)
tolerances = st.floats(0.0, 10.0)
costs = st.floats(0.0, 1e9)
distances = st.floats(0.0, 1e9) | st.just(float("inf"))
outcomes = st.integers(0, 249)
texts = st.text(st.characters(exclude_categories=["Cs"]), min_size=1, max_size=20)


@st.composite
def quaternions(draw):
    q = np.array(draw(st.tuples(*[st.floats(-1.0, 1.0)] * 4)))
    length = float(np.sqrt((q * q).sum()))
    return tuple((q / length).tolist()) if length > 0.1 else (0.0, 0.0, 0.0, 1.0)


poses = st.builds(Pose, vectors, quaternions(), frames, stamps)
unstamped_poses = st.builds(Pose, vectors, quaternions(), frames)
twists = st.builds(Twist, vectors, vectors)


@st.composite
def paths(draw, min_size=0):
    frame, stamp = draw(frames), draw(stamps)
    parts = draw(st.lists(st.tuples(vectors, quaternions()), min_size=min_size, max_size=4))
    positions = np.array([p for p, _ in parts]).reshape(-1, 3)
    return Path(positions, np.array([q for _, q in parts]).reshape(-1, 4), frame, stamp)


def same_path(a, b):
    if a is None or b is None:
        return a is b
    same = np.array_equal(a.positions, b.positions) and np.array_equal(a.orientations, b.orientations)
    return same and (a.frame_id, a.stamp) == (b.frame_id, b.stamp)


def through_json(message, type_name):
    """What the other side of a rosbridge gets; the message has exactly the fields of its type."""
    assert list(message) and set(message) == {field.name for field in fields_of(type_name)}
    return completed(type_name, json.loads(json_text(message)))


@given(
    st.builds(
        GetPathGoal,
        target_pose=unstamped_poses,
        start_pose=st.none() | unstamped_poses,
        planner=names,
        dist_tolerance=tolerances,
        concurrency_slot=slots,
    )
)
def test_a_get_path_goal_is_what_its_client_asked_for(goal):
    sent = {
        "use_start_pose": goal.start_pose is not None,
        "start_pose": pose_stamped(goal.start_pose, CONTEXT),
        "target_pose": pose_stamped(goal.target_pose, CONTEXT),
        "tolerance": goal.dist_tolerance,
        "planner": goal.planner,
        "concurrency_slot": goal.concurrency_slot,
    }
    assert mbf.get_path_goal_of(through_json(sent, "mbf_msgs/action/GetPath_Goal"), CONTEXT) == goal


@given(paths(), names, st.none() | st.tuples(tolerances, tolerances), slots)
def test_an_exe_path_goal_is_what_its_client_asked_for(path, controller, tolerances, slot):
    sent = {
        "path": path_message(path, CONTEXT),
        "controller": controller,
        "concurrency_slot": slot,
        "tolerance_from_action": tolerances is not None,
        "dist_tolerance": tolerances[0] if tolerances else 0.0,
        "angle_tolerance": tolerances[1] if tolerances else 0.0,
    }
    goal = mbf.exe_path_goal_of(through_json(sent, "mbf_msgs/action/ExePath_Goal"), CONTEXT)
    assert same_path(goal.path, path)
    asked = ExePathGoal(path, controller, *(tolerances or (None, None)), concurrency_slot=slot)
    assert replace(goal, path=path) == asked


@given(st.builds(RecoveryGoal, names, slots))
def test_a_recovery_goal_is_what_its_client_asked_for(goal):
    sent = {"behavior": goal.behavior, "concurrency_slot": goal.concurrency_slot}
    assert mbf.recovery_goal_of(through_json(sent, "mbf_msgs/action/Recovery_Goal"), CONTEXT) == goal


@given(
    st.builds(
        MoveBaseGoal,
        target_pose=unstamped_poses,
        planner=names,
        controller=names,
        recovery_behaviors=st.none() | st.lists(names, min_size=1, max_size=3).map(tuple),
    )
)
def test_a_move_base_goal_is_what_its_client_asked_for(goal):
    sent = {
        "target_pose": pose_stamped(goal.target_pose, CONTEXT),
        "controller": goal.controller,
        "planner": goal.planner,
        "recovery_behaviors": list(goal.recovery_behaviors or ()),
    }
    assert mbf.move_base_goal_of(through_json(sent, "mbf_msgs/action/MoveBase_Goal"), CONTEXT) == goal


@given(outcomes, texts, st.none() | paths(min_size=1), costs)
def test_a_client_gets_outcome_path_and_cost_of_a_plan(outcome, text, path, cost):
    result = GetPathResult(outcome, text, path, cost)
    got = through_json(mbf.get_path_result(result, CONTEXT), "mbf_msgs/action/GetPath_Result")
    assert same_path(path_of(got["path"], CONTEXT) if got["path"]["poses"] else None, path)
    assert (got["outcome"], got["message"], got["cost"]) == (outcome, text, cost)


def optional_pose(message):
    return pose_of(message, CONTEXT) if message["header"]["frame_id"] else None


def as_in_json(number):
    """JSON has no infinity: a client gets null for it, read as NaN."""
    return pytest.approx(math.nan if math.isinf(number) else number, rel=0.0, abs=0.0, nan_ok=True)


@pytest.mark.parametrize(("kind", "name"), [(ExePathResult, "ExePath"), (MoveBaseResult, "MoveBase")])
@given(outcome=outcomes, text=texts, pose=st.none() | poses, dist=distances, angle=distances)
def test_a_client_gets_the_end_of_a_drive(kind, name, outcome, text, pose, dist, angle):
    message = mbf.driving_result(kind(outcome, text, pose, dist, angle), CONTEXT)
    got = through_json(message, f"mbf_msgs/action/{name}_Result")
    assert (got["outcome"], got["message"], optional_pose(got["final_pose"])) == (outcome, text, pose)
    assert (got["dist_to_goal"], got["angle_to_goal"]) == (as_in_json(dist), as_in_json(angle))


@given(st.builds(RecoveryResultMessage, outcomes, texts, names))
def test_a_client_gets_the_result_of_a_recovery(result):
    got = through_json(mbf.recovery_result(result, CONTEXT), "mbf_msgs/action/Recovery_Result")
    assert RecoveryResultMessage(got["outcome"], got["message"], got["used_plugin"]) == result


@pytest.mark.parametrize("name", ["ExePath", "MoveBase"])
@given(outcome=outcomes, text=texts, pose=poses, dist=distances, angle=distances, command=twists)
def test_a_client_gets_feedback(name, outcome, text, pose, dist, angle, command):
    feedback = ExePathFeedback(outcome, text, pose, dist, angle, 3.0, 4.0, command)
    got = through_json(mbf.driving_feedback(feedback, CONTEXT), f"mbf_msgs/action/{name}_Feedback")
    assert (got["outcome"], got["message"], pose_of(got["current_pose"], CONTEXT)) == (outcome, text, pose)
    assert (got["dist_to_goal"], got["angle_to_goal"]) == (as_in_json(dist), as_in_json(angle))
    assert twist_of(got["last_cmd_vel"]["twist"]) == command


def test_the_command_of_a_car_is_its_speed_and_steering_angle():
    feedback = ExePathFeedback(0, "", Pose.planar(0, 0), 1.0, 0.0, 1.0, 1.0, AckermannCommand(1.5, -0.25))
    twist = mbf.driving_feedback(feedback, CONTEXT)["last_cmd_vel"]["twist"]
    assert (twist["linear"]["x"], twist["angular"]["z"]) == (1.5, -0.25)


def stamped(position=None, orientation=None, frame="map"):
    pose = {"position": {"x": 1.0, "y": 2.0, **(position or {})}}
    return {"header": {"frame_id": frame}, "pose": pose | ({"orientation": orientation} if orientation else {})}


NOTHING = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 0.0}


@pytest.mark.parametrize(
    ("mapping", "goal", "outcome", "text"),
    [
        (
            mbf.MOVE_BASE,
            {"target_pose": stamped(orientation=NOTHING)},
            GetPathOutcome.INVALID_GOAL,
            "not a rotation",
        ),
        (mbf.MOVE_BASE, {"target_pose": stamped({"x": None})}, GetPathOutcome.INVALID_GOAL, "must be finite"),
        (mbf.MOVE_BASE, {"target_pose": stamped({"x": math.inf})}, GetPathOutcome.INVALID_GOAL, "must be finite"),
        (mbf.GET_PATH, {"target_pose": stamped(orientation=NOTHING)}, GetPathOutcome.INVALID_GOAL, "target_pose"),
        (
            mbf.GET_PATH,
            {"target_pose": stamped(), "use_start_pose": True, "start_pose": stamped(orientation={"z": 1.0, "w": 1.0})},
            GetPathOutcome.INVALID_START,
            "start_pose: orientation must have unit length",
        ),
        (
            mbf.EXE_PATH,
            {"path": {"poses": [stamped(), stamped(orientation=NOTHING)]}},
            ExePathOutcome.INVALID_PATH,
            r"poses\[1\]: the quaternion \(0, 0, 0, 0\)",
        ),
        (mbf.EXE_PATH, {"path": {"poses": [stamped({"y": None})]}}, ExePathOutcome.INVALID_PATH, "must be finite"),
        (
            mbf.EXE_PATH,
            {"path": {"poses": [stamped(), stamped(frame="odom")]}},
            ExePathOutcome.INVALID_PATH,
            "must share one frame",
        ),
        (
            mbf.EXE_PATH,
            {"path": {"header": {"frame_id": "map"}, "poses": [stamped(frame="odom")]}},
            ExePathOutcome.INVALID_PATH,
            "the path is in 'map', but its poses are in 'odom'",
        ),
    ],
)
def test_a_goal_that_means_nothing_is_refused_with_its_outcome_and_a_text(mapping, goal, outcome, text):
    with pytest.raises(RefusedGoal, match=text) as refused:
        mapping.goal(goal, CONTEXT)
    assert refused.value.outcome == outcome


def test_a_frame_loses_its_leading_slash_and_no_frame_is_the_global_one():
    slash = mbf.MOVE_BASE.goal({"target_pose": stamped(frame="/odom")}, CONTEXT)
    none = mbf.MOVE_BASE.goal({"target_pose": stamped(frame="")}, replace(CONTEXT, global_frame="world"))
    assert (slash.target_pose.frame_id, none.target_pose.frame_id) == ("odom", "world")


def test_an_unused_start_pose_is_not_looked_at():
    goal = mbf.GET_PATH.goal({"target_pose": stamped(), "start_pose": stamped(orientation=NOTHING)}, CONTEXT)
    assert goal.start_pose is None


def test_a_path_without_poses_is_a_path_without_poses():
    goal = mbf.EXE_PATH.goal({"path": {"header": {"frame_id": "/odom"}, "poses": []}}, CONTEXT)
    assert len(goal.path) == 0 and goal.path.frame_id == "odom"
