"""MPPI blends its motions; the blend of motions that meet nobody may lead into somebody, and is not driven then."""

import math
from functools import partial

import numpy as np
import pytest

from mbf_abstract.geometry import Twist
from mbf_abstract.maps.tracking.objects import Motion, TrackedObject
from mbf_abstract.plugins import ControlRequest, PluginKind
from mbf_abstract.testing.conformance.rig import ROBOT_RADIUS, START
from mbf_abstract.testing.conformance.site import site

CONTROLLERS = {"costmap": "pursuit", "mesh": "follower"}
RADIUS = 0.25
HORIZON = 2.5  # s, until which what is met counts


def crossing(ahead, aside, speed):
    """Who crosses the robot's way, and does not touch one that stays."""
    x, y = START.x + ahead, START.y - aside
    return TrackedObject(1, Motion.MOVING, x, y, 0.0, 0.0, speed, RADIUS, 5.0, 0.0, 0.0, 0.0, "map")


def least_gap(velocities, known, step):
    """Least gap [m] on a motion (n, 3) from the start, looked at after each step."""
    x, y, yaw, least = START.x, START.y, START.yaw, math.inf
    for k, (vx, vy, wz) in enumerate(velocities, start=1):
        x += (vx * math.cos(yaw) - vy * math.sin(yaw)) * step
        y += (vx * math.sin(yaw) + vy * math.cos(yaw)) * step
        yaw += wz * step
        if k * step < HORIZON:
            there = known.position_in(k * step)
            least = min(least, math.hypot(there[0] - x, there[1] - y) - ROBOT_RADIUS - RADIUS)
    return least


@pytest.mark.parametrize(("ahead", "aside", "speed"), [(1.0, 1.2, 0.8), (0.9, 1.6, 1.0), (1.1, 0.9, 0.6)])
@pytest.mark.parametrize("backend", CONTROLLERS)
def test_a_blend_that_leads_into_somebody_is_not_driven(backends, backend, ahead, aside, speed):
    """At a high temperature all motions count alike, so the blend goes on as before, whoever comes."""
    with site(partial(backends[backend], controller="mppi")) as made:
        controller = made.server.plugins.find(PluginKind.CONTROLLER, CONTROLLERS[backend]).instance
        made.rig.clock.sleep(1.0)
        controller.set_plan(made.path((2.0, 4.0), (8.0, 4.0)))
        request = ControlRequest(START, Twist.planar(0.5))
        for _ in range(30):
            controller.compute_velocity_commands(request)
        before = controller.planned_motion()
        known = crossing(ahead, aside, speed)
        assert least_gap(before.velocities, known, before.step_time) < 0.0
        controller.parameters = controller.parameters.model_copy(update={"temperature": 100.0})
        controller.navigation_map.tracked_objects = lambda now: (known,)
        command, after = controller.compute_velocity_commands(request).command, controller.planned_motion()
        driven = np.vstack([[command.vx, command.vy, command.wz], after.velocities[:-1]])
        assert least_gap(driven, known, after.step_time) > 0.0
