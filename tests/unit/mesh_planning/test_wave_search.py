"""Waves over a mesh whose costs change between two of them."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from mbf_mesh_nav.kernels.mesh.corners import build_corner_ends, write_corner_weights
from mbf_mesh_nav.map.layer import NOTHING_CHANGED
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.mesh.surface_point import surface_point_at_vertex
from mbf_mesh_nav.search.leg_search import LegQuery
from mbf_mesh_nav.search.wave_search import WaveSearch


def query_between_corners(mesh_map):
    snapshot = mesh_map.snapshot()
    order = mesh_map.vertices[:, :2].sum(axis=1).argsort()
    start, goal = (surface_point_at_vertex(mesh_map, int(vertex)) for vertex in order[[-1, 0]])
    return LegQuery(start, goal, snapshot, snapshot.blocked(1.0), np.zeros(1, np.uint8))


def change_some_costs(mesh_map, rng):
    layer = mesh_map.layers["painted"]
    costs = np.where(rng.random(len(layer.costs)) < 0.1, rng.random(len(layer.costs)), layer.costs).astype(np.float32)
    changed = layer.replace(costs, layer.lethal.copy())
    mesh_map.apply(lambda visited: changed if visited is layer else NOTHING_CHANGED)


@settings(deadline=None, max_examples=15)
@given(st.integers(0, 10_000))
def test_after_any_changes_of_costs_the_wave_equals_that_of_a_new_search(paint, seed):
    rng = np.random.default_rng(seed)
    mesh_map = MeshMap.from_heights(np.zeros((11, 11)), 0.2, 0.2)
    paint(mesh_map, lambda v: rng.random(len(v)), edge_cost_factor=2.0)
    search = WaveSearch(mesh_map)
    for _ in range(4):
        for _ in range(rng.integers(3)):
            change_some_costs(mesh_map, rng)
        if rng.random() < 0.2:
            mesh_map.set_edge_cost_factor(1.0)  # what changed is not remembered
        query = query_between_corners(mesh_map)

        wave = search.propagate(query, 100.0)

        np.testing.assert_array_equal(wave.distances, WaveSearch(mesh_map).propagate(query, 100.0).distances)


def obtuse_corners_around(ends, weights, first_records):
    """The twin: for each vertex whether a record of its own has an obtuse corner at one of its two other ends."""
    to_first, to_second, between = np.square(weights).T
    at_second = to_first > np.float32(1.2) * (to_second + between)
    at_first = to_second > np.float32(1.2) * (to_first + between)
    return np.logical_or.reduceat(at_first | at_second, first_records)


def test_where_corners_are_obtuse_is_known_wherever_weights_have_changed():
    rng = np.random.default_rng(5)
    mesh_map = MeshMap.from_heights(rng.normal(0.0, 0.1, (12, 12)), 0.3, 0.2)
    ends = build_corner_ends(mesh_map.faces, mesh_map.vertex_face_offsets, mesh_map.vertex_faces)
    weights, obtuse_around = np.empty((len(ends), 3), np.float32), np.empty(len(mesh_map.vertices), bool)
    a, b = np.repeat(np.arange(144), np.diff(mesh_map.neighbour_offsets)), mesh_map.neighbours
    costs, changed = np.zeros(144, np.float32), np.arange(144, dtype=np.int32)
    for _ in range(5):
        edge_weights = mesh_map.neighbour_lengths * (1.0 + costs[a] + costs[b]).astype(np.float32)
        write_corner_weights(
            mesh_map.vertex_face_offsets, ends, mesh_map.neighbour_offsets, mesh_map.neighbours, edge_weights,
            changed, weights, obtuse_around, np.zeros(1, np.uint8),
        )  # fmt: skip

        expected = obtuse_corners_around(ends, weights, mesh_map.vertex_face_offsets[:-1])
        np.testing.assert_array_equal(obtuse_around, expected)
        assert 0 < expected.sum() < 144
        changed = rng.choice(144, 20, replace=False).astype(np.int32)
        costs[changed] = rng.random(20)


def test_a_field_is_read_with_the_weights_its_wave_was_spread_on(plain, paint):
    # Two threads may plan with one planner: between wave and field of one the other asks for newer weights.
    mesh_map = paint(plain(), lambda v: 0.9 * (np.abs(v[:, 0] - 3.0) < 1.0), edge_cost_factor=3.0)
    search, query = WaveSearch(mesh_map), query_between_corners(mesh_map)
    wave = search.propagate(query, 100.0)
    expected = WaveSearch(mesh_map).field(query, wave)
    change_some_costs(mesh_map, np.random.default_rng(0))
    other = search.propagate(query_between_corners(mesh_map), 100.0)

    field = search.field(query, wave)

    np.testing.assert_array_equal(field.directions, expected.directions)
    assert not np.array_equal(wave.distances, other.distances)
