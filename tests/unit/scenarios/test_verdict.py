"""The verdict on a run: navigation's outcome, the scenario's limits, and no contact while the robot moved."""

import pytest

from mbf_abstract.goals.result_types import MoveBaseResult
from mbf_abstract.outcomes import ExePathOutcome, MoveBaseOutcome
from terrain.physics.incidents import IncidentKind
from terrain.recording.verdict import UNFINISHED, Level, judge
from terrain.scenarios.limits import Limits

ARRIVED = MoveBaseResult(MoveBaseOutcome.SUCCESS, "goal reached")
BLOCKED = MoveBaseResult(ExePathOutcome.BLOCKED_PATH, "a box")
NEAR = {"distance_m": 0.1, "angle_deg": 5.0, "estimated_distance_m": 0.1, "estimated_angle_deg": 5.0}
CALM = {
    "max_tilt_deg": 5.0,
    "path_length_m": 10.0,
    "incidents": [],
    "collisions": 0,
    "collisions_while_moving": 0,
    "tip_overs": 0,
    "arrivals": [NEAR],
    "arrival_tolerance": (0.4, 180.0),
}
FAR = CALM | {"arrivals": [NEAR, NEAR | {"distance_m": 2.17}]}
TURNED = CALM | {"arrivals": [NEAR | {"angle_deg": 40.0}], "arrival_tolerance": (0.4, 20.0)}
HIT = CALM | {
    "incidents": ["collision", "collision_while_moving", "collision_with_person", "collision_with_wall"],
    "collisions": 3,
    "collisions_while_moving": 2,
}
PUSHED = CALM | {"incidents": ["collision", "collision_with_person"], "collisions": 1}


@pytest.mark.parametrize(
    ("result", "limits", "metrics", "success", "text"),
    [
        (ARRIVED, Limits(), CALM, True, "SUCCESS: goal reached"),
        (ARRIVED, Limits(), PUSHED, True, "SUCCESS: goal reached"),
        (
            ARRIVED,
            Limits(),
            FAR,
            False,
            "FAILED: goal 2 was missed by 2.17 m in truth, allowed are 0.40 m (estimated 0.10 m) "
            "(navigation: SUCCESS, goal reached)",
        ),
        (
            ARRIVED,
            Limits(),
            TURNED,
            False,
            "FAILED: goal 1 was missed by 40 degrees in truth, allowed are 20 (estimated 5.00 degrees) "
            "(navigation: SUCCESS, goal reached)",
        ),
        (BLOCKED, Limits(), CALM, False, "BLOCKED_PATH: a box"),
        (
            ARRIVED,
            Limits(),
            HIT,
            False,
            "ARRIVED WITH FAILURES: contacts while the robot moved: 2 (person, wall) "
            "(navigation: SUCCESS, goal reached)",
        ),
        (
            BLOCKED,
            Limits(),
            HIT | {"collisions_while_moving": 1},
            False,
            "BLOCKED_PATH: a box; contacts while the robot moved: 1 (person, wall)",
        ),
        (
            ARRIVED,
            Limits(max_tilt=4.0, forbidden=(IncidentKind.COLLISION,)),
            PUSHED,
            False,
            "ARRIVED WITH FAILURES: max_tilt_deg 5.0 is above 4 degrees; collision happened "
            "(navigation: SUCCESS, goal reached)",
        ),
        (
            ARRIVED,
            Limits(),
            CALM | {"tip_overs": 1},
            False,
            "ARRIVED WITH FAILURES: the robot tipped over (navigation: SUCCESS, goal reached)",
        ),
        (
            ARRIVED,
            Limits(forbidden=(IncidentKind.TIPPED_OVER,)),
            CALM | {"tip_overs": 1, "incidents": ["tipped_over"]},
            False,
            "ARRIVED WITH FAILURES: tipped_over happened (navigation: SUCCESS, goal reached)",
        ),
    ],
)
def test_a_run_succeeds_only_if_all_is_well(result, limits, metrics, success, text):
    verdict = judge(result, limits, metrics)

    assert (verdict.success, str(verdict)) == (success, text)
    assert verdict.to_json()["outcome_code"] == int(result.outcome)


@pytest.mark.parametrize(
    ("result", "metrics", "level"),
    [
        (ARRIVED, CALM, Level.SUCCESS),
        (ARRIVED, PUSHED, Level.SUCCESS),
        (ARRIVED, HIT, Level.ARRIVED),
        (ARRIVED, FAR, Level.FAILED),
        (ARRIVED, HIT | {"arrivals": FAR["arrivals"]}, Level.FAILED),
        (BLOCKED, CALM, Level.FAILED),
        (BLOCKED, HIT, Level.FAILED),
    ],
)
def test_a_robot_that_did_not_arrive_in_truth_is_worse_than_one_that_touched_something(result, metrics, level):
    verdict = judge(result, Limits(), metrics)

    assert verdict.level is level
    assert verdict.to_json()["level"] == level.value


def test_a_run_that_was_cut_short_is_no_success():
    assert not UNFINISHED.success and UNFINISHED.level is Level.FAILED
    assert str(UNFINISHED) == "UNFINISHED: the run was cut short"
