"""The motions that MPPI on a mesh tries change as fast as the robot can."""

import math

import numpy as np
import pytest

from mbf_abstract.geometry import Twist
from mbf_mesh_nav.motion.sampled_motions import MPPIParameters, SampledMotions

MEASURED = Twist.planar(0.6, wz=-0.4)


def sampled(**parameters):
    motions = SampledMotions(MPPIParameters(batch_size=50, time_steps=12, **parameters), 0.0)
    nominal = np.column_stack([np.linspace(0.8, 0.0, 12), np.linspace(-1.0, 1.0, 12)])
    return motions.sampled(np.random.default_rng(3), nominal, 0.8, math.inf, MEASURED, reverses=False)


@pytest.mark.parametrize(("component", "limit"), [(0, 0.5), (1, 0.7)])
def test_no_motion_changes_faster_than_the_robot_can(component, limit):
    controls = sampled(acc_lim_x=0.5, acc_lim_theta=0.7)[..., component]
    before = np.column_stack([np.full(50, (MEASURED.vx, MEASURED.wz)[component]), controls[:, :-1]])
    assert np.abs(controls - before).max() <= limit * 0.1 + 1e-12


def test_each_is_the_nearest_to_what_was_sampled_that_can_be_reached():
    free, limited = sampled(), sampled(acc_lim_x=0.5, acc_lim_theta=0.7)
    for sample in range(50):
        last = np.array([MEASURED.vx, MEASURED.wz])
        for step in range(12):
            change = 0.1 * np.array([0.5, 0.7])
            last = np.minimum(np.maximum(free[sample, step], last - change), last + change)
            assert limited[sample, step] == pytest.approx(last)


def test_a_car_turns_its_wheels_at_once():
    controls = sampled(acc_lim_x=0.5, acc_lim_theta=0.1, motion_model="ackermann")
    assert np.abs(np.diff(controls[..., 1], axis=1)).max() > 0.1
