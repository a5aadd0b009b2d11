"""Where somebody will be, without a map."""

import math

import numpy as np
import pytest

from mbf_abstract.geometry import Pose
from mbf_abstract.maps.tracking.objects import Motion, TrackedObject
from mbf_abstract.maps.tracking.prediction import NOWHERE, PredictionParameters, predict


@pytest.mark.parametrize("eighths", range(8))
@pytest.mark.parametrize("side", [1.0, -1.0], ids=["ahead", "behind"])
def test_who_comes_from_behind_is_predicted_up_to_the_robot_whatever_its_heading(eighths, side):
    yaw = eighths * math.pi / 4
    robot, ahead = Pose.planar(3.0, -1.0, yaw), np.array([math.cos(yaw), math.sin(yaw)])
    x, y = (np.array([robot.x, robot.y]) + side * 1.2 * ahead).tolist()
    vx, vy = (-side * 0.8 * ahead).tolist()
    comes = TrackedObject(1, Motion.MOVING, x, y, 0.0, vx, vy, 0.25, 5.0, 0.0, 0.0, 0.0, "map")

    middles, radius, costs = predict(comes, PredictionParameters(), 0.2, NOWHERE, robot)

    reaches_robot = np.hypot(middles[:, 0] - robot.x, middles[:, 1] - robot.y) <= radius
    assert reaches_robot.any() == (side > 0.0)
    assert len(middles) == len(costs) > 5


@pytest.mark.parametrize(("stops", "kept"), [(False, 0.0), (True, 0.35)])
def test_who_is_passed_costs_as_far_beside_them_as_the_guard_makes_the_robot_keep(stops, kept):
    """That is the margin to contacts, as far as that one comes in ``turning_time``, and some room."""
    parameters = PredictionParameters(max_vel_x=1.2, stop_before_contact=stops, contact_margin=0.05, turning_time=0.4)
    slow = TrackedObject(1, Motion.MOVING, 0.0, 1.0, 0.0, 0.0, 0.5, 0.25, 5.0, 0.0, 0.0, 0.0, "map")
    assert predict(slow, parameters, 0.2, np.zeros(3)).radius == pytest.approx(0.25 + 0.2 + kept)


def test_of_who_stands_there_is_no_prediction():
    stands = TrackedObject(1, Motion.WAITING, 0.0, 1.0, 0.0, 0.0, 0.0, 0.25, 5.0, 0.0, 0.0, 0.0, "map")
    middles, _, costs = predict(stands, PredictionParameters(), 0.2, NOWHERE)
    assert middles.shape == (0, 3) and costs.shape == (0,)
