"""Truth decides whether a robot has arrived; its belief is reported beside it."""

import json
import math

import pytest

from mbf_abstract.config.navigation_parameters import NavigationParameters
from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.rotations import quaternion_multiply
from mbf_abstract.goals.result_types import MoveBaseResult
from mbf_abstract.outcomes import MoveBaseOutcome
from terrain.scenarios.faults import LocalizationJump
from terrain.scenarios.limits import Limits
from terrain.scenarios.noise import LocalizationNoise
from terrain.scenarios.scenario import PlanarPose, load_scenario
from terrain.session.arrival import Arrival, arrival_tolerance
from terrain.session.runner import RunOptions, run_scenario


def test_an_arrival_compares_truth_and_belief_with_the_goal():
    result = MoveBaseResult(MoveBaseOutcome.SUCCESS, "", None, 0.1, 0.2)
    arrival = Arrival.at(Pose.planar(1.0, 0.0, math.pi - 0.05), Pose.planar(1.0, 0.5, 0.05 - math.pi), result)
    assert (arrival.distance_m, arrival.estimated_distance_m) == (0.5, 0.1)
    assert arrival.angle_deg == pytest.approx(math.degrees(0.1))


def test_on_a_slope_the_angle_is_the_one_that_the_robot_would_turn():
    """A robot that stands across a slope of 30 degrees is as far off as its controller has left it, and not tilted."""
    half = math.radians(15.0)
    across = Pose((0.0, 0.0, 0.0), (math.sin(half), 0.0, 0.0, math.cos(half)))
    turn = Pose.planar(0.0, 0.0, 0.25).orientation
    left = Pose((0.0, 0.0, 0.0), quaternion_multiply(across.orientation, turn))
    arrival = Arrival.at(Pose.planar(0.0, 0.0), left, MoveBaseResult(MoveBaseOutcome.SUCCESS, "", left, 0.0, 0.5))
    assert arrival.angle_deg == arrival.estimated_angle_deg == pytest.approx(math.degrees(0.25))


def test_what_an_executive_does_not_report_is_written_as_unknown():
    result = MoveBaseResult(MoveBaseOutcome.SUCCESS, "")
    assert Arrival.at(Pose.planar(0.0, 0.0), Pose.planar(0.3, 0.0), result).to_json()["estimated_distance_m"] is None


def test_a_robot_need_not_know_better_than_its_localisation_where_it_is():
    parameters = NavigationParameters(dist_tolerance=0.2, angle_tolerance=0.1)
    exact = arrival_tolerance(Limits(), LocalizationNoise(), parameters)
    noisy = arrival_tolerance(Limits(), LocalizationNoise(position_noise=0.03, yaw_noise=1.0), parameters)
    asked = arrival_tolerance(Limits(goal_distance=0.5, goal_angle=9.0), LocalizationNoise(), parameters)
    assert exact == pytest.approx((0.2, math.degrees(0.1)))
    assert noisy == pytest.approx((0.29, math.degrees(0.1) + 3.0))
    assert asked == (0.5, 9.0)


@pytest.fixture
def short_drive():
    """Two metres of the corridor without people and physics; ``faults`` may befall the localisation."""

    def make(*faults):
        return load_scenario("crowded_corridor").model_copy(
            update={"physics": "kinematic", "actors": (), "goals": (PlanarPose(x=6.0, y=9.7),), "faults": faults}
        )

    return make


def test_truth_and_belief_are_one_where_the_pose_is_exact(short_drive, tmp_path):
    result = run_scenario(short_drive(), RunOptions(tmp_path))
    (arrival,) = result.metrics["arrivals"]
    assert result.success, result.verdict
    assert arrival["distance_m"] <= 0.15
    assert arrival["distance_m"] == pytest.approx(arrival["estimated_distance_m"], abs=0.01)


def test_a_run_whose_pose_has_jumped_fails_although_navigation_says_that_it_arrived(short_drive, tmp_path):
    scenario = short_drive(LocalizationJump(type="jump", dx=0.8, start=1.0))
    result = run_scenario(scenario, RunOptions(tmp_path))
    metrics = json.loads((tmp_path / "metrics.json").read_text())
    (arrival,) = metrics["arrivals"]
    assert metrics["outcome"] == "SUCCESS" and not result.success
    assert arrival["estimated_distance_m"] < 0.2 and arrival["distance_m"] > 0.6
    assert "missed" in str(result.verdict) and "estimated" in str(result.verdict)
