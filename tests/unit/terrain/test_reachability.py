"""Whether any way leads a robot through a terrain: what its wheels, its body and its slopes allow."""

import math

import numpy as np
import pytest

from terrain.experiments.evaluation.reachability import DrivingLimits, allowed_states, is_reachable
from terrain.physics.robot_models import HUSKY
from terrain.worlds.generate import fractal_terrain
from terrain.worlds.heightfield import Heightfield

SPACING = 0.25
START, GOAL = (2.0, 5.0, 0.0), (10.0, 5.0)
Y, X = np.mgrid[0:41, 0:49] * SPACING


def ground(heights):
    return Heightfield(np.broadcast_to(heights, X.shape), SPACING, SPACING)


def reaches(heights, start=START, goal=GOAL, limits=None):
    return is_reachable(ground(heights), HUSKY, start, goal, limits=limits)


def ramp(degrees):
    return math.tan(math.radians(degrees)) * X


def wall(height, gap=0.0):
    """A ridge two samples wide across the way, with a gap [m] in it."""
    return np.where((np.abs(X - 6.0) < 0.3) & (np.abs(Y - 8.0) > 0.5 * gap), height, 0.0)


def test_level_ground_is_no_hindrance():
    assert reaches(0.0)


@pytest.mark.parametrize(("height", "expected"), [(0.05, True), (0.6, False)])
def test_a_low_sill_is_driven_over_and_a_wall_is_not(height, expected):
    assert reaches(wall(height)) is expected


@pytest.mark.parametrize(("gap", "expected"), [(0.8, False), (3.0, True)])
def test_a_gap_in_a_wall_must_be_wide_enough(gap, expected):
    assert reaches(wall(0.6, gap)) is expected


@pytest.mark.parametrize(("degrees", "expected"), [(28.0, True), (33.0, False)])
def test_a_slope_is_climbed_up_to_the_limit_of_pitch(degrees, expected):
    assert reaches(ramp(degrees)) is expected


def test_a_slope_that_is_climbed_is_not_crossed():
    across = (6.0, 2.0, math.pi / 2.0)
    assert not reaches(ramp(28.0), across, (6.0, 8.0))
    assert reaches(ramp(18.0), across, (6.0, 8.0))


def test_on_a_steep_slope_the_robot_keeps_its_heading():
    sideways = (6.5, 3.0)
    assert not reaches(ramp(24.0), (6.0, 6.0, 0.0), sideways)
    assert reaches(ramp(24.0), (6.0, 6.0, 0.0), sideways, limits=DrivingLimits(turning_tilt=26.0))


def test_a_bump_under_the_body_counts_where_the_wheels_straddle_it():
    stone = np.where(np.hypot(X - 6.0, Y - 5.0) < 0.1, 0.16, 0.0)
    centre = np.argwhere(stone > 0.0)[0]
    low, high = (
        allowed_states(ground(stone), HUSKY, DrivingLimits(clearance=clearance, room=0.0))[0][0]
        for clearance in (0.12, 0.2)
    )
    assert not low[tuple(centre)]
    assert high[tuple(centre)]


def test_nothing_stands_with_a_wheel_off_the_terrain():
    allowed, may_turn = allowed_states(ground(0.0), HUSKY, DrivingLimits())
    assert not allowed[:, [0, -1]].any() and not allowed[:, :, [0, -1]].any()
    assert allowed[:, 8:-8, 8:-8].all()
    assert np.array_equal(may_turn, allowed)


def test_wider_limits_never_forbid_a_place():
    terrain = fractal_terrain(12.0, 10.0, SPACING, np.random.default_rng(4), median_slope=15.0, roughness=0.03)
    strict = allowed_states(terrain, HUSKY, DrivingLimits())[0]
    for name, value in {"roll": 30.0, "pitch": 35.0, "wheel_slope": 50.0, "clearance": 0.2, "room": 0.0}.items():
        wider = allowed_states(terrain, HUSKY, DrivingLimits(**{name: value}))[0]
        assert not (strict & ~wider).any(), name
    assert 0.1 < strict.mean() < 0.9


def test_a_start_that_is_not_allowed_reaches_nothing():
    assert not reaches(0.0, (0.1, 5.0, 0.0))
