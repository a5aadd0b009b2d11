"""Every action that is offered can be refused and can end by a jump of time, with an outcome that is no success."""

import json
import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from mbf_abstract.outcomes import outcome_name
from mbf_ros.rosbridge.navigation import ACTIONS
from mbf_ros.rosbridge_robot.goals import FAILURE_AND_JUMP, OfferedGoals, in_finite_numbers


def test_all_actions_have_an_outcome_for_each_end_that_navigation_does_not_know():
    for mapping in ACTIONS.values():
        for outcome in FAILURE_AND_JUMP[mapping.refused]:
            result = mapping.refused(outcome, "why")
            assert not result.success and result.message == "why" and not outcome_name(result.outcome).isdigit()


def test_types_are_named_in_full():
    offers = {one["action"]: one["type"] for one in map(json.loads, OfferedGoals.offers())}
    assert offers.keys() == ACTIONS.keys()
    assert offers["/move_base_flex/move_base"] == "mbf_msgs/action/MoveBase"


values = st.recursive(
    st.floats() | st.integers() | st.text(max_size=3) | st.booleans() | st.none(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner, max_size=3),
)


@given(values)
def test_what_a_robot_is_sent_is_finite_and_else_unchanged(value):
    sent = in_finite_numbers(value)
    text = json.dumps(sent, allow_nan=False)  # raises where a number is not finite
    assert in_finite_numbers(sent) == sent and json.loads(text) == sent
    if "Infinity" not in json.dumps(value) and "NaN" not in json.dumps(value):
        assert sent == value


def test_an_infinite_distance_is_one_that_a_float32_can_hold():
    sent = in_finite_numbers({"dist_to_goal": math.inf, "angle_to_goal": -math.inf})
    assert sent == {"dist_to_goal": 1e38, "angle_to_goal": -1e38}
    assert np.isfinite(np.float32(sent["dist_to_goal"]))
