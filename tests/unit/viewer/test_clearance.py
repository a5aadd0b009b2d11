"""Clearance: how far a robot's outline was from walls, obstacles and actors."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mbf_abstract.geometry import Pose, Twist
from terrain.physics.robot_models import HUSKY
from terrain.recording.actor_track import ActorTrack
from terrain.recording.clearance import clearances
from terrain.recording.metrics import measure
from terrain.recording.recorded_robot import RobotShape
from terrain.recording.recorder import Recorder
from terrain.recording.verdict import Verdict
from terrain.worlds.surface import box, cylinder

NOSE, SIDE = HUSKY.footprint_array().max(axis=0).tolist()
PLACES = st.floats(-3.0, 3.0)


def run_through(poses, **things):
    recorder = Recorder("run", "mesh", RobotShape.of(HUSKY), poses[0], [], **things)
    for index, pose in enumerate(poses):
        recorder.sample(0.1 * index, pose, Twist(), Twist())
    return recorder.finish(Verdict(0, "goal reached"))


def walked(poses, thing="person"):
    rows = np.array([[*pose.position, *pose.orientation] for pose in poses])
    return ActorTrack(thing, *cylinder(0.25, 1.7), rows)


def test_a_wall_ahead_is_as_far_as_from_the_nose():
    wall = box([0.2, 4.0, 1.0]).at(Pose.planar(3.1, 0.0, z=0.5))
    run = run_through([Pose.planar(x, 0.0) for x in (0.0, 1.0, 2.0, 2.9)], walls=wall)

    np.testing.assert_allclose(clearances(run)[:3], [3.0 - NOSE, 2.0 - NOSE, 1.0 - NOSE], atol=1e-9)
    assert clearances(run)[3] == 0.0
    assert measure(run).clearance_min_m == 0.0
    assert measure(run).clearance_median_m == pytest.approx(1.5 - NOSE)


def test_a_robot_that_encloses_a_post_touches_it():
    post = box([0.05, 0.05, 1.0]).at(Pose.planar(0.1, 0.1, z=0.5))
    assert clearances(run_through([Pose.planar(0.0, 0.0)], obstacles=post)).tolist() == [0.0]


def test_what_is_above_the_robot_or_under_its_wheels_is_not_near():
    lamp, kerb = box([1.0, 1.0, 0.2]).at(Pose.planar(1.0, 0.0, z=3.0)), box([1.0, 1.0, 0.02]).at(Pose.planar(1.0, 0.0))
    assert clearances(run_through([Pose.planar(0.0, 0.0)], walls=lamp, obstacles=kerb)).tolist() == [math.inf]


def test_a_person_counts_where_it_is_at_the_time():
    run = run_through([Pose.planar(0.0, 0.0), Pose.planar(0.0, 0.0)])
    person = walked([Pose.planar(0.0, 2.0, z=0.85), Pose.planar(0.0, -1.0, z=0.85)])

    found = clearances(replace(run, actors=[person]))

    np.testing.assert_allclose(found, [2.0 - 0.25 - SIDE, 1.0 - 0.25 - SIDE], atol=0.01)


def test_in_the_open_there_is_no_clearance():
    metrics = measure(run_through([Pose.planar(0.0, 0.0)]))
    assert (metrics.clearance_min_m, metrics.clearance_median_m) == (None, None)


@settings(max_examples=60)
@given(PLACES, PLACES, st.floats(-3.0, 3.0), PLACES, PLACES, st.floats(0.1, 3.0))
def test_the_distance_is_that_of_the_nearest_points(x, y, yaw, wall_x, wall_y, length):
    wall = box([length, 0.1, 1.0]).at(Pose.planar(wall_x, wall_y, 0.4, z=0.5))

    (found,) = clearances(run_through([Pose.planar(x, y, yaw)], walls=wall))

    def rim(corners):
        shares = np.linspace(0.0, 1.0, 80)[:, None]
        return np.concatenate(
            [a + shares * (b - a) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)]
        )

    turn = Pose.planar(x, y, yaw).rotation[:2, :2]
    ours = rim(HUSKY.footprint_array() @ turn.T + [x, y])
    half = 0.5 * np.array([[-length, -0.1], [length, -0.1], [length, 0.1], [-length, 0.1]])
    theirs = rim(half @ Pose.planar(0, 0, 0.4).rotation[:2, :2].T + [wall_x, wall_y])
    apart = ours[:, None] - theirs
    naive = np.hypot(apart[..., 0], apart[..., 1]).min()
    if found > 0.0:
        assert found == pytest.approx(naive, abs=0.04)
    else:
        assert naive < 0.04 or length < 1.0  # a short wall may lie inside the robot's outline
