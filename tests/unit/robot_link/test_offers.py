"""Every action that is offered can be refused and can end by a jump of time, with an outcome that is no success."""

import json

from mbf_abstract.outcomes import outcome_name
from mbf_ros.rosbridge.navigation import ACTIONS
from mbf_ros.rosbridge_robot.goals import FAILURES, JUMPS, OfferedGoals


def test_all_actions_have_an_outcome_for_each_end_that_navigation_does_not_know():
    for mapping in ACTIONS.values():
        for outcomes in (FAILURES, JUMPS):
            result = mapping.refused(outcomes[mapping.refused], "why")
            assert not result.success and result.message == "why" and not outcome_name(result.outcome).isdigit()


def test_types_are_named_in_full():
    offers = {one["action"]: one["type"] for one in map(json.loads, OfferedGoals.offers())}
    assert offers.keys() == ACTIONS.keys()
    assert offers["/move_base_flex/move_base"] == "mbf_msgs/action/MoveBase"
