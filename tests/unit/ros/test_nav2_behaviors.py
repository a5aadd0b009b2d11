"""Spin, BackUp, DriveOnHeading and Wait of Nav2 become recoveries with parameters of the goal; questions to a map."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mbf_abstract.goals.result_types import RecoveryResultMessage
from mbf_abstract.maps.recoveries.back_up import BackUpParameters
from mbf_abstract.maps.recoveries.drive_on_heading import DriveOnHeadingParameters
from mbf_abstract.maps.recoveries.rotate import RotateParameters
from mbf_abstract.maps.recoveries.wait import WaitParameters
from mbf_abstract.outcomes import RecoveryOutcome
from mbf_abstract.parameters import with_changes
from mbf_abstract.server.plugin_table import PluginTable
from mbf_ros.messages.action_mapping import RefusedGoal
from mbf_ros.messages.geometry import MessageContext
from mbf_ros.messages.interfaces import completed, fields_of, known_types
from mbf_ros.messages.nav2.behaviors import BEHAVIORS, behavior_mappings
from mbf_ros.messages.nav2.queries import NAV2_QUESTIONS

CONTEXT = MessageContext()
GOALS = {
    "spin": (
        {"target_yaw": -1.5, "time_allowance": {"sec": 9}},
        RotateParameters(),
        {"angle": -1.5, "time_limit": 9.0},
    ),
    "backup": (
        {"target": {"x": -0.5, "y": 0.0}, "speed": -0.25},
        BackUpParameters(),
        {"distance": 0.5, "speed": 0.25, "along_track": False},
    ),
    "drive_on_heading": (
        {"target": {"x": -0.5, "y": 0.0}, "speed": -0.25, "time_allowance": {"nanosec": 500_000_000}},
        DriveOnHeadingParameters(),
        {"distance": -0.5, "speed": 0.25, "time_limit": 0.5},
    ),
    "wait": ({"time": {"sec": 2, "nanosec": 500_000_000}}, WaitParameters(), {"duration": 2.5, "random_extra": 0.0}),
}


def values(name, goal):
    return completed(f"{BEHAVIORS[name].action}_Goal", goal)


@pytest.mark.parametrize("name", BEHAVIORS)
def test_a_goal_becomes_legal_parameters_of_its_recovery(name):
    goal, usual, wanted = GOALS[name]
    parameters = BEHAVIORS[name].parameters(values(name, goal))
    assert parameters == wanted
    assert with_changes(usual, parameters).model_dump() == {**usual.model_dump(), **wanted}


@given(
    distance=st.floats(-10.0, 10.0).filter(lambda x: abs(x) > 1e-3),
    speed=st.floats(-2.0, 2.0).filter(lambda x: abs(x) > 1e-3),
)
def test_backing_up_ignores_signs_and_driving_wants_the_same_ones(distance, speed):
    goal = {"target": {"x": distance, "y": 0.0}, "speed": speed}
    back = BEHAVIORS["backup"].parameters(values("backup", goal))
    assert (back["distance"], back["speed"]) == (abs(distance), abs(speed))
    with_changes(BackUpParameters(), back)
    drive = BEHAVIORS["drive_on_heading"]
    if distance * speed > 0.0:
        parameters = drive.parameters(values("drive_on_heading", goal))
        assert math.copysign(parameters["speed"], parameters["distance"]) == speed
        with_changes(DriveOnHeadingParameters(), parameters)
    else:
        with pytest.raises(RefusedGoal, match="speed: expected the sign of the distance"):
            drive.parameters(values("drive_on_heading", goal))


@pytest.mark.parametrize("name", ["backup", "drive_on_heading"])
def test_a_target_beside_the_heading_is_refused(name):
    with pytest.raises(RefusedGoal, match=r"got y 1\.0 m and z 0\.0 m") as refused:
        BEHAVIORS[name].parameters(values(name, {"target": {"x": 1.0, "y": 1.0}, "speed": 0.1}))
    assert refused.value.outcome == RecoveryOutcome.FAILURE


@pytest.mark.parametrize("name", BEHAVIORS)
def test_without_a_recovery_of_its_type_a_behavior_is_refused_with_what_to_add(name):
    mapping = behavior_mappings(PluginTable())[name]
    with pytest.raises(
        RefusedGoal, match=f"no recovery of type '{BEHAVIORS[name].recovery_type}' is loaded"
    ) as refused:
        mapping.goal(GOALS[name][0], CONTEXT)
    assert refused.value.outcome == RecoveryOutcome.INVALID_PLUGIN


@pytest.mark.parametrize("name", BEHAVIORS)
def test_a_result_has_the_fields_of_its_type(name):
    mapping = behavior_mappings(PluginTable())[name]
    message = mapping.result(RecoveryResultMessage(RecoveryOutcome.PAT_EXCEEDED, "late"), CONTEXT)
    assert set(message) == {field.name for field in fields_of(f"{mapping.type}_Result")}
    assert BEHAVIORS[name].codes(message["error_code"]).name == "TIMEOUT"
    assert message["error_msg"] == "PAT_EXCEEDED: late"


@pytest.mark.parametrize("question", NAV2_QUESTIONS.values(), ids=NAV2_QUESTIONS)
def test_every_question_has_a_known_type_and_an_answer_of_its_type(question):
    assert {f"{question.type}_Request", f"{question.type}_Response"} <= set(known_types())
    completed(f"{question.type}_Response", question.no_answer)
