"""The questions of mbf_msgs reach the map with the fields of their requests; checked on a real map of cells."""

import pytest

from mbf_abstract.maps.queries import CellState, PathAnswer, PlaceAnswer, PlaceQuery, PoseAnswer
from mbf_ros.messages import mbf_queries as queries
from mbf_ros.messages.geometry import InvalidValueError, MessageContext
from mbf_ros.messages.interfaces import MessageError, completed, fields_of

CONTEXT = MessageContext()
HERE = {"header": {"frame_id": "/map"}, "pose": {"position": {"x": 1.0, "y": 2.0}}}


def request(kind, **fields):
    return completed(f"mbf_msgs/srv/{kind}_Request", {"costmap": 2, **fields})


def test_a_multiplier_of_zero_is_left_out_of_account():
    _, query = queries.pose_question(request("CheckPose", pose=HERE, lethal_cost_mult=0.0), CONTEXT)
    assert query == PlaceQuery()
    _, query = queries.pose_question(request("CheckPose", pose=HERE, unknown_cost_mult=0.5, costmap=1), CONTEXT)
    assert query == PlaceQuery(unknown_cost_mult=0.5, local=True)


def test_the_current_pose_needs_no_other():
    pose, _ = queries.pose_question(request("CheckPose", current_pose=True), CONTEXT)
    assert pose is None


def test_a_point_is_looked_at_in_its_frame():
    point = {"header": {"frame_id": "/odom"}, "point": {"x": 1, "y": 2}}
    pose, local = queries.point_question(request("CheckPoint", point=point), CONTEXT)
    assert (pose.frame_id, pose.x, pose.y, local) == ("odom", 1.0, 2.0, False)


def test_a_path_is_checked_up_to_a_state_and_zero_is_none():
    fields = {"path": {"poses": [HERE]}, "skip_poses": 3, "path_cells_only": True}
    question = queries.path_question(request("CheckPath", return_on=2, **fields), CONTEXT)
    assert (question["return_on"], question["skip_poses"], question["path_cells_only"]) == (CellState.LETHAL, 3, True)
    assert queries.path_question(request("CheckPath", return_on=0, **fields), CONTEXT)["return_on"] is None


@pytest.mark.parametrize(
    ("kind", "fields", "error", "text"),
    [
        (
            "CheckPose",
            {"pose": HERE, "costmap": 0},
            MessageError,
            r"costmap: expected 1 \(local\) or 2 \(global\), got 0",
        ),
        ("CheckPose", {"pose": HERE, "safety_dist": -1.0}, InvalidValueError, "safety_dist must be 0 m or more"),
        (
            "CheckPose",
            {"pose": HERE, "lethal_cost_mult": None},
            InvalidValueError,
            "lethal_cost_mult: expected a finite number",
        ),
        ("CheckPath", {"path": {"poses": []}, "return_on": 9}, MessageError, "return_on: expected a state from 0 to 4"),
    ],
)
def test_a_request_that_means_nothing_is_refused(kind, fields, error, text):
    ask = {"CheckPose": queries.pose_question, "CheckPath": queries.path_question}[kind]
    with pytest.raises(error, match=text):
        ask(request(kind, **fields), CONTEXT)


@pytest.mark.parametrize(
    ("kind", "answer"),
    [
        ("CheckPose", queries.place_answer(PlaceAnswer(CellState.LETHAL, 253.4))),
        ("CheckPath", queries.path_answer(PathAnswer(-1, CellState.FREE, 0.0))),
        ("FindValidPose", queries.valid_pose_answer(PoseAnswer(CellState.OUTSIDE, float("inf"), None), CONTEXT)),
    ],
)
def test_an_answer_has_the_fields_of_its_type_and_an_integer_cost(kind, answer):
    name = f"mbf_msgs/srv/{kind}_Response"
    assert set(answer) == {field.name for field in fields_of(name)}
    assert completed(name, answer)["cost"] in (253, 0, 2**32 - 1)
