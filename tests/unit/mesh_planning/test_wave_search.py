"""Waves over a mesh whose costs change between two of them."""

import numpy as np

from mbf_mesh_nav.leg_search import LegQuery
from mbf_mesh_nav.surface_point import surface_point_at_vertex
from mbf_mesh_nav.wave_search import WaveSearch


def query_between_corners(mesh_map):
    snapshot = mesh_map.snapshot()
    order = mesh_map.vertices[:, :2].sum(axis=1).argsort()
    start, goal = (surface_point_at_vertex(mesh_map, int(vertex)) for vertex in order[[-1, 0]])
    return LegQuery(start, goal, snapshot, snapshot.blocked(1.0), np.zeros(1, np.uint8))


def test_a_field_is_read_with_the_weights_its_wave_was_spread_on(plain, paint):
    # Two threads may plan with one planner: between wave and field of one the other asks for other weights.
    mesh_map = paint(plain(), lambda v: 0.9 * (np.abs(v[:, 0] - 3.0) < 1.0), edge_cost_factor=3.0)
    search, query = WaveSearch(mesh_map), query_between_corners(mesh_map)
    wave = search.spread(query, 100.0)
    expected = WaveSearch(mesh_map).field(query, wave)
    paint(mesh_map, lambda v: 0.9 * (np.abs(v[:, 1] - 3.0) < 1.0), edge_cost_factor=3.0)
    other = search.spread(query_between_corners(mesh_map), 100.0)

    field = search.field(query, wave)

    np.testing.assert_array_equal(field.directions, expected.directions)
    assert not np.array_equal(wave.distances, other.distances)
