"""Actions mean what the range of commands says, and rewards are weighed as stated."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from mbf_abstract.geometry import Twist
from terrain.learning.command_range import CommandRange
from terrain.learning.reward import RewardParts, RewardWeights, StepFacts
from terrain.physics.robot_models import CAR, TURTLEBOT

RANGE = CommandRange(max_vel_x=0.8, min_vel_x=-0.2, max_vel_theta=1.5)
numbers = st.floats(-10.0, 10.0)


@given(numbers, numbers)
def test_a_command_is_within_its_range_and_zero_stands(ahead, turn):
    command = RANGE.command([ahead, turn])
    assert -0.2 <= command.vx <= 0.8 and abs(command.wz) <= 1.5 and command.vy == 0.0
    assert RANGE.command([0.0, 0.0]) == Twist()


def test_the_ends_of_an_action_are_the_ends_of_the_range():
    assert RANGE.command([1.0, -1.0]) == Twist.planar(0.8, 0.0, -1.5)
    assert RANGE.command(np.array([-1.0, 0.5], np.float32)) == Twist.planar(-0.2, 0.0, 0.75)
    sideways = CommandRange(max_vel_y=0.4)
    assert sideways.size == 3 and sideways.command([0.0, 0.0, -0.5]) == Twist.planar(0.0, -0.2, 0.0)


def test_the_range_of_a_robot_is_what_it_can_do():
    assert CommandRange.of(TURTLEBOT) == CommandRange(max_vel_x=0.65, min_vel_x=-0.65, max_vel_theta=1.9)
    assert CommandRange.of(CAR).size == 2


@pytest.mark.parametrize("action", [[0.0], [0.0, np.inf], [[0.0, 0.0]], "x", None, [0.0, "left"]])
def test_an_action_of_another_shape_or_that_is_not_finite_is_refused(action):
    with pytest.raises(ValueError, match="action: expected 2 finite numbers from -1 to 1"):
        RANGE.command(action)


def test_each_part_of_a_reward_is_its_weight_times_what_happened():
    weights = RewardWeights(progress=2.0, arrival=5.0, contact=7.0, tilt=3.0, effort=0.5, time=0.1)
    parts = RewardParts.of(StepFacts(0.4, True, True, 0.2, 4.0, 0.1), weights)
    assert parts.to_json() == pytest.approx(
        {"progress": 0.8, "arrival": 5.0, "contact": -7.0, "tilt": -0.06, "effort": -2.0, "time": -0.01}
    )
    assert parts.total == pytest.approx(sum(parts.to_json().values()))
    assert RewardParts.of(StepFacts(0.0, False, False, 0.0, 0.0, 0.0), weights).total == 0.0


def test_a_weight_below_zero_is_refused():
    with pytest.raises(ValidationError, match="greater than or equal to 0"):
        RewardWeights(contact=-1.0)
