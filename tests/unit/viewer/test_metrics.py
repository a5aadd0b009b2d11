"""Metrics of runs whose numbers are known beforehand."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from mbf_abstract.geometry import Pose, Twist
from terrain.physics.incidents import roll_pitch
from terrain.physics.robot_models import HUSKY
from terrain.recording.metrics import count_stops, cross_track_errors, measure
from terrain.recording.recorder import Recorder
from terrain.recording.recording import RobotShape
from terrain.recording.verdict import Verdict


def straight_run(goals):
    recorder = Recorder("straight", "mesh", RobotShape.of(HUSKY), Pose.planar(0, 0), goals)
    recorder.path(0.0, [[0, 0.5, 0], [10, 0.5, 0]])
    for step in range(11):
        recorder.sample(step * 1.0, Pose.planar(step * 0.5, 0.0, z=0.1 * step), Twist.planar(0.5), Twist.planar(0.5))
    return recorder.finish(Verdict(0, "goal reached"))


def test_length_speed_climb_and_distance_of_a_straight_run():
    metrics = measure(straight_run([Pose.planar(5.0, 2.0, z=1.0)]))

    assert metrics.time_s == 10.0
    assert metrics.path_length_m == pytest.approx(10 * math.hypot(0.5, 0.1))
    assert metrics.mean_speed == pytest.approx(metrics.path_length_m / 10.0)
    assert metrics.climb_m == pytest.approx(1.0)
    assert metrics.planned_length_m == pytest.approx(10.0)
    assert metrics.distance_to_goal_m == pytest.approx(2.0)
    assert metrics.mean_cross_track_error_m == pytest.approx(0.5)


def test_without_goal_and_plan_there_is_no_distance_and_no_error():
    run = replace(straight_run([]), paths=[])

    metrics = measure(run)

    assert metrics.distance_to_goal_m is None
    assert metrics.max_cross_track_error_m is None


def test_an_empty_run_has_metrics_too():
    run = Recorder("nothing", "mesh", RobotShape.of(HUSKY), Pose.planar(0, 0), []).finish(Verdict(100, "no robot"))

    metrics = measure(run)

    assert (metrics.time_s, metrics.mean_speed, metrics.max_tilt_deg, metrics.stops) == (0.0, 0.0, 0.0, 0)


def test_events_are_counted(hill_recording):
    metrics = measure(hill_recording)

    assert (metrics.plans, metrics.planner_calls, metrics.gate_stops, metrics.faults) == (1, 1, 1, 0)
    assert (metrics.control_cycles, metrics.failed_control_cycles) == (500, 12)


def test_metrics_are_plain_json(office_recording):
    values = measure(office_recording).to_json()

    assert json.loads(json.dumps(values, allow_nan=False)) == values


def test_roll_and_pitch_agree_with_the_incident_monitor(hill_recording):
    metrics = measure(hill_recording)

    angles = [roll_pitch(Pose(tuple(row[:3]), tuple(row[3:]))) for row in hill_recording.poses]
    assert metrics.max_roll_deg == pytest.approx(math.degrees(max(abs(roll) for roll, _ in angles)))
    assert metrics.max_pitch_deg == pytest.approx(math.degrees(max(abs(pitch) for _, pitch in angles)))


def test_every_standstill_after_motion_is_one_stop():
    speeds = [0.0, 0.5, 0.5, 0.0, 0.0, 0.4, 0.0]
    twists = np.column_stack([speeds, np.zeros(7), np.zeros(7)])

    assert count_stops(twists) == 2


def test_cross_track_error_is_measured_to_the_plan_of_the_time():
    run = straight_run([])
    run.paths.append((5.0, np.array([[0.0, -0.2, 0.0], [10.0, -0.2, 0.0]])))

    errors = cross_track_errors(run)

    np.testing.assert_allclose(errors[:5], 0.5)
    np.testing.assert_allclose(errors[5:], 0.2)
