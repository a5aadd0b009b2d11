"""Sampling controllers command nothing that they could not stop before an obstacle."""

import math

import numpy as np
import pytest

from mbf_abstract.execution.path_tracker import PathTracker
from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.maps.controllers.inertia import InertiaParameters
from mbf_abstract.plugins import ControlRequest
from mbf_costmap_nav.control.path_handling import ControlCycle
from mbf_costmap_nav.control.trajectory_scoring import brakes_free, stops_free
from mbf_costmap_nav.grid.costmap import Costmap
from mbf_costmap_nav.grid.footprint import Footprint
from mbf_costmap_nav.grid.footprint_check import FootprintCheck

RESOLUTION, STEP = 0.05, 0.05
OUTLINE = Footprint([(0.3, 0.2), (-0.2, 0.2), (-0.2, -0.2), (0.3, -0.2)])
BRAKING = np.array([0.5, 0.5, 1.0])


def cycle_before_a_wall(x, touches=False):
    """The robot stands at the origin, a wall begins at ``x`` [m]."""
    cells = np.zeros((120, 120), dtype=np.uint8)
    cells[:, round((x + 3.0) / RESOLUTION) :] = 254
    costmap, pose = Costmap(cells, RESOLUTION, -3.0, -3.0), Pose.planar(0.0, 0.0)
    tracker = PathTracker(Path.from_poses([pose, Pose.planar(1.0, 0.0)]), dimensions=2)
    check = FootprintCheck(OUTLINE, RESOLUTION)
    return ControlCycle(ControlRequest(pose, Twist()), tracker, costmap, check, 0.1, 1.0, touches=touches)


def slowly(cycle, velocity):
    """In steps of a millisecond, one velocity after the other."""
    x, y, yaw = 0.0, 0.0, 0.0
    for k in range(20000):
        braked = max(math.floor(0.001 * k / STEP + 1e-9), 0) * STEP
        vx, vy, wz = (math.copysign(max(abs(v) - b * braked, 0.0), v) for v, b in zip(velocity, BRAKING, strict=True))
        x += 0.001 * (vx * math.cos(yaw) - vy * math.sin(yaw))
        y += 0.001 * (vx * math.sin(yaw) + vy * math.cos(yaw))
        yaw += 0.001 * wz
        if cycle.footprint.collides(cycle.costmap, x, y, yaw):
            return False
        if vx == vy == wz == 0.0:
            return True
    raise AssertionError


@pytest.mark.parametrize("seed", range(40))
def test_what_can_be_stopped_is_what_stops_free_when_it_is_driven(seed):
    rng = np.random.default_rng(seed)
    cycle = cycle_before_a_wall(float(rng.uniform(0.4, 1.5)))
    velocity = rng.uniform(-1.0, 1.0, 3) * (1.2, 0.6, 2.0)
    assert stops_free(cycle, velocity, BRAKING, STEP) == slowly(cycle, velocity.tolist())


@pytest.mark.parametrize("seed", range(40))
def test_what_is_free_to_brake_is_so_on_its_arc_in_steps_of_a_millisecond(seed):
    rng = np.random.default_rng(seed)
    cycle = cycle_before_a_wall(float(rng.uniform(0.4, 1.5)))
    vx, vy, wz = (rng.uniform(-1.0, 1.0, 3) * (1.2, 0.6, 2.0)).tolist()
    stops_after = max(math.hypot(vx, vy) / 0.5, abs(wz) / 1.0)
    x, y, yaw, touched = 0.0, 0.0, 0.0, False
    for k in range(round(1000 * (0.05 + stops_after))):
        share = min(max(1.0 - (0.001 * k - 0.05) / stops_after, 0.0), 1.0)
        x += 0.001 * share * (vx * math.cos(yaw) - vy * math.sin(yaw))
        y += 0.001 * share * (vx * math.sin(yaw) + vy * math.cos(yaw))
        yaw += 0.001 * share * wz
        touched = touched or cycle.footprint.collides(cycle.costmap, x, y, yaw)
    inertia = InertiaParameters(acc_lim_x=0.5, acc_lim_theta=1.0, control_period=0.05)
    assert brakes_free(cycle, np.array([vx, vy, wz]), inertia) != touched


def test_a_robot_that_touches_something_has_to_get_out_not_to_stop():
    assert not stops_free(cycle_before_a_wall(0.35), np.array([0.5, 0.0, 0.0]), BRAKING, STEP)
    assert stops_free(cycle_before_a_wall(0.25, touches=True), np.array([0.5, 0.0, 0.0]), BRAKING, STEP)
