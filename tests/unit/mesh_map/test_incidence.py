"""Adjacency and groups against SciPy's sparse arrays and graphs."""

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import Delaunay

from mbf_mesh_nav.kernels.mesh.incidence import faces_of_vertices, neighbours_of_vertices
from mbf_mesh_nav.mesh.topology import group_of_each


def random_faces(seed: int, vertex_count: int = 300):
    """Triangles over random points in a random order, a third of them left out, so that there are holes and islands."""
    random = np.random.default_rng(seed)
    faces = Delaunay(random.uniform(size=(vertex_count, 2))).simplices.astype(np.int32)
    return np.ascontiguousarray(random.permutation(faces)[: 2 * len(faces) // 3])


@pytest.mark.parametrize("seed", range(5))
def test_the_faces_of_a_vertex_are_those_that_name_it_in_ascending_order(seed):
    faces = random_faces(seed)
    offsets, incident = faces_of_vertices(faces, 310)  # ten vertices without a face
    assert offsets.dtype == incident.dtype == np.int32 and len(offsets) == 311
    for vertex in range(310):
        expected = np.flatnonzero((faces == vertex).any(axis=1))
        assert incident[offsets[vertex] : offsets[vertex + 1]].tolist() == expected.tolist()


@pytest.mark.parametrize("seed", range(5))
def test_neighbours_are_those_of_a_symmetric_sparse_array(seed):
    faces = random_faces(seed)
    starts, ends = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    once = coo_array((np.ones(faces.size, dtype=np.int8), (starts, ends)), shape=(310, 310)).tocsr()
    expected = once + once.T
    expected.sort_indices()
    offsets, neighbours = neighbours_of_vertices(faces, *faces_of_vertices(faces, 310))
    assert offsets.dtype == neighbours.dtype == np.int32
    assert offsets.tolist() == expected.indptr.tolist()
    assert neighbours.tolist() == expected.indices.tolist()


def test_a_hub_of_many_faces_and_faces_that_overlap_name_each_neighbour_once():
    rim = np.arange(1, 2001, dtype=np.int32)
    fan = np.stack([np.zeros(2000, dtype=np.int32), rim, np.roll(rim, -1)], axis=1)
    faces = np.ascontiguousarray(np.concatenate([fan, fan[::-1, ::-1]]))
    offsets, neighbours = neighbours_of_vertices(faces, *faces_of_vertices(faces, 2001))
    assert neighbours[: offsets[1]].tolist() == rim.tolist()
    assert np.diff(offsets)[1:].tolist() == [3] * 2000


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("density", [0.0, 0.3, 0.6, 2.0])
def test_groups_are_the_connected_components_in_the_order_of_their_first_members(seed, density):
    random = np.random.default_rng(seed)
    pairs = random.integers(0, 200, (int(density * 200), 2))
    links = coo_array((np.ones(len(pairs)), tuple(pairs.T)), shape=(200, 200))
    expected = connected_components(links, directed=False)[1]
    found = group_of_each(pairs, 200)
    assert found.dtype == np.int32
    assert found.tolist() == expected.tolist()


def test_a_long_chain_in_the_worst_order_is_one_group():
    things = np.arange(99_999)[::-1]
    assert not group_of_each(np.stack([things, things + 1], axis=1), 100_000).any()


def test_no_things_have_no_groups():
    assert group_of_each(np.empty((0, 2)), 0).tolist() == []
