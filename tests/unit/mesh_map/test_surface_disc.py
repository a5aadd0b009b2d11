"""The part of the surface under a round robot: against a plain search, and for what it costs on a large map."""

import time

import numpy as np
import pytest

from mbf_mesh_nav.kernels.mesh.surface_disc import FIRST_BITS, vertices_in_disc
from mbf_mesh_nav.map.mesh_map import MeshMap

SPACING = 0.1


@pytest.fixture(scope="module", params=[0, 1])
def rough(request):
    rng = np.random.default_rng(request.param)
    return MeshMap.from_heights(rng.uniform(0.0, 0.3, (60, 50)), SPACING, SPACING).topology


def plain_search(vertices, offsets, neighbours, start, centre, radius):
    members, seen = [start], {start}
    for vertex in members:
        for other in neighbours[offsets[vertex] : offsets[vertex + 1]].tolist():
            if other not in seen and ((vertices[other] - centre) ** 2).sum() <= radius**2:
                members.append(other)
                seen.add(other)
    return members


@pytest.mark.parametrize("radius", [0.0, 0.15, 0.4, 1.0, 2.5, 50.0])
def test_a_disc_has_the_vertices_of_a_plain_search_in_their_order(rough, radius):
    graph = rough.vertices, rough.neighbour_offsets, rough.neighbours
    rng = np.random.default_rng(7)
    for start in rng.integers(0, rough.vertex_count, 20).tolist():
        centre = rough.vertices[start] + rng.uniform(-0.05, 0.05, 3)
        found = vertices_in_disc(*graph, start, centre, radius)
        assert found.dtype == np.int32
        assert found.tolist() == plain_search(*graph, start, centre, radius)


def test_a_disc_as_large_as_the_map_is_all_of_it(rough):
    found = vertices_in_disc(rough.vertices, rough.neighbour_offsets, rough.neighbours, 3, rough.vertices[3], np.inf)
    assert len(found) == rough.vertex_count > 2**FIRST_BITS  # so the table has grown
    assert sorted(found.tolist()) == list(range(rough.vertex_count))


def test_a_disc_does_not_include_the_other_side_of_a_gap():
    vertices = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [5.0, 0.0, 0.0], [0.2, 0.0, 0.0]])
    offsets, neighbours = np.array([0, 1, 3, 5, 6], dtype=np.int32), np.array([1, 0, 2, 1, 3, 2], dtype=np.int32)
    assert vertices_in_disc(vertices, offsets, neighbours, 0, vertices[0], 1.0).tolist() == [0, 1]


def test_a_disc_costs_nothing_for_the_rest_of_the_map():
    def seconds(vertex_count):
        vertices = np.zeros((vertex_count, 3))  # memory that nobody touches is none
        graph = vertices, np.zeros(vertex_count + 1, dtype=np.int32), np.zeros(1, dtype=np.int32)
        times = []
        for _ in range(5):
            begin = time.thread_time()
            assert vertices_in_disc(*graph, 0, vertices[0], 1.0).tolist() == [0]
            times.append(time.thread_time() - begin)
        return min(times)

    assert seconds(20_000_000) < 20.0 * seconds(100)  # an array as long as the map: 100 times
