"""The kernels of critics, footprints, the smoother and the sonar against slow twins in plain Python."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from mbf_costmap_nav.control.sampling_noise import smoothing_matrix
from mbf_costmap_nav.grid.costmap import Costmap
from mbf_costmap_nav.grid.footprint import Footprint
from mbf_costmap_nav.grid.footprint_check import FootprintCheck, footprint_samples
from mbf_costmap_nav.kernels.control.critics import (
    alignment,
    furthest_reached,
    mean_angle_to,
    mean_distance_to_point,
    mean_of,
)
from mbf_costmap_nav.kernels.control.rollout import blend
from mbf_costmap_nav.kernels.control.smoothing import costs_near, relax_path
from mbf_costmap_nav.kernels.map.footprint_cost import OUTSIDE, footprint_cost
from mbf_costmap_nav.kernels.map.line_cells import cost_along
from mbf_costmap_nav.kernels.map.sonar import FADE_DISTANCE, LEAST_PROBABILITY, occupied_given_reading, update_cone

seeds = st.integers(0, 2**32 - 1)
NOT_CANCELED = np.zeros(1, dtype=np.uint8)


def random_trajectories(seed, steps=12, samples=7):
    """(3, steps, samples) of poses that wander about."""
    moves = np.random.default_rng(seed).standard_normal((3, steps, samples)) * 0.2
    return np.cumsum(moves, axis=1).astype(np.float32)


# ------------------------------------------------------------------------------------------------ critics
@given(seeds, st.floats(-3, 3), st.floats(-3, 3), st.floats(-7, 7))
@settings(max_examples=20, deadline=None)
def test_means_over_a_trajectory(seed, x, y, yaw):
    poses = random_trajectories(seed)
    distances = np.hypot(poses[0].astype(float) - x, poses[1].astype(float) - y)
    np.testing.assert_allclose(mean_distance_to_point(poses, x, y), distances.mean(axis=0), rtol=1e-4)
    turns = np.array([[abs(math.remainder(a - yaw, 2 * math.pi)) for a in row] for row in poses[2].astype(float)])
    np.testing.assert_allclose(mean_angle_to(poses, yaw), turns.mean(axis=0), atol=1e-4)
    np.testing.assert_allclose(mean_of(poses[0], False), np.abs(poses[0]).mean(axis=0), rtol=1e-4)
    np.testing.assert_allclose(mean_of(poses[0], True), np.maximum(-poses[0], 0).mean(axis=0), rtol=1e-4, atol=1e-7)


@given(seeds, st.integers(1, 4))
@settings(max_examples=20, deadline=None)
def test_a_trajectory_is_compared_with_the_path_at_the_same_length(seed, stride):
    poses, path = random_trajectories(seed), random_trajectories(seed + 1, steps=20, samples=1)[:2, :, 0].T.copy()
    expected = np.zeros(7)
    for n in range(7):
        xy, travelled, terms = np.zeros(2), 0.0, []
        for t in range(stride - 1, 12, stride):
            travelled += math.dist(xy, poses[:2, t, n])
            xy = poses[:2, t, n].astype(float)
            terms.append(math.dist(xy, path[min(math.floor(travelled / 0.3 + 0.5), len(path) - 1)]))
        expected[n] = np.mean(terms)
    np.testing.assert_allclose(alignment(poses, path, 0.3, stride), expected, rtol=1e-3)
    nearest = [np.argmin(np.hypot(*(path - poses[:2, -1, n]).T)) for n in range(0, 7, stride)]
    assert furthest_reached(poses, path, stride) == max(nearest)


# --------------------------------------------------------------------------------------------- footprints
@given(seeds, st.floats(-0.5, 2.5), st.floats(-0.5, 2.5), st.floats(-4, 4))
@settings(max_examples=60, deadline=None)
def test_the_cost_of_a_footprint_is_the_highest_under_its_points(seed, x, y, yaw):
    rng = np.random.default_rng(seed)
    cells = rng.choice([0, 80, 252, 253, 254, 255], (20, 20), p=[0.5, 0.2, 0.1, 0.1, 0.02, 0.08]).astype(np.uint8)
    grid = Costmap(cells, 0.1)
    check = FootprintCheck(Footprint(rng.uniform(0.1, 0.4, (4, 2)) * [[1, 1], [-1, 1], [-1, -1], [1, -1]]), 0.1)
    points = check.samples @ _rotation(yaw) + (x, y)
    costs = [grid.cost_at(*point) for point in points]
    known = [cost for cost in costs if cost not in (None, 255)]
    expected = 254 if 254 in known else OUTSIDE if None in costs else max(known, default=0)
    assert footprint_cost(cells, 0.1, 0.0, 0.0, check.samples, x, y, yaw) == expected


def _rotation(yaw):
    return np.array([[math.cos(yaw), math.sin(yaw)], [-math.sin(yaw), math.cos(yaw)]])


# ------------------------------------------------------------------------------------------------ smoother
@given(seeds)
@settings(max_examples=20, deadline=None)
def test_the_relaxed_path_is_that_of_the_plain_sweeps(seed):
    rng = np.random.default_rng(seed)
    cells = rng.choice([0, 150, 254], (16, 16), p=[0.7, 0.2, 0.1]).astype(np.uint8)
    points = rng.uniform(1.0, 15.0, (9, 2))
    limits, fixed = np.array([0, 100, 100, 0, 200, 252, 100, 150, 0]), np.arange(9) == 5
    relaxed, sweeps = relax_path(cells, points, 0.1, 0.35, limits, fixed, 0.0, 15, NOT_CANCELED)
    expected = points.copy()
    for _ in range(15):
        for index in (1, 2, 3, 4, 6, 7):
            before, here, after = expected[index - 1 : index + 2]
            origin = points[index]
            moved = here + 0.1 * (origin - here) + 0.35 * (before + after - 2 * here)
            old, new = (
                max(cost_along(cells, 0, *before, *place), cost_along(cells, 0, *place, *after))
                for place in (here, moved)
            )
            if new <= limits[index] or new < old:
                here[:] = moved
    assert sweeps == 15
    np.testing.assert_allclose(relaxed, expected, atol=1e-9)


@given(seeds)
@settings(max_examples=20, deadline=None)
def test_the_costs_near_a_path_are_those_of_the_cells_around_its_lines(seed):
    rng = np.random.default_rng(seed)
    cells = rng.integers(0, 256, (12, 12)).astype(np.uint8)
    points = rng.uniform(0.0, 12.0, (6, 2))
    known = np.where(cells < 255, np.minimum(cells, 252), 0)
    of_lines = []
    for before, after in itertools.pairwise(points):
        parts = int(2.0 * np.abs(after - before).max()) + 1
        places = np.floor(np.linspace(before, after, parts + 1)).astype(int)
        of_lines.append(max(known[max(y - 1, 0) : y + 2, max(x - 1, 0) : x + 2].max() for x, y in places))
    expected = [max(of_lines[max(i - 2, 0) : i + 2]) for i in range(6)]
    assert costs_near(cells, points, 2).tolist() == expected


# --------------------------------------------------------------------------------------------------- sonar
@given(st.floats(0.0, 4.0), st.floats(-0.5, 0.5), st.floats(0.5, 3.0))
@settings(max_examples=60, deadline=None)
def test_a_reading_frees_what_is_before_it_and_says_nothing_behind(distance, angle, reading):
    occupied = occupied_given_reading(distance, angle, reading, 0.3, 0.1)
    if distance >= reading + 0.1 or abs(angle) >= 0.3:
        assert occupied == 0.5
    elif distance < reading - 0.2:
        assert occupied < 0.5
    elif distance > reading - 0.1:
        assert occupied >= 0.5
    assert occupied == occupied_given_reading(distance, -angle, reading, 0.3, 0.1)
    closer_to_axis = occupied_given_reading(distance, 0.5 * angle, reading, 0.3, 0.1)
    assert abs(closer_to_axis - 0.5) >= abs(occupied - 0.5) - 1e-12


def test_belief_is_halved_at_the_fade_distance():
    near, there = (abs(occupied_given_reading(d, 0.0, 3.0, 0.3, 0.1) - 0.5) for d in (0.0, FADE_DISTANCE))
    assert there == pytest.approx(0.25) and near > 0.49


@given(seeds, st.floats(0.0, 2.0), st.floats(0.0, 2.0), st.floats(0.3, 1.5), st.floats(-3.1, 3.1))
@example(0, 0.75, 0.75, 1.0, 1.0)  # the sensor in the middle of a cell
@settings(max_examples=30, deadline=None)
def test_cells_take_a_reading_by_bayes_rule(seed, x, y, reading, bearing):
    prior = np.random.default_rng(seed).uniform(0.1, 0.9, (20, 20)).astype(np.float32)
    after, sensor = prior.copy(), np.array([x, y, 0.0])
    end = sensor + reading * np.array([math.cos(bearing), math.sin(bearing), 0.0])
    x0, y0, x1, y1 = update_cone(after, np.zeros(2), 0.1, sensor, end, 0.3, False)
    for iy, ix in np.ndindex(20, 20):
        dx, dy = (ix + 0.5) * 0.1 - x, (iy + 0.5) * 0.1 - y
        off_axis = math.remainder(math.atan2(dy, dx) - bearing, 2 * math.pi) if math.hypot(dx, dy) > 1e-9 else 0.0
        says = occupied_given_reading(math.hypot(dx, dy), off_axis, reading, 0.3, 0.1)
        odds = prior[iy, ix] / (1.0 - prior[iy, ix]) * says / (1.0 - says)
        expected = np.clip(odds / (1.0 + odds), LEAST_PROBABILITY, 1.0 - LEAST_PROBABILITY)
        in_box = x0 <= ix < x1 and y0 <= iy < y1
        assert after[iy, ix] == pytest.approx(expected if in_box else prior[iy, ix], abs=1e-4)
        assert in_box or says == 0.5


@given(st.integers(1, 200), st.floats(0.05, 5.0), st.integers(0, 2**32 - 1))
def test_the_blended_motion_is_the_mean_by_weight_then_smoothed(samples, temperature, seed):
    rng = np.random.default_rng(seed)
    velocities = rng.normal(size=(3, 5, samples)).astype(np.float32)
    costs = rng.uniform(0.0, 20.0, samples).astype(np.float32)
    smoothing = smoothing_matrix(5)
    weights = [math.exp(-(cost - min(costs.tolist())) / temperature) for cost in costs.tolist()]
    mean = np.average(velocities.astype(np.float64), axis=2, weights=weights)
    blended = blend(velocities, costs, temperature, smoothing)
    assert blended == pytest.approx(mean @ smoothing.astype(np.float64), abs=1e-5)


def test_checks_of_equal_outlines_have_one_array_of_samples():
    corners = [[0.4, 0.25], [-0.3, 0.25], [-0.3, -0.25], [0.4, -0.25]]
    one, same, finer, longer = (
        FootprintCheck(Footprint(np.array(corners) * [factor, 1.0]), resolution).samples
        for factor, resolution in ((1.0, 0.05), (1.0, 0.05), (1.0, 0.02), (1.1, 0.05))
    )
    assert one is same
    assert len(finer) > len(longer) > len(one)
    assert np.array_equal(one, footprint_samples(np.array(corners), 0.05))
