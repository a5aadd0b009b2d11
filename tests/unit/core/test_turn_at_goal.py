"""A robot at its goal turns to the heading, whatever its pose does by some centimetres, and does not stand off it."""

import math

import pytest

from mbf_abstract.geometry import Pose
from mbf_abstract.maps.controllers.turn_at_goal import PATIENCE, TurnAtGoal, from_goal


def turning(gaps, angle, reach=0.08, tolerances=(0.1, 0.2)):
    """What is decided for each gap [m]."""
    state = TurnAtGoal(reach)
    state.take_tolerances(*tolerances)
    return [state.update(gap <= state.limit, angle) for gap in gaps]


def test_a_robot_that_turns_may_drift_twice_as_far_before_it_drives_again():
    assert turning([0.09, 0.07, 0.09, 0.15, 0.17, 0.15, 0.08], 1.0) == [False, True, True, True, False, False, True]


def test_it_begins_no_farther_off_than_the_goal_allows():
    assert turning([0.07, 0.05, 0.07], 1.0, tolerances=(0.05, 0.2)) == [False, True, True]


def test_one_that_has_the_heading_but_drifted_out_of_the_tolerance_drives_again():
    decided = turning([0.08] + [0.12] * (PATIENCE + 5), 0.1)
    assert decided == [True] * PATIENCE + [False] * 6


@pytest.mark.parametrize(("z", "same_storey", "gap"), [(0.4, 0.5, 3.0), (4.0, 0.5, 5.0), (-4.0, math.inf, 3.0)])
def test_a_goal_on_another_storey_is_as_far_away_as_it_is(z, same_storey, gap):
    assert from_goal(Pose.planar(1.0, 2.0, 0.2), Pose.planar(4.0, 2.0, 0.5, z), same_storey) == pytest.approx(
        (gap, 0.3)
    )


def test_one_that_comes_no_nearer_turns_where_it_is_within_the_tolerance():
    state = TurnAtGoal(0.05)
    state.take_tolerances(0.1, 0.2)
    assert not state.update(0.08 <= state.limit, 1.0)
    state.begin_within(0.1)
    state.take_tolerances(0.1, 0.2)
    assert state.update(0.08 <= state.limit, 1.0)
