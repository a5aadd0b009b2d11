"""Metrics of runs whose numbers are known beforehand."""

import json
import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mbf_abstract.events import Event, EventKind
from mbf_abstract.geometry import Pose, Twist
from terrain.physics.incidents import roll_pitch
from terrain.physics.robot_models import HUSKY
from terrain.recording.metrics import (
    count_stops,
    cross_track_errors,
    followed_length,
    mean_change,
    measure,
    planning_times,
)
from terrain.recording.planning_times import PlanningTimes
from terrain.recording.recorded_robot import RobotShape
from terrain.recording.recorder import Recorder
from terrain.recording.verdict import Verdict
from terrain.session.robot_run import success_by_path_length


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


def test_only_what_leads_up_is_climbed():
    run = straight_run([])
    poses = run.poses.copy()
    poses[:, 2] = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.3, 0.1, 0.2, 0.1, 0.0]

    assert measure(replace(run, poses=poses)).climb_m == pytest.approx(0.6)


def test_a_stop_that_was_asked_for_is_none_of_the_gates_own():
    stops = [("velocity_gate", 1.0), ("exe_path", 2.0), ("velocity_gate", 3.0)]
    events = tuple(Event(time, EventKind.ROBOT_STOPPED, source, {}) for source, time in stops)

    assert measure(replace(straight_run([]), events=events)).gate_stops == 2


def test_a_robot_that_starts_and_drives_on_does_not_stop():
    moving, standing = [0.5, 0.0, 0.0], [0.0, 0.0, 0.0]

    assert count_stops(np.array([standing, moving, moving])) == 0
    assert count_stops(np.array([moving, standing, standing])) == 1


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


@given(st.integers(0, 2**32 - 1), st.integers(1, 7))
def test_cross_track_errors_have_the_bytes_of_distances_taken_piece_by_piece(seed, count):
    rng = np.random.default_rng(seed)
    plan = rng.uniform(-5.0, 5.0, (count, 3))
    plan[count // 2] = plan[0]  # a piece may be a point
    run = replace(straight_run([]), paths=[(0.0, plan)])

    expected = [_distance(x, y, plan[:, :2].tolist()) for x, y in run.poses[:, :2].tolist()]

    assert cross_track_errors(run).tolist() == expected


def _distance(px, py, line):
    found = [math.sqrt((px - line[0][0]) ** 2 + (py - line[0][1]) ** 2)] if len(line) == 1 else []
    for (ax, ay), (bx, by) in pairwise(line):
        dx, dy = bx - ax, by - ay
        along = min(max(((px - ax) * dx + (py - ay) * dy) / max(dx * dx + dy * dy, 1e-12), 0.0), 1.0)
        x, y = ax + along * dx - px, ay + along * dy - py
        found.append(math.sqrt(x * x + y * y))
    return min(found)


def test_every_plan_counts_as_far_as_it_was_followed():
    first = np.array([[0.0, 0.0, 0.0], [10.0, 0.0, 0.0]])
    second = np.array([[4.0, 0.3, 0.0], [4.0, 5.0, 0.0], [6.0, 5.0, 0.0]])
    to_the_next_goal = np.array([[6.0, 5.0, 0.0], [6.0, 9.0, 0.0]])

    assert followed_length([]) == 0.0
    assert followed_length([first]) == pytest.approx(10.0)
    assert followed_length([first, second]) == pytest.approx(4.0 + 6.7)
    assert followed_length([first, first, first, second]) == pytest.approx(4.0 + 6.7)
    assert followed_length([first, second, to_the_next_goal]) == pytest.approx(4.0 + 6.7 + 4.0)
    assert followed_length([first, np.zeros((0, 3)), second[:1]]) == pytest.approx(4.0)


@given(st.integers(0, 2**32 - 1))
def test_the_place_where_a_plan_was_left_is_the_nearest_of_all_its_places(seed):
    rng = np.random.default_rng(seed)
    plan, left_at = rng.uniform(-5.0, 5.0, (6, 3)), rng.uniform(-5.0, 5.0, (1, 3))
    lengths = np.linalg.norm(np.diff(plan, axis=0), axis=1)
    along = np.concatenate([np.linspace(0.0, 1.0, 2001)[:-1] * length for length in lengths])
    along += np.repeat(np.concatenate([[0.0], np.cumsum(lengths)[:-1]]), 2000)
    places = np.column_stack([np.interp(along, np.concatenate([[0.0], np.cumsum(lengths)]), x) for x in plan.T])
    apart = np.linalg.norm(places - left_at, axis=1)

    followed = followed_length([plan, left_at])

    assert apart[np.argmin(np.abs(along - followed))] == pytest.approx(apart.min(), abs=0.02)


def test_control_effort_is_the_mean_change_of_the_command():
    times = np.array([0.0, 0.1, 0.2, 0.2, 0.4])
    assert mean_change(times, np.array([0.0, 0.5, 0.0, 0.0, 0.0])) == pytest.approx((5.0 + 5.0 + 0.0) / 3)
    assert mean_change(times[:1], times[:1]) == 0.0
    assert measure(straight_run([])).mean_command_acceleration == 0.0


def test_planning_times_are_those_of_calls_that_have_ended(hill_recording):
    never_ended = Event(5.0, EventKind.PLUGIN_CALL_STARTED, "dijkstra", {"goal_id": 9, "method": "make_plan"})

    assert planning_times((*hill_recording.events, never_ended)) == pytest.approx([0.4])
    metrics = measure(hill_recording)
    assert (metrics.planning_time_median_s, metrics.planning_time_p95_s) == pytest.approx((0.4, 0.4))
    assert measure(straight_run([])).planning_time_p95_s is None


def test_the_wall_time_of_planners_is_taken_call_by_call():
    times = PlanningTimes()
    assert times.to_json()["planning_wall_max_ms"] is None
    for goal in (1, 2, 3):
        for kind in (EventKind.PLUGIN_CALL_STARTED, EventKind.PLUGIN_CALL_ENDED):
            times.write(Event(0.0, kind, "dijkstra", {"goal_id": goal, "method": "make_plan"}))
    times.write(Event(0.0, EventKind.PLUGIN_CALL_ENDED, "dijkstra", {"goal_id": 4, "method": "make_plan"}))
    times.write(Event(0.0, EventKind.PLUGIN_CALL_STARTED, "dijkstra", {"goal_id": 5, "method": "make_plan"}))

    taken = times.to_json()

    assert 0.0 <= taken["planning_wall_median_ms"] <= taken["planning_wall_p95_ms"] <= taken["planning_wall_max_ms"]


@pytest.mark.parametrize(
    ("success", "shortest", "driven", "spl"),
    [
        (True, 10.0, 12.5, 0.8),
        (True, 10.0, 9.9, 1.0),
        (True, 0.0, 0.0, 1.0),
        (False, 10.0, 10.0, 0.0),
        (True, None, 10.0, None),
    ],
)
def test_success_is_weighted_by_the_length_of_the_path(success, shortest, driven, spl):
    metrics = {"path_length_m": driven} | ({} if shortest is None else {"geodesic_m": shortest})
    assert success_by_path_length(success, metrics) == spl
