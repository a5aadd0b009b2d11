"""The tracker of paths: monotone progress in order, however a path runs; cusps; where a robot joins."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mbf_abstract.execution.path_tracker import CUSP_REACHED, SEARCH_WINDOW, PathTracker
from mbf_abstract.geometry import Path, Pose


def path_through(*corners, spacing=None):
    """Path of the corners only, or with a pose every ``spacing`` [m]; poses look to the next one."""
    points = np.array([(*corner, 0.0)[:3] for corner in corners], dtype=float)
    if spacing is not None:
        pieces = [np.linspace(a, b, round(math.dist(a, b) / spacing), endpoint=False) for a, b in pairwise(points)]
        points = np.concatenate([*pieces, points[-1:]])
    return Path.from_points(points)


def walk(tracker, *corners, step=0.05, off=(0.0, 0.0, 0.0)):
    """Lead a robot straight from corner to corner; the progress after each step."""
    seen = []
    for a, b in pairwise(corners):
        for point in np.linspace(a, b, max(2, round(math.dist(a, b) / step) + 1)):
            tracker.update((np.append(point, 0.0)[:3] + off)[: tracker.points.shape[1]])
            seen.append(tracker.progress)
    return np.array(seen)


SPACINGS = [None, 0.05, 0.5]


@pytest.mark.parametrize("spacing", SPACINGS)
@pytest.mark.parametrize("off", [0.0, 0.05, -0.05])
def test_a_path_out_and_back_is_followed_in_order(spacing, off):
    tracker = PathTracker(path_through((0, 0), (5, 0), (0, 0), spacing=spacing))
    progress = walk(tracker, (0, 0), (5, 0), (0, 0), off=(0, off, 0))
    driven = np.concatenate([np.linspace(0, 5, 101), np.linspace(5, 10, 101)])
    assert np.abs(progress - driven).max() <= CUSP_REACHED + 1e-6
    assert tracker.has_arrived(0.01)


@pytest.mark.parametrize("spacing", SPACINGS)
def test_a_robot_at_the_start_of_a_path_that_ends_there_has_not_arrived(spacing):
    for path in (
        path_through((0, 0), (0.4, 0), (0, 0), spacing=spacing),
        path_through((0, 0), (1, 0), (1, 1), (0, 1), (0.05, 0.05), spacing=spacing),
    ):
        tracker = PathTracker(path)
        for position in [(0.02, 0.03, 0.0), (0.0, 0.0, 0.0), (0.05, 0.05, 0.0)]:
            tracker.update(position)
            assert not tracker.has_arrived(0.3)


@pytest.mark.parametrize("turns", [2, 3])
def test_a_circle_driven_several_times_is_not_shortened(turns):
    angles = np.linspace(0.0, turns * 2.0 * np.pi, turns * 60)
    circle = 0.5 * np.column_stack([np.cos(angles), np.sin(angles), np.zeros(len(angles))])
    tracker = PathTracker(Path.from_points(circle))
    progress = walk(tracker, *circle)
    assert (np.diff(progress) >= 0.0).all() and np.diff(progress).max() < 0.15
    assert tracker.has_arrived(0.01)


def test_progress_does_not_jump_where_a_path_crosses_itself():
    tracker = PathTracker(path_through((0, 0), (5, 0), (5, 5), (2, 5), (2, -5)))
    assert walk(tracker, (0, 0), (2.1, 0))[-1] == pytest.approx(2.1)


def test_storeys_on_top_of_each_other_are_not_mixed_up():
    ramp = [(0, 0, 0), (4, 0, 0), (4, 4, 1.5), (0, 4, 3.0), (0, 0, 3.0), (4, 0, 3.0)]
    tracker = PathTracker(path_through(*ramp))
    assert walk(tracker, (0, 0, 0), (4, 0, 0))[-1] == pytest.approx(4.0)
    above = PathTracker(path_through(*ramp))
    above.update((2.0, 0.0, 3.0))
    assert above.remaining == pytest.approx(2.0)


def test_a_robot_that_cuts_a_corner_still_comes_to_the_part_behind_it():
    tracker = PathTracker(path_through((0, 0), (3, 0), (3, 3), spacing=0.1))
    walk(tracker, (0, 0), (2.6, 0), (2.7, 0.4), (2.7, 3.0))
    assert tracker.remaining == pytest.approx(0.0, abs=1e-6)


def test_a_robot_joins_a_path_where_it_is_and_at_the_earlier_of_two_passes():
    straight = PathTracker(path_through((0, 0), (8, 0)))
    straight.update((5.0, 0.4, 0.0))
    assert straight.progress == pytest.approx(5.0)
    assert straight.deviation == pytest.approx(0.4)
    out_and_back = PathTracker(path_through((0, 0), (8, 0), (8, 0.2), (0, 0.2), spacing=0.1))
    out_and_back.update((5.0, 0.15, 0.0))
    assert out_and_back.progress == pytest.approx(5.0)


def test_the_progress_waits_at_a_cusp_until_the_robot_has_come_to_it():
    positions = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [1, 0, 0], [0, 0, 0]], dtype=float)
    tracker = PathTracker(Path(positions, np.tile([0.0, 0.0, 0.0, 1.0], (5, 1))))
    assert tracker.reverse.tolist() == [False, False, True, True]
    assert not tracker.driving_backward and tracker.to_cusp == pytest.approx(2.0)
    assert walk(tracker, (0, 0), (1.8, 0))[-1] == pytest.approx(1.8)
    assert walk(tracker, (1.8, 0), (1.92, 0))[-1] == pytest.approx(2.0)
    assert tracker.driving_backward and tracker.to_cusp == pytest.approx(2.0)


def test_a_robot_beside_a_cusp_is_not_taken_for_one_that_comes_back_from_it():
    tracker = PathTracker(path_through((0, 0), (1, 0), (0, 0.3)))
    walk(tracker, (0, 0), (0.5, 0))
    tracker.update((0.85, 0.1, 0.0))  # nearer to the path behind the cusp
    assert tracker.progress == pytest.approx(0.85)


def test_one_look_goes_on_by_no_more_than_the_window():
    angles = np.linspace(0.0, 2.0 * math.pi, 200)
    tracker = PathTracker(path_through(*zip(np.cos(angles), np.sin(angles), strict=True)))
    tracker.update((1.0, 0.0, 0.0))
    tracker.update((-0.05, 0.0, 0.0))  # across the circle is 3.1 m along it
    assert 0.0 < tracker.progress <= SEARCH_WINDOW


@pytest.mark.parametrize("spacing", SPACINGS)
def test_the_poses_of_a_path_that_turns_back_do_not_make_it_one_for_reversing(spacing):
    tracker = PathTracker(path_through((0, 0), (5, 0), (0, 0), spacing=spacing))
    assert not tracker.reverse.any()
    assert tracker.cusps.tolist() == pytest.approx([5.0, 10.0])


def turn_in_three_strokes():
    """A short manoeuvre: 0.08 m back, 0.16 m ahead, then back; the robot looks along x all the time."""
    points = np.array([[0.0, 0, 0], [-0.04, 0, 0], [-0.08, 0, 0], [0.0, 0.01, 0], [0.08, 0.02, 0], [-0.3, 0, 0]])
    return Path(points, np.tile([0.0, 0.0, 0.0, 1.0], (len(points), 1)))


def test_short_strokes_of_a_manoeuvre_are_not_skipped_while_the_robot_stands():
    tracker = PathTracker(turn_in_three_strokes())
    for _ in range(5):
        tracker.update((0.0, 0.0, 0.0))
    assert tracker.progress == pytest.approx(0.0, abs=0.01)
    assert tracker.driving_backward and tracker.to_cusp == pytest.approx(0.08, abs=0.01)
    walk(tracker, (0.0, 0.0), (-0.08, 0.0), step=0.01)
    assert not tracker.driving_backward


def test_a_robot_that_is_driven_closely_comes_closer_to_a_cusp_before_it_goes_on():
    poses = [Pose.planar(x, 0.0, 0.0) for x in (0.0, 1.0, 2.0, 1.0)]
    tracker = PathTracker(Path.from_poses(poses), dimensions=2)
    tracker.cusp_reached = 0.02
    for x, is_there in ((1.5, False), (1.95, False), (1.985, True)):
        tracker.update((x, 0.0))
        assert tracker.driving_backward is is_there


def test_a_cusp_that_is_near_may_be_taken_for_reached_and_the_end_may_not():
    poses = [Pose.planar(x, 0.0, 0.0) for x in (0.0, 1.0, 2.0, 1.0)]
    tracker = PathTracker(Path.from_poses(poses), dimensions=2)
    tracker.cusp_reached = 0.02
    tracker.update((1.8, 0.0))
    assert not tracker.begin_next_section() and tracker.progress == pytest.approx(1.8)
    tracker.update((1.95, 0.0))
    assert tracker.begin_next_section() and tracker.progress == 2.0 and tracker.driving_backward
    tracker.update((1.05, 0.0))
    assert not tracker.begin_next_section() and tracker.progress == pytest.approx(2.95)


def test_past_a_cusp_and_past_the_end_a_path_is_taken_to_lead_straight_on():
    tracker = PathTracker(path_through((0, 0), (2, 0), (0, 0.02), spacing=0.05))
    tracker.update((1.7, 0.0, 0.0))
    assert tracker.carried_on(0.2) == pytest.approx((1.9, 0.0, 0.0))
    assert tracker.carried_on(0.7) == pytest.approx((2.4, 0.0, 0.0))


def test_past_the_cusp_of_a_stroke_of_few_centimetres_a_path_leads_on_as_the_stroke_does():
    poses = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.97, 0.01, -math.atan2(1, 3)), (1.5, -0.15, -0.3)]
    tracker = PathTracker(Path.from_poses([Pose.planar(*pose) for pose in poses]), dimensions=2)
    tracker.update((1.0, 0.0))
    assert tracker.driving_backward and tracker.to_cusp == pytest.approx(math.hypot(0.03, 0.01))
    ahead = tracker.carried_on(0.5)
    assert ahead == pytest.approx(np.array([1.0, 0.0]) + 0.5 / math.hypot(0.03, 0.01) * np.array([-0.03, 0.01]))


@pytest.mark.parametrize("backward", [False, True])
def test_past_the_cusp_of_a_curved_stroke_a_path_leads_on_along_the_curve(backward):
    """So a robot that steers to a point ahead comes to the cusp with the heading that is planned there."""
    radius, gear = 0.5, -1.0 if backward else 1.0
    angles = np.append(np.arange(0.0, 1.01, 0.05), [0.95, 0.9])  # there, and a little back in the other gear
    poses = [Pose.planar(radius * gear * math.sin(a), radius * (1.0 - math.cos(a)), gear * a) for a in angles]
    tracker = PathTracker(Path.from_poses(poses), dimensions=2)
    tracker.cusp_reached = 0.005
    tracker.update((poses[19].x, poses[19].y))
    assert tracker.driving_backward == backward and tracker.to_cusp == pytest.approx(0.025, abs=1e-3)
    for beyond in (0.03, 0.075, 0.1):
        x, y = tracker.carried_on(tracker.to_cusp + beyond)
        assert math.hypot(x, y - radius) == pytest.approx(radius, abs=5e-4)
        past = 1.0 + beyond / radius
        assert (x, y) == pytest.approx((radius * gear * math.sin(past), radius * (1.0 - math.cos(past))), abs=2e-3)


def test_a_cusp_where_the_robot_reverses_is_not_found_a_second_time_because_the_path_turns_back_there():
    """Forward, three arcs back to the right, and forward to the left, as a search for a car finds it."""
    poses, strokes = [(0.0, 0.0, 0.0)], [(10, 0.05, 0.0), (3, -0.05, 5.0), (10, 0.05, -5.0)]
    for count, length, curvature in strokes:
        for _ in range(count):
            x, y, yaw = poses[-1]
            heading = yaw + 0.5 * length * curvature
            poses.append((x + length * math.cos(heading), y + length * math.sin(heading), yaw + length * curvature))
    tracker = PathTracker(Path.from_poses([Pose.planar(*pose) for pose in poses]), dimensions=2)
    assert tracker.cusps == pytest.approx([0.5, 0.65, 1.15], abs=0.01)


def test_a_bend_and_a_right_angle_are_no_cusps_and_a_hairpin_is_one():
    angles = np.linspace(0.0, np.pi, 30)
    bend = 0.3 * np.column_stack([np.sin(angles), 1.0 - np.cos(angles), np.zeros(30)])
    assert len(PathTracker(Path.from_points(bend)).cusps) == 1
    assert len(PathTracker(path_through((0, 0), (2, 0), (2, 2), spacing=0.05)).cusps) == 1
    assert len(PathTracker(path_through((0, 0), (2, 0), (2, 0.05), (0, 0.05), spacing=0.05)).cusps) == 2


def test_a_path_of_one_pose_is_its_own_end():
    tracker = PathTracker(Path.from_poses([Pose.planar(1.0, 2.0)]))
    tracker.update((1.0, 2.5, 0.0))
    assert (tracker.progress, tracker.remaining, tracker.deviation) == (0.0, 0.0, pytest.approx(0.5))
    assert tracker.has_arrived(0.1) and not tracker.driving_backward


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.tuples(st.floats(-3, 3), st.floats(-3, 3), st.floats(-1, 1)), min_size=1, max_size=8),
    st.floats(-1.0, 50.0),
)
def test_a_single_point_of_a_path_is_that_of_many_to_the_bit(corners, length):
    tracker = PathTracker(Path.from_points(np.array(corners)))
    for place in [length, *tracker.lengths.tolist(), *(tracker.lengths / 3.0).tolist()]:
        assert np.array_equal(tracker.point_at(place), tracker.points_at(np.array([place]))[0])


def test_seen_from_above_heights_do_not_count():
    tracker = PathTracker(path_through((0, 0, 0), (3, 0, 4)), dimensions=2)
    assert tracker.length == pytest.approx(3.0)
    tracker.update((1.0, 0.5))
    assert (tracker.progress, tracker.deviation) == pytest.approx((1.0, 0.5))


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.tuples(st.floats(-3, 3), st.floats(-3, 3)), min_size=2, max_size=8, unique=True),
    st.lists(st.tuples(st.floats(-4, 4), st.floats(-4, 4)), min_size=1, max_size=30),
)
def test_progress_never_goes_back_nor_past_a_cusp_that_was_not_reached(corners, robot):
    tracker = PathTracker(path_through(*corners))
    tracker.update((*robot[0], 0.0))  # it may join the path anywhere
    before = tracker.progress
    for x, y in robot:
        cusp = tracker.next_cusp
        tracker.update((x, y, 0.0))
        assert before <= tracker.progress <= max(cusp, before)
        before = tracker.progress


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(st.floats(0.1, 3), st.floats(-1, 1)), min_size=1, max_size=6), st.floats(-1, 19))
def test_on_a_path_that_never_leads_away_the_place_is_that_of_a_search_in_small_steps(steps, x):
    points = np.concatenate([[[0.0, 0.0]], np.cumsum(np.array(steps) * [1.0, 0.02], axis=0)])
    tracker = PathTracker(Path.from_points(np.column_stack([points, np.zeros(len(points))])), dimensions=2)
    fine = np.linspace(0.0, tracker.length, 4001)
    expected = fine[np.argmin(np.hypot(*(tracker.points_at(fine) - (x, 0.0)).T))]
    tracker.update((x, 0.0))
    assert tracker.progress == pytest.approx(expected, abs=0.02)
