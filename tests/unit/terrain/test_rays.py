"""The tree of boxes finds what a look at every triangle finds."""

import math

import numpy as np
import pytest

from terrain.sensors.rays import StaticRays


def first_hit_of_all(vertices, faces, origin, direction, max_range):
    """Distance to the first triangle, each looked at by solving three equations."""
    best = math.inf
    for a, b, c in vertices[faces]:
        matrix = np.column_stack([b - a, c - a, -direction])
        if abs(np.linalg.det(matrix)) < 1e-12:
            continue
        v, w, distance = np.linalg.solve(matrix, origin - a)
        if v >= 0.0 and w >= 0.0 and v + w <= 1.0 and 0.0 <= distance <= max_range:
            best = min(best, distance)
    return best


@pytest.mark.parametrize("count", [1, 7, 8, 9, 64, 65, 300, 600])
def test_the_tree_finds_what_a_look_at_every_triangle_finds(count):
    rng = np.random.default_rng(count)
    vertices = rng.uniform(-5.0, 5.0, (count, 1, 3)) + rng.normal(0.0, 1.0, (count, 3, 3))
    vertices, faces = vertices.reshape(-1, 3), np.arange(3 * count, dtype=np.int32).reshape(-1, 3)
    origins, directions = rng.uniform(-6.0, 6.0, (200, 3)), rng.normal(size=(200, 3))
    directions[:3] = np.eye(3)  # along the sides of the boxes
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    found = StaticRays(vertices, faces).distances(origins, directions, 8.0)
    for ray, (origin, direction) in enumerate(zip(origins, directions, strict=True)):
        expected = first_hit_of_all(vertices, faces, origin, direction, 8.0)
        assert found[ray] == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("max_range", [3.0, math.inf])
def test_how_the_tree_is_cut_changes_no_bit_of_a_range(max_range):
    rng = np.random.default_rng(5)
    vertices = (rng.uniform(-5.0, 5.0, (3000, 1, 3)) + rng.normal(0.0, 0.2, (3000, 3, 3))).reshape(-1, 3)
    faces = np.arange(9000, dtype=np.int32).reshape(-1, 3)
    origins, directions = rng.uniform(-6.0, 6.0, (500, 3)), rng.normal(size=(500, 3))
    directions[:9] = np.concatenate([np.eye(3), -np.eye(3), [[1.0, 1, 1], [-1.0, 1, 1], [0.0, -1, 1]]])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    whole = StaticRays(vertices, faces).distances(origins, directions, max_range)
    shuffled = StaticRays(vertices, rng.permutation(faces)).distances(origins, directions, max_range)
    parts = [
        StaticRays(vertices, faces[k : k + 8]).distances(origins, directions, max_range) for k in range(0, 3000, 8)
    ]
    assert 50 < np.isfinite(whole).sum() < 500
    assert np.array_equal(whole, shuffled) and np.array_equal(whole, np.min(parts, axis=0))


def test_no_ray_slips_through_between_two_triangles():
    xs, ys = np.meshgrid(np.arange(12.0), np.arange(12.0), indexing="ij")
    vertices = np.column_stack([xs.ravel(), ys.ravel(), np.sin(xs + 2.0 * ys).ravel()])
    corner = np.arange(144).reshape(12, 12)
    a, b, c, d = (part.ravel() for part in (corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]).astype(np.int32)
    # straight down onto every corner, and onto the middle of every diagonal
    targets = np.concatenate([vertices[corner[1:-1, 1:-1].ravel()], (vertices[a] + vertices[c]) / 2.0])
    origins = targets + np.array([0.0, 0.0, 5.0])
    down = np.tile([0.0, 0.0, -1.0], (len(targets), 1))
    assert StaticRays(vertices, faces).distances(origins, down, 10.0) == pytest.approx(5.0, abs=1e-6)


def test_triangles_without_area_are_no_obstacles():
    vertices = np.array([[1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, -1, -1], [2.0, 3, -1], [2.0, -1, 3]])
    faces = np.array([[0, 1, 2], [3, 4, 5]], dtype=np.int32)
    assert StaticRays(vertices, faces).distances(np.zeros((1, 3)), np.array([[1.0, 0, 0]]), 9.0).tolist() == [2.0]
