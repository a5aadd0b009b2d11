"""Walking over edges: straight on a plane, geodesic on shapes with known geodesics, stopped by borders."""

import math

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from mbf_mesh_nav.kernels.mesh.surface_walk import tangent, turned, walk
from mbf_mesh_nav.map.mesh_map import MeshMap


def step(mesh_map, face, point, direction, distance):
    arrays = (mesh_map.vertices, mesh_map.faces, mesh_map.face_neighbours, mesh_map.face_normals)
    return walk(*arrays, face, point, direction, distance)


def begin(mesh_map, position, direction):
    spot = mesh_map.locate_one(position)
    normal = tuple(mesh_map.face_normals[spot.face])
    return spot.face, tuple(spot.point), tangent(tuple(map(float, direction)), normal)


@given(x=st.floats(0.5, 5.5), y=st.floats(0.5, 5.5), angle=st.floats(-3.1, 3.1), distance=st.floats(0.0, 0.5))
@settings(max_examples=50, deadline=None)
def test_on_a_plane_the_walk_is_a_straight_line(flat_field, x, y, angle, distance):
    direction = (math.cos(angle), math.sin(angle), 0.0)
    face, point, after, walked = step(flat_field, *begin(flat_field, (x, y, 0.0), direction), distance)
    assert walked == pytest.approx(distance)
    np.testing.assert_allclose(point, (x + distance * direction[0], y + distance * direction[1], 0.0), atol=1e-9)
    np.testing.assert_allclose(after, direction, atol=1e-9)
    assert flat_field.locate([point]).distances[0] < 1e-9
    corners = flat_field.vertices[flat_field.faces[face]]
    assert (corners.min(axis=0) - 1e-9 <= point).all() and (point <= corners.max(axis=0) + 1e-9).all()


@pytest.fixture(scope="module")
def flat_field():
    return MeshMap.from_heights(np.zeros((31, 31)), 0.2, 0.2)


def test_there_and_back_over_hills_ends_where_it_began(hills):
    face, point, direction = begin(hills, (1.0, 1.0, 0.0), (1.0, 0.7, 0.0))
    far_face, far_point, far_direction, walked = step(hills, face, point, direction, 4.0)
    assert walked == 4.0 and np.linalg.norm(np.subtract(far_point, point)) > 3.0
    back = tuple(-value for value in far_direction)
    _, home, _, _ = step(hills, far_face, far_point, back, 4.0)
    np.testing.assert_allclose(home, point, atol=1e-8)


def test_once_around_a_sphere_comes_back(shared_data):
    mesh = trimesh.load(shared_data / "meshes/mesh_mppi/sphere.ply", process=False)
    sphere = MeshMap.from_arrays(mesh.vertices, mesh.faces)
    face, point, direction = begin(sphere, (2.0, 0.01, 0.02), (0.0, 1.0, 0.3))
    reached = [point]
    for _ in range(40):
        face, point, direction, _ = step(sphere, face, point, direction, 2 * math.pi * 2.0 / 40)
        reached.append(point)
    assert np.abs(np.linalg.norm(reached, axis=1) - 2.0).max() < 0.01
    assert np.linalg.norm(np.subtract(reached[-1], reached[0])) < 0.05


def test_a_border_stops_the_walk(flat_field):
    _, point, _, walked = step(flat_field, *begin(flat_field, (5.0, 3.0, 0.0), (1.0, 0.0, 0.0)), 3.0)
    assert walked == pytest.approx(1.0)
    np.testing.assert_allclose(point, (6.0, 3.0, 0.0), atol=1e-9)


def test_four_quarter_turns_are_a_full_one():
    direction, normal = tangent((1.0, 0.0, 0.0), (0.0, -0.6, 0.8)), (0.0, -0.6, 0.8)
    facing = direction
    for _ in range(4):
        facing = turned(facing, normal, math.pi / 2)
    np.testing.assert_allclose(facing, direction, atol=1e-12)
