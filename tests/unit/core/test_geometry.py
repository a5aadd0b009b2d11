"""Poses, twists and paths: finite, unit length, and headed where they should be."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from mbf_abstract.geometry import (
    AckermannCommand,
    NonFiniteError,
    Path,
    Pose,
    Twist,
    normalize_angle,
    quaternion_from_yaw,
    quaternion_multiply,
    quaternions_from_axes,
    rotation_matrix,
)
from mbf_abstract.geometry.arcs import poses_on_arc
from mbf_abstract.geometry.rotations import level_quaternions
from mbf_abstract.geometry.transform import InvalidTransformError, Transform

angles = st.floats(-20.0, 20.0)
coordinates = st.floats(-1e3, 1e3)
points = st.tuples(coordinates, coordinates, coordinates)


def headings(path):
    """Naive twin: look at the next different point; the end looks where the way led."""
    ways = []
    for i in range(len(path)):
        ahead = [p - path.positions[i] for p in path.positions[i + 1 :] if (p != path.positions[i]).any()]
        ways.append(ahead[0] if ahead else (ways[-1] if ways else np.array([1.0, 0.0, 0.0])))
    return [math.atan2(way[1], way[0]) for way in ways]


@given(angles)
def test_an_angle_is_wrapped_to_the_same_direction(angle):
    wrapped = normalize_angle(angle)
    assert -math.pi < wrapped <= math.pi
    assert math.cos(wrapped) == pytest.approx(math.cos(angle), abs=1e-9)
    assert math.sin(wrapped) == pytest.approx(math.sin(angle), abs=1e-9)


@given(coordinates, coordinates, st.floats(-3.1, 3.1))
def test_a_planar_pose_keeps_its_heading(x, y, yaw):
    pose = Pose.planar(x, y, yaw)
    assert pose.yaw == pytest.approx(yaw, abs=1e-9)
    assert pose.rotation[:, 0] == pytest.approx([math.cos(yaw), math.sin(yaw), 0.0], abs=1e-9)


@given(st.integers(0, 2**32 - 1))
def test_quaternions_multiply_and_turn_as_scipy_says(seed):
    a, b = Rotation.random(2, rng=np.random.default_rng(seed)).as_quat()
    expected = (Rotation.from_quat(a) * Rotation.from_quat(b)).as_matrix()
    assert rotation_matrix(quaternion_multiply(a, b)) == pytest.approx(expected, abs=1e-9)


@given(st.integers(0, 2**32 - 1))
def test_frames_from_axes_have_the_z_axis_and_the_heading_asked_for(seed):
    rng = np.random.default_rng(seed)
    x_axes, z_axes = rng.normal(size=(5, 3)), rng.normal(size=(5, 3))
    for q, x, z in zip(quaternions_from_axes(x_axes, z_axes), x_axes, z_axes, strict=True):
        rotation = rotation_matrix(q)
        assert rotation[:, 2] == pytest.approx(z / np.linalg.norm(z), abs=1e-9)
        assert rotation[:, 0] @ x > 0.0
        assert rotation[:, 1] @ x == pytest.approx(0.0, abs=1e-9)


def test_level_quaternions_have_the_bytes_of_those_with_z_axes_that_are_up():
    rng = np.random.default_rng(3)
    scaled = rng.normal(size=(3000, 3)) * 10.0 ** rng.integers(-12, 4, (3000, 1))
    flat = rng.normal(size=(3000, 3)) * [1.0, 1.0, 0.0]
    along_axes = rng.integers(-2, 3, (3000, 3)) * rng.choice([1.0, -1.0], (3000, 3))  # zeros of both signs
    x_axes = np.concatenate([scaled, flat, along_axes])
    expected = quaternions_from_axes(x_axes, np.tile([0.0, 0.0, 1.0], (len(x_axes), 1)))
    assert level_quaternions(x_axes).tobytes() == expected.tobytes()
    assert level_quaternions(np.zeros((0, 3))).shape == (0, 4)


def test_distance_and_angle_between_poses():
    here, there = Pose((1.0, 2.0, 3.0)), Pose((3.0, 2.0, 1.0), quaternion_from_yaw(math.pi))
    assert here.distance_to(there) == pytest.approx(2.82843, abs=1e-5)  # F124
    assert here.angle_to(there) == pytest.approx(math.pi)
    assert Pose.planar(0, 0, 3.14).angle_to(Pose.planar(0, 0, -3.14)) == pytest.approx(2 * (math.pi - 3.14), abs=1e-6)


def test_ten_poses_two_metres_apart_are_eighteen_metres():  # F126
    path = Path.from_points([(2.0 * i, 0.0, 0.0) for i in range(10)])
    assert path.length == pytest.approx(18.0)
    assert path.remaining_lengths[0] == pytest.approx(18.0)
    assert path.remaining_lengths[-1] == 0.0


@given(st.lists(st.sampled_from([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (0.0, 2.0, 0.0)]), max_size=8))
def test_path_poses_look_at_the_next_different_point(positions):
    path = Path.from_points(positions)
    assert [pose.yaw for pose in path] == pytest.approx(headings(path), abs=1e-9)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_point_or_a_normal_that_is_not_finite_is_named_before_anything_is_computed_of_it(bad):
    points = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (2.0, 0.0, 0.0)]
    wrong = [(0.0, 0.0, 0.0), (bad, 0.0, 0.0), (bad, 0.0, 0.0)]
    for normals in (None, points):
        with pytest.raises(NonFiniteError, match=r"^pose 1 of the path is not finite: "):
            Path.from_points(wrong, normals=normals)
    with pytest.raises(NonFiniteError, match=r"^normal 1 of the path is not finite: "):
        Path.from_points(points, normals=wrong)


@given(st.integers(0, 2**32 - 1))
def test_planar_poses_have_the_bytes_of_those_of_each_pose(seed):
    rng = np.random.default_rng(seed)
    orientations = rng.normal(size=(9, 4))
    path = Path(rng.normal(size=(9, 3)), orientations / np.linalg.norm(orientations, axis=1)[:, None])
    assert path.planar_poses.tobytes() == np.array([(pose.x, pose.y, pose.yaw) for pose in path]).tobytes()
    assert path[:0].planar_poses.shape == (0, 3)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("turn", [0.0, 1e-12, 0.7])
def test_on_an_arc_that_is_not_driven_the_robot_stays_where_it_is(turn):
    stays, _, ahead = poses_on_arc((1.0, 2.0, 0.5), 0.3, 0.0, turn, np.array([0.0, 0.0, 0.1])).tolist()
    assert stays == [1.0, 2.0, 0.5]
    assert ahead == pytest.approx([1.0 + 0.03 * math.cos(0.5), 2.0 + 0.03 * math.sin(0.5), 0.5 + 0.1 * turn], abs=2e-3)


def test_the_last_pose_of_a_path_can_be_given():
    path = Path.from_points([(0, 0, 0), (1, 0, 0)], quaternion_from_yaw(1.0))
    assert path[-1].yaw == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Path.from_points(np.ones((6, 2))), r"positions of a path have the shape \(6, 2\), expected \(n, 3\)"),
        (lambda: Path(np.ones((6, 2))), r"positions of a path have the shape \(6, 2\), expected \(n, 3\)"),
        (lambda: Path(np.ones(6)), r"positions of a path have the shape \(6,\), expected \(n, 3\)"),
        (lambda: Path(np.ones((8, 3)), np.ones((6, 3))), r"orientations of .* shape \(6, 3\), expected \(n, 4\)"),
        (lambda: Path.from_points(np.ones((6, 3)), None, np.ones((3, 3))), r"normals .* \(3, 3\), expected \(6, 3\)"),
    ],
)
def test_arrays_of_another_shape_are_no_path(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_a_slice_of_a_path_is_a_path_in_the_same_frame():
    path = Path.from_points([(0, 0, 0), (1, 0, 0), (2, 0, 0)], frame_id="odom", stamp=3.0)
    assert len(path[1:]) == 2
    assert path[1:].frame_id == "odom"
    assert path[1].stamp == 3.0


def test_a_path_of_checked_arrays_is_the_same_path_and_read_only():
    positions, orientations = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 2.0]]), np.array([[0.0, 0.0, 0.0, 1.0]] * 2)
    expected = Path(positions, orientations, "odom", 3.0)
    path = Path.of_checked_arrays(positions, orientations, "odom", 3.0)
    assert list(path) == list(expected) and path.length == expected.length and path.guidance is None
    assert not (path.positions.flags.writeable or path.orientations.flags.writeable)


def test_the_arrays_of_a_path_are_its_own_and_read_only():
    positions = np.zeros((2, 3))
    path = Path(positions)
    positions[0, 0] = 5.0
    assert path.positions[0, 0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        path.positions[0, 0] = 1.0


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_numbers_that_are_not_finite_are_refused_by_name_or_index(bad):
    with pytest.raises(NonFiniteError, match=r"position\[1\]"):
        Pose((0.0, bad, 0.0))
    with pytest.raises(NonFiniteError, match=r"angular\[2\]"):
        Twist.planar(wz=bad)
    with pytest.raises(NonFiniteError, match="speed"):
        AckermannCommand(bad)
    with pytest.raises(NonFiniteError, match="pose 1"):
        Path(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, bad]]))


@pytest.mark.parametrize("far", [1e200, -1e308, 1.1e9])
def test_coordinates_beyond_the_bound_are_refused_by_name_or_index(far):
    with pytest.raises(ValueError, match=r"^position\[1\] must be within 1e\+09 m of zero, got "):
        Pose((0.0, far, 0.0))
    for make in (Path, Path.from_points):
        with pytest.raises(ValueError, match=r"^position of pose 1 of the path\[2\] must be within 1e\+09 m of zero"):
            make(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, far]]))
    with pytest.raises(InvalidTransformError, match=r"expected a translation within 1e\+09 m of zero, got \(0.0, "):
        Transform((0.0, far, 0.0))


def test_what_a_transform_takes_beyond_the_bound_is_an_error_of_transforms():
    T_map_odom = Transform((9e8, 0.0, 0.0), parent="map", child="odom")
    pose = Pose((9e8, 9e8, -9e8), frame_id="odom")
    for apply, value in ((T_map_odom.apply_to_pose, pose), (T_map_odom.apply_to_path, Path.from_poses([pose]))):
        with pytest.raises(InvalidTransformError, match=r"^transform 'map' -> 'odom': position"):
            apply(value)


def test_a_quaternion_off_unit_length_by_more_than_a_hundredth_is_refused():
    Pose((0, 0, 0), (0.0, 0.0, 0.0, 1.004))
    with pytest.raises(ValueError, match="squared norm"):
        Pose((0, 0, 0), (0.0, 0.0, 0.0, 1.01))
    with pytest.raises(ValueError, match="orientation of pose 0"):
        Path(np.zeros((1, 3)), np.zeros((1, 4)))


def test_poses_of_a_path_must_share_a_frame():
    with pytest.raises(ValueError, match="'map', 'odom'"):
        Path.from_poses([Pose.planar(0, 0), Pose.planar(1, 0, frame_id="odom")])


def test_a_standing_car_may_keep_its_wheels_turned():
    assert AckermannCommand(0.0, 0.4).is_stopped()
    assert not AckermannCommand(0.1, 0.0).is_stopped()
    assert Twist.planar(0.001, 0.0, 0.001).is_stopped()
    assert not Twist.planar(wz=0.01).is_stopped()


def test_a_pose_is_printed_as_place_heading_and_frame():
    assert str(Pose.planar(1.0, 2.006, 0.5, frame_id="odom")) == "(1.00, 2.01, 0.00) m, yaw 0.50 rad, in 'odom'"
