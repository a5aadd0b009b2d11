"""Poses along a path on the surface: which points are kept, and the orientations there."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from mbf_abstract.geometry import quaternions_from_axes
from mbf_mesh_nav.kernels.motion.path_poses import points_on_branch, poses_along


@given(seed=st.integers(0, 10**6))
@settings(max_examples=30, deadline=None)
def test_every_pose_but_the_last_equals_the_frame_of_normal_and_way_ahead(seed):
    rng = np.random.default_rng(seed)
    positions, normals = rng.normal(size=(2, 12, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    ahead = np.diff(positions, axis=0)
    expected = quaternions_from_axes(ahead, normals[:-1])
    _, found, _ = poses_along(positions, normals, 1e-6)
    same_sign = np.sign(np.sum(found[:-1] * expected, axis=1, keepdims=True))
    np.testing.assert_allclose(found[:-1] * same_sign, expected, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0)


def test_a_way_straight_up_the_normal_still_gives_a_pose():
    _, found, _ = poses_along(np.array([[0.0, 0, 0], [0, 0, 1]]), np.array([[0.0, 0, 1], [0, 0, 1]]), 1e-6)
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
    found, orientations, _ = poses_along(positions, np.tile([0.0, 0.0, 1.0], (len(positions), 1)), 1e-6)
    np.testing.assert_array_equal(found, [*kept, positions[-1]])
    assert len(orientations) == len(found)


def test_a_way_that_passes_the_place_where_it_ends_keeps_its_course_there():
    way = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.5], [2.0, 0.0, 0.0], [1.0, 0.0, 0.5]])
    found, _, _ = poses_along(way, np.tile([0.0, 0.0, 1.0], (4, 1)), 1e-6)
    np.testing.assert_array_equal(found, way)


def test_poses_are_sound_where_positions_are_finite_and_quaternions_of_unit_length():
    way, up = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.5], [2.0, 0.0, 0.0]]), np.tile([0.0, 0.0, 1.0], (3, 1))
    assert poses_along(way, up, 1e-6)[2]
    for place, axis in np.ndindex(3, 3):
        for wrong in (np.nan, np.inf):
            for arrays in ((way.copy(), up), (way, up.copy())):
                arrays[0 if arrays[1] is up else 1][place, axis] = wrong
                positions, orientations, sound = poses_along(*arrays, 1e-6)
                norms = np.linalg.norm(orientations, axis=1)
                assert not sound or (np.isfinite(positions).all() and np.allclose(norms, 1.0))


def test_a_branch_leads_from_a_vertex_to_its_seed_with_room_at_both_ends():
    vertices, normals = np.random.default_rng(1).normal(size=(2, 6, 3))
    predecessors, chain = np.array([-1, 3, 0, 0, 1, -1], dtype=np.int32), [4, 1, 3, 0]
    for turned, expected in ((False, chain), (True, chain[::-1])):
        positions, found = points_on_branch(predecessors, 4, vertices, normals, turned)
        np.testing.assert_array_equal(positions[1:-1], vertices[expected])
        np.testing.assert_array_equal(found[1:-1], normals[expected])
    assert len(points_on_branch(predecessors, 5, vertices, normals, False)[0]) == 3
