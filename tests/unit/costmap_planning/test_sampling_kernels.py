"""DWA and MPPI: their kernels against naive twins, and their sampling rules."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from mbf_abstract.geometry import Twist
from mbf_abstract.geometry.arcs import arc_poses
from mbf_abstract.maps.controllers.inertia import reached
from mbf_costmap_nav.control.trajectory_scoring import driven_poses, footprint_discs
from mbf_costmap_nav.controllers.dwa import sample_velocities, sample_window, slowed_down
from mbf_costmap_nav.critics.obstacle_critic import VALUE_OF_COST
from mbf_costmap_nav.grid.costmap import Costmap
from mbf_costmap_nav.kernels.control.critics import alignment, furthest_reached, map_costs, mean_angle_to
from mbf_costmap_nav.kernels.control.rollout import add_noise, clip_velocities, integrate

seeds = st.integers(0, 2**32 - 1)


def random_velocities(seed, steps=12, samples=7, spread=1.0):
    return (np.random.default_rng(seed).standard_normal((3, steps, samples)) * spread).astype(np.float32)


# ------------------------------------------------------------------------------------------------ kernels
@settings(max_examples=20, deadline=None)
@given(seed=seeds, yaw=st.floats(-3, 3))
def test_integrated_poses_equal_step_by_step_rotation(seed, yaw):
    velocities = random_velocities(seed)
    poses = np.empty_like(velocities)
    integrate(velocities, yaw, 0.05, poses)
    x, y, heading = np.zeros(7), np.zeros(7), np.full(7, yaw)
    for t in range(12):
        vx, vy, wz = velocities[:, t].astype(float)
        before, heading = heading, heading + wz * 0.05
        c, s = 0.5 * (np.cos(before) + np.cos(heading)), 0.5 * (np.sin(before) + np.sin(heading))
        x += (vx * c - vy * s) * 0.05
        y += (vx * s + vy * c) * 0.05
    np.testing.assert_allclose(poses[:, -1], [x, y, heading], atol=1e-5)


@settings(max_examples=20, deadline=None)
@given(seed=seeds, yaw=st.floats(-3, 3))
def test_what_the_footprint_is_checked_along_are_the_arcs_a_robot_drives_one_after_the_other(seed, yaw):
    velocities = random_velocities(seed)[:, :, 0].T.astype(np.float64)
    velocities[3:5, 2] = 0.0
    pose, along = (1.0, -2.0, yaw), []
    for vx, vy, wz in velocities.tolist():
        along.append(arc_poses(pose, vx, vy, wz, 0.05, 0.05)[-1])
        pose = tuple(along[-1].tolist())
    np.testing.assert_allclose(driven_poses((1.0, -2.0, yaw), velocities, 0.05), along, atol=1e-12)


@pytest.mark.parametrize("turn", [-2.0, 0.5, 2.0])
def test_a_constant_velocity_leads_along_its_arc_to_a_tenth_of_a_millimetre_in_half_a_second(turn):
    velocities = np.empty((3, 10, 1), dtype=np.float32)
    velocities[:, :, 0] = np.array([0.5, 0.0, turn])[:, None]
    poses = np.empty_like(velocities)
    integrate(velocities, 0.3, 0.05, poses)
    exact = arc_poses((0.0, 0.0, 0.3), 0.5, 0.0, turn, 0.5, 0.05)
    np.testing.assert_allclose(poses[:2, :, 0], exact[:, :2].T, atol=2e-4)


@settings(max_examples=20, deadline=None)
@given(seed=seeds, radius=st.sampled_from([0.0, 0.5]), top_speed=st.sampled_from([0.45, math.inf]))
def test_clipped_velocities_keep_all_limits(seed, radius, top_speed):
    velocities = random_velocities(seed, spread=3.0)
    now, low, high = np.zeros(3), np.array([-0.3, -0.2, -1.0]), np.array([0.5, 0.2, 1.0])
    change = np.array([0.15, 0.15, 0.2])
    clip_velocities(velocities, *(a.astype(np.float32) for a in (now, low, high, change)), radius, top_speed)
    steps = np.diff(np.concatenate([np.zeros((3, 1, 7)), velocities], axis=1), axis=1)
    assert (velocities >= low[:, None, None] - 1e-6).all() and (velocities <= high[:, None, None] + 1e-6).all()
    assert np.hypot(*(steps[:2] / change[:2, None, None])).max() <= 1.0 + 1e-5
    assert abs(steps[2]).max() <= change[2] + 1e-6 or radius
    assert np.hypot(velocities[0], velocities[1]).max() <= top_speed + 1e-6
    if radius:
        assert (abs(velocities[2]) * radius <= abs(velocities[0]) + 1e-6).all()


@settings(max_examples=20, deadline=None)
@given(seed=seeds, top_speed=st.sampled_from([0.4, math.inf]))
def test_what_both_directions_change_together_equals_a_step_by_step_limit(seed, top_speed):
    velocities, now = random_velocities(seed), np.array([0.2, -0.1, 0.0], dtype=np.float32)
    high, change = np.array([0.5, 0.3, 1.0], dtype=np.float32), np.array([0.1, 0.05, 9.0], dtype=np.float32)
    expected = np.empty((2, 12, 7))
    for n in range(7):
        last = Twist.planar(*now.tolist())
        for t in range(12):
            vx, vy = (max(-h, min(float(velocities[k, t, n]), h)) for k, h in enumerate(high[:2].tolist()))
            share = min(1.0, top_speed / math.hypot(vx, vy))
            last = reached(Twist.planar(share * vx, share * vy), last, tuple(change.tolist()))
            expected[:, t, n] = last.vx, last.vy
    clip_velocities(velocities, now, -high, high, change, 0.0, top_speed)
    np.testing.assert_allclose(velocities[:2], expected, atol=1e-5)


@settings(max_examples=20, deadline=None)
@given(seed=seeds, top_speed=st.floats(0.0, 2.0))
def test_a_velocity_above_the_speed_limit_keeps_its_direction(seed, top_speed):
    given_ones = random_velocities(seed).reshape(3, -1).T.astype(float)
    for vx, vy, wz in given_ones:
        speed = math.hypot(vx, vy)
        share = min(1.0, top_speed / speed)
        assert slowed_down(np.array([[vx, vy, wz]]), top_speed)[0] == pytest.approx((share * vx, share * vy, wz))
    clipped, wide = random_velocities(seed), np.full(3, 1e3, dtype=np.float32)
    clip_velocities(clipped, np.zeros(3, dtype=np.float32), -wide, wide, wide, 0.0, top_speed)
    assert clipped.reshape(3, -1).T == pytest.approx(slowed_down(given_ones, top_speed), abs=1e-5)


def test_noise_is_scaled_and_added_to_the_nominal_sequence():
    nominal, noise = random_velocities(0)[:, :, 0], random_velocities(1, samples=5)
    velocities, deviation = np.full_like(noise, 7.0), np.array([1.0, 0.0, 2.0], dtype=np.float32)
    add_noise(nominal, noise, deviation, velocities)
    expected = nominal[:, :, None] + deviation[:, None, None] * noise
    expected[1] = 7.0  # left to clip_velocities, as the robot cannot go sideways
    np.testing.assert_allclose(velocities, expected, rtol=1e-6)


@settings(max_examples=20, deadline=None)
@given(seed=seeds, disc=st.sampled_from([0.0, 0.2]))
def test_map_costs_equal_single_look_ups(seed, disc):
    rng = np.random.default_rng(seed)
    grid = Costmap(rng.choice([0, 50, 252, 253, 254, 255], (20, 20)).astype(np.uint8), 0.1, -1.0, -1.0)
    poses = random_velocities(seed, spread=0.6)
    total = map_costs(grid.cells, 0.1, -1.0, -1.0, poses, np.array([disc], dtype=np.float32), 2, VALUE_OF_COST)
    expected = np.zeros(7)
    for t in range(1, 12, 2):
        for n in range(7):
            x, y, yaw = poses[:, t, n].astype(float)
            place = x + disc * math.cos(yaw), y + disc * math.sin(yaw)
            # The kernel counts in float32: on the border of a cell rounding decides.
            assume(all(abs(value / 0.1 - round(value / 0.1)) > 1e-4 for value in place))
            cost = grid.cost_at(*place)
            expected[n] += 0.0 if cost is None else VALUE_OF_COST[cost]
    np.testing.assert_allclose(total, expected, rtol=1e-4)


def test_alignment_of_a_trajectory_on_the_path_is_zero_and_beside_it_the_distance():
    path = np.column_stack([np.arange(0, 2, 0.1), np.zeros(20)]).astype(np.float32)
    poses = np.zeros((3, 12, 2), dtype=np.float32)
    poses[0] = 0.1 * np.arange(1, 13)[:, None]
    poses[1, :, 1] = 0.3
    off = alignment(poses, path, 0.1, 1)
    assert off[0] == pytest.approx(0.0, abs=1e-5) and off[1] == pytest.approx(0.36, abs=0.1)
    assert furthest_reached(poses, path, 1) == 12


def test_angles_are_wrapped_in_the_heading_term():
    poses = np.full((3, 4, 1), math.pi - 0.1, dtype=np.float32)
    assert mean_angle_to(poses, -math.pi + 0.1)[0] == pytest.approx(0.2, abs=1e-5)


# ----------------------------------------------------------------------------------------------- sampling
@pytest.mark.parametrize(
    ("low", "high", "count", "expected"),
    [
        pytest.param(-30, 30, 1, [-30, 0, 30], id="F075"),
        pytest.param(10, 30, 1, [10, 30], id="F076"),
        pytest.param(-30, 30, 4, [-30, -10, 0, 10, 30], id="F077"),
        pytest.param(-10, 50, 4, [-10, 0, 10, 30, 50], id="F078"),
    ],
)
def test_velocity_samples(low, high, count, expected):
    assert sample_velocities(low, high, count).tolist() == pytest.approx(expected)


@given(low=st.floats(-20.0, 20.0), width=st.floats(1e-6, 20.0), count=st.integers(2, 60))
def test_velocity_samples_are_spaced_as_numpy_spaces_them(low, width, count):
    evenly = np.linspace(low, low + width, count)
    samples = sample_velocities(low, low + width, count)
    assert set(evenly.tolist()) <= set(samples.tolist()) <= set(evenly.tolist()) | {0.0}


def test_f079_a_tiny_asymmetry_adds_zero():
    assert len(sample_velocities(-10.00001, 10, 3)) == 4


@pytest.mark.parametrize(
    ("current", "low", "high", "change", "count", "expected"),
    [
        pytest.param(2, 0, 5, 1, 2, [1, 3], id="F080"),
        pytest.param(2, 1.5, 2.5, 1, 2, [1.5, 2.5], id="F081"),
        pytest.param(2, 0, 5, 0.5, 2, [1.5, 2.5], id="F082"),
        pytest.param(2, 0, 5, 1, 3, [1, 2, 3], id="F083-three"),
        pytest.param(2, 0, 5, 1, 5, [1, 1.5, 2, 2.5, 3], id="F083-five"),
        pytest.param(0, -5, 5, 1, 2, [-1, 0, 1], id="F084"),
        pytest.param(0, -5, 5, 1, 4, [-1, -1 / 3, 0, 1 / 3, 1], id="F085"),
    ],
)
def test_dynamic_window(current, low, high, change, count, expected):
    assert sample_window(current, low, high, change, count).tolist() == pytest.approx(expected)


def test_discs_cover_a_long_robot_and_one_disc_a_square_one(make_plugin):
    from mbf_costmap_nav.grid.footprint import Footprint

    square = Footprint([[0.2, 0.2], [-0.2, 0.2], [-0.2, -0.2], [0.2, -0.2]])
    long = Footprint([[0.6, 0.2], [-0.4, 0.2], [-0.4, -0.2], [0.6, -0.2]])
    assert footprint_discs(square).tolist() == [0.0]
    assert footprint_discs(long)[[0, -1]].tolist() == pytest.approx([-0.2, 0.4])
