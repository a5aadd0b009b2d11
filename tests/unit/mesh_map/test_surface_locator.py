"""Nearest surface points and rays against brute force over all faces."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mbf_mesh_nav.kernels.mesh.bounding_boxes import closest_on_face
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh


def random_soup(seed: int, count: int = 40, stretch: float = 1.0) -> MeshMap:
    rng = np.random.default_rng(seed)
    corners = rng.random((count, 1, 3)) * 4.0 + rng.normal(0.0, 0.5, (count, 3, 3)) * [stretch, 1.0, 0.05]
    return MeshMap.from_arrays(corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3), repair=["facing_down"])


def naive_distance(mesh: MeshMap, point: np.ndarray) -> float:
    """Distance to every face by dense sampling-free projection: inside the face, else to its three edges."""
    best = np.inf
    for a, b, c in mesh.vertices[mesh.faces]:
        normal = np.cross(b - a, c - a)
        normal /= np.linalg.norm(normal)
        foot = point - normal * (normal @ (point - a))
        sides = [np.cross(q - p, foot - p) @ normal for p, q in ((a, b), (b, c), (c, a))]
        if min(sides) >= 0.0:
            best = min(best, np.linalg.norm(point - foot))
        for p, q in ((a, b), (b, c), (c, a)):
            along = np.clip((point - p) @ (q - p) / ((q - p) @ (q - p)), 0.0, 1.0)
            best = min(best, np.linalg.norm(point - p - along * (q - p)))
    return best


@settings(deadline=None, max_examples=10)
@given(st.integers(0, 10_000), st.sampled_from([1.0, 0.01, 20.0]))
def test_nearest_point_is_that_of_a_search_over_all_faces(seed, stretch):
    mesh = random_soup(seed, stretch=stretch)
    queries = np.random.default_rng(seed + 1).uniform(-1.0, 5.0, (20, 3))

    found = mesh.locate(queries)

    for index, query in enumerate(queries):
        assert found.distances[index] == pytest.approx(naive_distance(mesh, query), abs=1e-9)
        blended = found.barycentric[index] @ mesh.vertices[mesh.faces[found.faces[index]]]
        np.testing.assert_allclose(found.points[index], blended, atol=1e-9)
        assert np.linalg.norm(found.points[index] - query) == pytest.approx(found.distances[index], abs=1e-9)


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 10_000), st.integers(-1, 39))
def test_one_point_with_any_hint_gives_the_batch_answer(seed, hint):
    mesh = random_soup(seed)
    query = np.random.default_rng(seed).uniform(-1.0, 5.0, 3)

    one, batch = mesh.locate_one(query, hint_face=hint), mesh.locate(query[None])

    assert one is not None
    assert one.distance == pytest.approx(batch.distances[0], abs=1e-12)
    np.testing.assert_allclose(one.point, batch.points[0], atol=1e-9)


def test_sorted_batches_answer_in_the_order_of_the_questions():
    mesh = random_soup(2)
    queries = np.random.default_rng(3).uniform(0.0, 4.0, (300, 3))

    many = mesh.locate(queries)

    for index in (0, 7, 299):
        assert many.distances[index] == mesh.locate(queries[index][None]).distances[0]


def test_distance_limit_is_inclusive_and_beyond_it_there_is_no_face():
    mesh = MeshMap.from_heights(np.zeros((3, 3)), 1.0, 1.0)

    assert mesh.locate_one([1.2, 0.7, 0.5], 0.5) is not None
    assert mesh.locate_one([1.2, 0.7, 0.5], 0.49) is None
    limited = mesh.locate([[1.2, 0.7, 0.5], [1.2, 0.7, 0.1]], 0.3)
    assert limited.faces[0] == -1
    assert limited.distances[0] == np.inf
    assert limited.faces[1] >= 0


def test_point_on_the_upper_storey_is_located_there():
    vertices, faces = heightfield_mesh(np.zeros((3, 3)), 1.0, 1.0)
    mesh = MeshMap.from_arrays(np.vstack([vertices, vertices + np.array([0, 0, 2.5])]), np.vstack([faces, faces + 9]))

    assert mesh.locate_one([0.6, 0.3, 2.4]).point[2] == 2.5
    assert mesh.locate_one([0.6, 0.3, 0.3]).point[2] == 0.0


def test_point_amid_a_skinny_triangle_is_found_although_its_corners_are_far():
    vertices = np.array([[0.0, 0, 0], [100.0, 0, 0], [50.0, 0.1, 0], [50.0, 2.0, 0], [49.0, 2.0, 0]])
    mesh = MeshMap.from_arrays(vertices, np.array([[0, 1, 2], [2, 3, 4]]))

    found = mesh.locate_one([20.0, 0.02, 0.01], 0.05)

    assert mesh.topology.internal_to_input_faces[found.face] == 0


def test_face_regions_of_the_closest_point_cover_corners_edges_and_inside():
    vertices = np.array([[0.0, 0, 0], [1.0, 0, 0], [0.0, 1, 0]])
    faces = np.array([[0, 1, 2]], dtype=np.int32)
    cases = [((-1, -1), 0, 0), ((2, -1), 1, 0), ((-1, 2), 0, 1), ((0.5, -1), 0.5, 0), ((-1, 0.5), 0, 0.5)]
    for (x, y), v, w in [*cases, ((1, 1), 0.5, 0.5), ((0.2, 0.3), 0.2, 0.3)]:
        assert closest_on_face(vertices, faces, 0, float(x), float(y), 0.0)[1:] == pytest.approx((v, w))


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 10_000), st.sampled_from([3.0, np.inf]))
def test_first_hits_are_those_of_a_search_over_all_faces(seed, limit):
    mesh = random_soup(seed)
    rng = np.random.default_rng(seed)
    origins, directions = rng.uniform(-1.0, 5.0, (20, 3)), rng.normal(size=(20, 3))
    directions[:5] = [[0, 0, -1], [0, 0, 1], [1, 0, 0], [0, -1, 0], [-1, 0, 0]]
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)

    faces, distances = mesh.locator.cast_rays(origins, directions, limit)

    for index in range(20):
        expected = naive_hit(mesh, origins[index], directions[index], limit)
        assert distances[index] == pytest.approx(expected, abs=1e-9)
        assert (faces[index] >= 0) == np.isfinite(expected)


def naive_hit(mesh: MeshMap, origin: np.ndarray, direction: np.ndarray, limit: float) -> float:
    best = np.inf
    for a, b, c in mesh.vertices[mesh.faces]:
        v, w, distance = np.linalg.solve(np.column_stack([b - a, c - a, -direction]), origin - a)
        if v >= 0 and w >= 0 and v + w <= 1 and 0 <= distance <= limit:
            best = min(best, distance)
    return best


def test_vertical_rays_between_faces_do_not_slip_through_the_edges():
    mesh = MeshMap.from_heights(np.random.default_rng(0).random((20, 20)), 0.1, 0.1)
    above = mesh.vertices + np.array([0.0, 0.0, 2.0])

    faces, distances = mesh.locator.cast_rays(above, [0.0, 0.0, -1.0])

    assert (faces >= 0).all()
    np.testing.assert_allclose(distances, 2.0, atol=1e-9)


@pytest.mark.parametrize(("scale", "offset"), [(1e-3, 0.0), (1.0, 1e4)])
def test_queries_do_not_depend_on_scale_and_offset(scale, offset):
    heights = np.random.default_rng(4).random((8, 8))
    plain = MeshMap.from_heights(heights, 0.5, 0.5)
    moved = MeshMap.from_arrays(plain.vertices * scale + offset, plain.faces)
    queries = np.random.default_rng(5).random((50, 3)) * 3.0

    expected, found = plain.locate(queries), moved.locate(queries * scale + offset)

    np.testing.assert_allclose(found.distances, expected.distances * scale, atol=1e-10)


def test_points_given_as_columns_are_refused_instead_of_taken_for_others():
    mesh = MeshMap.from_heights(np.zeros((4, 5)), 1.0, 1.0)
    columns = np.zeros((3, 6))
    for question in (lambda: mesh.locate(columns), lambda: mesh.locator.cast_rays(columns, [0.0, 0.0, -1.0])):
        with pytest.raises(ValueError, match=r"an array \(n, 3\) of coordinates, got one of shape \(3, 6\)"):
            question()
    assert len(mesh.locate([]).faces) == 0 and len(mesh.locate([1.0, 1.0, 0.0]).faces) == 1
