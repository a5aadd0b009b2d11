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
    controls = sampled(acc_lim_x=0.5, acc_lim_theta=0.7, control_period=0.04)[..., component]
    before = np.column_stack([np.full(50, (MEASURED.vx, MEASURED.wz)[component]), controls[:, :-1]])
    changes = np.abs(controls - before)
    assert changes[:, 0].max() <= limit * 0.04 + 1e-12, "that is what is commanded"
    assert changes[:, 1:].max() <= limit * 0.1 + 1e-12


def test_each_is_the_nearest_to_what_was_sampled_that_can_be_reached():
    free, limited = sampled(), sampled(acc_lim_x=0.5, acc_lim_theta=0.7, control_period=0.04)
    for sample in range(50):
        last = np.array([MEASURED.vx, MEASURED.wz])
        for step in range(12):
            change = (0.1 if step else 0.04) * np.array([0.5, 0.7])
            last = np.minimum(np.maximum(free[sample, step], last - change), last + change)
            assert limited[sample, step] == pytest.approx(last)


def test_a_car_turns_its_wheels_at_once():
    controls = sampled(acc_lim_x=0.5, acc_lim_theta=0.1, motion_model="ackermann")
    assert np.abs(np.diff(controls[..., 1], axis=1)).max() > 0.1


@pytest.mark.parametrize("control", [(0.6, -0.4), (0.2, 1.0), (-0.3, 0.0), (0.0, 0.8)])
def test_a_robot_brakes_on_its_arc_as_far_as_it_takes(control):
    p = MPPIParameters(time_steps=200, model_dt=0.02, acc_lim_x=0.5, acc_lim_theta=0.7, control_period=0.06)
    braked = SampledMotions(p, 0.0).braked(np.array(control))
    assert braked[:, 0] * control[1] == pytest.approx(braked[:, 1] * control[0])
    stops_after = max(abs(control[0]) / 0.5, abs(control[1]) / 0.7)
    assert np.sum(braked * 0.02, axis=0) == pytest.approx(np.array(control) * (0.06 + 0.5 * stops_after), rel=0.01)
    assert SampledMotions(MPPIParameters(), 0.0).braked(np.array(control)) is None


def test_a_car_that_brakes_keeps_its_wheels_as_they_are():
    p = MPPIParameters(motion_model="ackermann", acc_lim_x=0.5, acc_lim_theta=0.7)
    braked = SampledMotions(p, 0.0).braked(np.array([0.6, 0.3]))
    assert (braked[:, 1] == 0.3).all() and braked[-1, 0] == 0.0
