"""Where rollouts on the surface lead: against single steps of the walk, on a slope, into a wall and over its border."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mbf_mesh_nav.kernels.mesh.surface_walk import tangent, turned, walk
from mbf_mesh_nav.kernels.motion.mppi import Critics, PathAhead, SurfacePose, score_rollouts
from mbf_mesh_nav.map.mesh_map import MeshMap

PERIOD = 0.1
WALL_X = 4.0  # [m]; beyond is forbidden ground


@pytest.fixture(scope="module")
def slope():
    """6 m x 6 m, as steep along x as along y."""
    along = np.arange(31) * 0.2
    return MeshMap.from_heights(0.3 * (along[:, None] + along[None, :]), 0.2, 0.2)


def rolled_out(mesh_map, begin, yaw, controls, steps):
    """Scores, collisions and poses of rollouts from a place; no poses with 0 steps."""
    spot = mesh_map.locate_one(begin)
    normal = tuple(mesh_map.face_normals[spot.face])
    heading = tangent((math.cos(yaw), math.sin(yaw), 0.0), normal)
    ranks = np.where(mesh_map.vertices[:, 0] > WALL_X, 1.0, 0.0).astype(np.float32)
    path = np.column_stack([np.linspace(2.0, 5.0, 30), np.full(30, 3.0), np.linspace(1.5, 2.4, 30)])
    poses = np.full((3, steps, len(controls)), np.nan, dtype=np.float32)
    scores, collided = score_rollouts(
        mesh_map.topology.surface, np.zeros(len(mesh_map.vertices), dtype=np.float32), ranks,
        SurfacePose(spot.face, tuple(map(float, spot.point)), heading), controls, PERIOD,
        PathAhead(path, np.linspace(3.0, 0.0, 30), 1.0), Critics(np.ones(6), 0.4, 0.5), poses,
    )  # fmt: skip
    return (spot, heading), scores, collided, poses


def naive(mesh_map, spot, heading, controls):
    """Poses (t, 3) of one rollout, relative to its start, as far as it leads over ground without a wall."""
    arrays = mesh_map.vertices, mesh_map.faces, mesh_map.face_neighbours, mesh_map.face_normals
    face, point, direction, poses = spot.face, tuple(spot.point), heading, []
    for speed, yaw_rate in controls:
        direction = np.array(turned(direction, tuple(mesh_map.face_normals[face]), yaw_rate * PERIOD))
        sign = 1.0 if speed >= 0.0 else -1.0
        way = tuple(sign * direction)
        face, point, way, _ = walk(*arrays, face, point, way, abs(speed) * PERIOD)
        direction = tuple(sign * np.array(way))
        poses.append((point[0] - spot.point[0], point[1] - spot.point[1], math.atan2(direction[1], direction[0])))
    return np.array(poses)


controls = st.lists(
    st.lists(st.tuples(st.floats(-0.8, 0.8), st.floats(-2.0, 2.0)), min_size=12, max_size=12), min_size=1, max_size=3
)


@given(controls, st.floats(-3.0, 3.0))
@settings(max_examples=40, deadline=None)
def test_noted_poses_are_those_of_single_steps_on_a_slope(slope, sequences, yaw):
    (spot, heading), _, collided, poses = rolled_out(slope, (2.7, 2.9, 1.7), yaw, np.array(sequences), 12)
    assert not collided.any()
    for sample, sequence in enumerate(sequences):
        np.testing.assert_allclose(poses[:, :, sample].T, naive(slope, spot, heading, sequence), atol=1e-5)


@pytest.mark.parametrize(("x", "yaw", "limit"), [(3.2, 0.0, WALL_X), (0.5, math.pi, 0.0)])
def test_a_rollout_that_collides_stays_where_it_does(slope, x, yaw, limit):
    on = np.array([[(1.0, 0.0)] * 20, [(0.1, 0.0)] * 20])
    (spot, _), _, collided, poses = rolled_out(slope, (x, 3.0, 1.8), yaw, on, 20)
    assert collided.tolist() == [True, False]
    moved = np.abs(np.diff(poses[0, :, 0])) > 1e-6
    last = int(np.flatnonzero(moved)[-1]) + 1
    assert 2 < last < 15 and not moved[last:].any(), "it goes on until it collides, and no farther"
    assert abs(spot.point[0] + poses[0, -1, 0] - limit) < 0.3
    assert np.isfinite(poses).all()


@given(controls, st.floats(-3.0, 3.0))
@settings(max_examples=20, deadline=None)
def test_scores_are_the_same_bytes_whether_poses_are_wanted_or_not(slope, sequences, yaw):
    _, scores, collided, _ = rolled_out(slope, (3.5, 2.9, 1.9), yaw, np.array(sequences), 12)
    _, plain, plain_collided, _ = rolled_out(slope, (3.5, 2.9, 1.9), yaw, np.array(sequences), 0)
    assert scores.tobytes() == plain.tobytes() and collided.tobytes() == plain_collided.tobytes()
