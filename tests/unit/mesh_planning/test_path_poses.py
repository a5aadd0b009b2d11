"""Poses along a path on the surface: which points are kept, and the orientations there."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from mbf_abstract.geometry import quaternions_from_axes
from mbf_mesh_nav.kernels.motion.path_poses import poses_along


@given(seed=st.integers(0, 10**6))
@settings(max_examples=30, deadline=None)
def test_every_pose_but_the_last_equals_the_frame_of_normal_and_way_ahead(seed):
    rng = np.random.default_rng(seed)
    positions, normals = rng.normal(size=(2, 12, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    ahead = np.diff(positions, axis=0)
    expected = quaternions_from_axes(ahead, normals[:-1])
    _, found = poses_along(positions, normals, 1e-6)
    same_sign = np.sign(np.sum(found[:-1] * expected, axis=1, keepdims=True))
    np.testing.assert_allclose(found[:-1] * same_sign, expected, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0)


def test_a_way_straight_up_the_normal_still_gives_a_pose():
    _, found = poses_along(np.array([[0.0, 0, 0], [0, 0, 1]]), np.array([[0.0, 0, 1], [0, 0, 1]]), 1e-6)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0)


@given(seed=st.integers(0, 10**6))
@settings(max_examples=30, deadline=None)
def test_only_inner_points_that_repeat_their_forerunner_or_end_where_the_way_ends_are_dropped(seed):
    rng = np.random.default_rng(seed)
    positions = rng.integers(0, 2, (rng.integers(2, 12), 3)).astype(float)
    kept = [positions[0]]
    for position in positions[1:-1]:
        if np.linalg.norm(position - kept[-1]) > 1e-6:
            kept.append(position)
    while len(kept) > 1 and np.linalg.norm(kept[-1] - positions[-1]) <= 1e-6:
        kept.pop()
    found, orientations = poses_along(positions, np.tile([0.0, 0.0, 1.0], (len(positions), 1)), 1e-6)
    np.testing.assert_array_equal(found, [*kept, positions[-1]])
    assert len(orientations) == len(found)


def test_a_way_that_passes_the_place_where_it_ends_keeps_its_course_there():
    way = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.5], [2.0, 0.0, 0.0], [1.0, 0.0, 0.5]])
    found, _ = poses_along(way, np.tile([0.0, 0.0, 1.0], (4, 1)), 1e-6)
    np.testing.assert_array_equal(found, way)
