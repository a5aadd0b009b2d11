"""Conformance tests of path geometry."""

import math

import numpy as np
import pytest

from mbf_abstract.execution.path_tracker import PathTracker
from mbf_abstract.geometry import Path, Pose
from mbf_abstract.geometry.polyline import polyline_lengths
from mbf_costmap_nav.control.path_geometry import circle_crossing, look_ahead_point, resample
from mbf_costmap_nav.control.path_handling import to_base_frame

X_AXIS = np.column_stack([np.arange(10.0), np.zeros(10)])


@pytest.mark.parametrize(
    ("a", "b", "radius", "expected"),
    [
        pytest.param((0, 0), (2, 0), 1, (1, 0), id="F107"),
        pytest.param((0, 0), (-2, 0), 1, (-1, 0), id="F108"),
        pytest.param((0, 0), (0, 2), 1, (0, 1), id="F109"),
        pytest.param((0, 0), (0, -2), 1, (0, -1), id="F110"),
        pytest.param((4, 0), (-1, 0), 2, (2, 0), id="F111"),
        pytest.param((0, 4), (0, -0.5), 2, (0, 2), id="F112"),
        pytest.param((2, 0), (0, 0), 2, (2, 0), id="F113"),
        pytest.param((0, 0), (0, 2), 2, (0, 2), id="F114"),
        pytest.param((0, 0), (6, 8), 5, (3, 4), id="F115"),
        pytest.param((0, 0), (-6, -8), 5, (-3, -4), id="F116"),
        pytest.param((0, 0), (-6, 8), 5, (-3, 4), id="F117"),
        pytest.param((0, 0), (6, -8), 5, (3, -4), id="F118"),
    ],
)
def test_circle_crossing(a, b, radius, expected):
    assert circle_crossing(a, b, radius) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("a", "b", "distance", "expected"),
    [((4, 0), (-1, 0), 2, (2, 0)), ((0, 4), (0, -0.5), 2, (0, 2)), ((0, 0), (6, 8), 5, (3, 4))],
)
def test_f119_point_at_a_distance_along_a_segment(a, b, distance, expected):
    points = np.array([a, b], dtype=float)
    s = distance / polyline_lengths(points)[-1]
    assert points[0] + s * (points[1] - points[0]) == pytest.approx(expected)


@pytest.mark.parametrize("distance", [1.0, 3.8])
def test_f120_look_ahead_between_poses(distance):
    assert look_ahead_point(X_AXIS, distance) == pytest.approx((distance, 0.0))


@pytest.mark.parametrize(
    "points",
    [
        pytest.param([(0, 0), (1, 0), (2, 0), (3, 0)], id="F121"),
        pytest.param([(2, 0), (3, 0)], id="F122"),
        pytest.param([(2, 2), (3, 3)], id="F123"),
    ],
)
def test_look_ahead_beyond_the_path_ends_at_its_last_pose(points):
    # Nav2 can go straight on from there. Ours slows down before the end instead, so a shorter carrot does no harm.
    assert look_ahead_point(np.array(points, dtype=float), 10.0) == pytest.approx(points[-1])


@pytest.mark.parametrize(
    ("spacing", "count"),
    [(2, 2), (1, 2), (0.8, 3), (0.5, 3), (0.34, 4), (0.32, 5), (0.1, 11)],
    ids=lambda v: f"F065-{v}",
)
def test_resampling_one_metre(spacing, count):
    assert len(resample(np.array([[0.0, 0.0], [1.0, 0.0]]), spacing)) == count


def test_f066_resampling_keeps_the_ends_and_bounds_the_gaps():
    points = resample(np.array([[1.0, 1.0], [5.0, 5.0]]), 1.0)
    assert points[0].tolist() == [1, 1] and points[-1].tolist() == [5, 5]
    assert (np.hypot(*np.diff(points, axis=0).T) < 1.0).all()


def test_f067_resampling_nothing_gives_nothing():
    assert len(resample(np.zeros((0, 2)), 0.5)) == 0


def test_f126_length_of_ten_poses_two_metres_apart():
    assert polyline_lengths(2 * X_AXIS)[-1] == 18.0
    assert len(polyline_lengths(X_AXIS[10:])) == 0


def test_f127_length_of_a_circle():
    angles = np.radians(np.arange(361))
    circle = 2.0 * np.column_stack([np.cos(angles), np.sin(angles)])
    assert polyline_lengths(circle)[-1] == pytest.approx(12.566, abs=0.1)


def deviation(points, position):
    """Distance [m] of a robot that has just got a path from it."""
    tracker = PathTracker(Path.from_points(np.column_stack([points, np.zeros(len(points))])), dimensions=2)
    tracker.update(position)
    return tracker.deviation


def test_f130_robot_beside_a_path_there_and_back():
    there_and_back = np.vstack([np.column_stack([np.arange(11.0), np.zeros(11)]), [[x, 0] for x in range(9, -1, -1)]])
    for x in np.linspace(0, 10, 21):
        assert deviation(there_and_back, (x, 0.5)) == pytest.approx(0.5)


def test_f131_circle_driven_twice():
    angles = np.linspace(0, 4 * np.pi, 50)
    circle = 5.0 * np.column_stack([np.cos(angles), np.sin(angles)])
    on_outer = 5.2 * np.array([np.cos(angles[7]), np.sin(angles[7])])
    assert deviation(circle, on_outer) == pytest.approx(0.2, abs=0.01)


def test_f132_l_shaped_path():
    corner = np.array([[0, 0], [10, 0], [10, 10]], dtype=float)
    assert deviation(corner, (9, 1)) == pytest.approx(1.0, abs=0.1)


def test_f133_path_of_a_single_pose():
    assert deviation(np.array([[2.0, 3.0]]), (5, 7)) == 5.0


def test_f135_pose_in_the_robots_frame():
    assert to_base_frame(np.array([[3.0, 4.0]]), Pose.planar(1, 2)) == pytest.approx(np.array([[2, 2]]))
    assert to_base_frame(np.array([[1.0, 3.0]]), Pose.planar(1, 2, math.pi / 2)) == pytest.approx(np.array([[1, 0]]))
