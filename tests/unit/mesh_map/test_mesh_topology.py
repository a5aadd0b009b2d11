"""The flat neighbour arrays against ten-line twins, on random closed and open meshes."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mbf_mesh_nav.kernels.mesh.defects import superfluous_faces
from mbf_mesh_nav.kernels.mesh.incidence import faces_of_vertices
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh


def random_map(seed: int, nx: int = 7, ny: int = 6, shuffled: bool = True) -> tuple[MeshMap, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    vertices, faces = heightfield_mesh(rng.random((ny, nx)), 0.5, 0.4)
    faces = faces[rng.random(len(faces)) < 0.9]
    if shuffled:
        order = rng.permutation(len(vertices))
        vertices, faces = vertices[order], np.argsort(order)[faces][rng.permutation(len(faces))]
    return MeshMap.from_arrays(vertices, faces), vertices, faces


def naive_neighbours(faces: np.ndarray, vertex: int) -> list[int]:
    around = {int(other) for face in faces if vertex in face for other in face}
    return sorted(around - {vertex})


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 10_000))
def test_neighbour_lists_equal_those_read_off_the_faces(seed):
    mesh, _, _ = random_map(seed)
    starts = np.repeat(np.arange(len(mesh.vertices)), np.diff(mesh.neighbour_offsets))
    both = np.sort(np.stack([starts, mesh.neighbours], axis=1), axis=1)
    assert mesh.edges.tolist() == np.unique(both, axis=0).tolist()
    for vertex in range(len(mesh.vertices)):
        first, last = mesh.neighbour_offsets[vertex : vertex + 2]
        assert mesh.neighbours[first:last].tolist() == naive_neighbours(mesh.faces, vertex)
        for entry in range(first, last):
            length = np.linalg.norm(mesh.vertices[vertex] - mesh.vertices[mesh.neighbours[entry]])
            assert mesh.neighbour_lengths[entry] == pytest.approx(length, rel=1e-6)


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 10_000))
def test_faces_across_edges_equal_a_search_over_all_faces(seed):
    mesh, _, _ = random_map(seed)
    for face, corners in enumerate(mesh.faces):
        for k in range(3):
            edge = {corners[k], corners[(k + 1) % 3]}
            others = [f for f, c in enumerate(mesh.faces) if f != face and edge <= set(c)]
            assert mesh.face_neighbours[face, k] == (others[0] if others else -1)


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 10_000))
def test_incident_faces_and_vertex_normals_equal_the_mean_of_the_faces(seed):
    mesh, _, _ = random_map(seed)
    for vertex in range(len(mesh.vertices)):
        first, last = mesh.vertex_face_offsets[vertex : vertex + 2]
        incident = [f for f, c in enumerate(mesh.faces) if vertex in c]
        assert mesh.vertex_faces[first:last].tolist() == incident
        mean = mesh.face_normals[incident].mean(axis=0) if incident else np.array([0.0, 0.0, 1.0])
        np.testing.assert_allclose(mesh.vertex_normals[vertex], mean / np.linalg.norm(mean), atol=1e-12)


def test_results_come_back_in_the_numbering_of_the_caller():
    mesh, vertices, faces = random_map(3)

    np.testing.assert_array_equal(mesh.vertices[mesh.input_to_internal], vertices)
    np.testing.assert_array_equal(mesh.internal_to_input[mesh.input_to_internal], np.arange(len(vertices)))
    np.testing.assert_array_equal(mesh.to_input_order(mesh.vertices), vertices)
    np.testing.assert_array_equal(
        np.sort(mesh.internal_to_input[mesh.faces], axis=1),
        np.sort(faces[mesh.topology.internal_to_input_faces], axis=1),
    )


def test_components_are_those_of_the_faces():
    vertices, faces = heightfield_mesh(np.zeros((3, 3)), 1.0, 1.0)
    two = np.vstack([vertices, vertices + np.array([0.0, 0.0, 5.0])])

    mesh = MeshMap.from_arrays(two, np.vstack([faces, faces + 9]))

    lower = mesh.components[mesh.vertices[:, 2] < 1.0]
    upper = mesh.components[mesh.vertices[:, 2] > 1.0]
    assert len(set(lower)) == len(set(upper)) == 1
    assert lower[0] != upper[0]


def test_all_arrays_are_read_only():
    mesh, _, _ = random_map(1)

    for name in ("vertices", "faces", "neighbours", "face_neighbours", "components"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(mesh, name)[0] = 0


def test_heightfield_is_split_along_the_anti_diagonal_like_bullets():
    heights = np.array([[0.0, 0.0, 0.0], [0.0, 1.0, 0.0]])

    vertices, faces = heightfield_mesh(heights, 0.5, 2.0, x0=10.0, y0=-1.0)

    np.testing.assert_allclose(vertices[4], [10.5, 1.0, 1.0])
    assert faces.tolist() == [[0, 1, 3], [1, 4, 3], [1, 2, 4], [2, 5, 4]]


def test_unknown_heights_leave_holes():
    heights = np.zeros((3, 3))
    heights[0, 0] = np.nan

    vertices, faces = heightfield_mesh(heights, 1.0, 1.0)

    assert len(vertices) == 8
    assert len(faces) == 7
    assert np.isfinite(vertices).all()


@pytest.mark.parametrize("heights", [np.zeros(4), np.zeros((1, 4))])
def test_heights_that_are_no_grid_are_refused(heights):
    with pytest.raises(ValueError, match="2 x 2"):
        heightfield_mesh(heights, 1.0, 1.0)


def test_vertex_graph_has_the_callers_numbers_positions_and_weights():
    mesh, vertices, _ = random_map(5)

    graph = mesh.vertex_graph()

    assert graph.number_of_nodes() == len(vertices)
    assert graph.number_of_edges() == len(mesh.edges)
    for start, end, data in graph.edges(data=True):
        np.testing.assert_allclose(graph.nodes[start]["position"], vertices[start])
        assert data["weight"] == pytest.approx(np.linalg.norm(vertices[start] - vertices[end]), rel=1e-6)


def test_heightfield_map_is_the_surface_bullet_drives_on():
    pybullet = pytest.importorskip("pybullet")
    heights = np.random.default_rng(8).random((9, 12)).astype(np.float32)
    mesh = MeshMap.from_heights(heights, 0.3, 0.2, x0=2.0, y0=-1.0)
    lowered = (heights - heights.max()).astype(np.float32)
    middle = 0.5 * (float(lowered.min()) + float(lowered.max())) + float(heights.max())
    client = pybullet.connect(pybullet.DIRECT)
    shape = pybullet.createCollisionShape(
        pybullet.GEOM_HEIGHTFIELD,
        meshScale=[0.3, 0.2, 1.0],
        heightfieldData=lowered.ravel(),
        numHeightfieldRows=12,
        numHeightfieldColumns=9,
        physicsClientId=client,
    )
    base = [2.0 + 11 * 0.3 / 2, -1.0 + 8 * 0.2 / 2, middle]
    pybullet.createMultiBody(0, shape, basePosition=base, physicsClientId=client)
    xy = np.random.default_rng(9).uniform([2.05, -0.95], [5.25, 0.55], (300, 2))
    top, bottom = np.column_stack([xy, np.full(300, 3.0)]), np.column_stack([xy, np.full(300, -3.0)])

    hits = pybullet.rayTestBatch(top.tolist(), bottom.tolist(), physicsClientId=client)
    _, depths = mesh.locator.cast_rays(top, [0.0, 0.0, -1.0])
    pybullet.disconnect(client)

    errors = np.abs(np.array([hit[3][2] for hit in hits]) - (3.0 - depths))
    assert np.median(errors) < 1e-6
    assert errors.max() < 1e-3


@pytest.mark.parametrize("seed", range(5))
def test_faces_to_drop_equal_those_found_by_adding_faces_one_by_one(seed):
    rng = np.random.default_rng(seed)
    faces = np.array([rng.choice(7, 3, replace=False) for _ in range(60)], dtype=np.int32)
    repeated, surplus, kept = [], [], []
    for face in faces.tolist():
        repeated.append(any(set(face) == set(other) for other in faces[: len(repeated)].tolist()))
        sides = [{face[0], face[1]}, {face[1], face[2]}, {face[2], face[0]}]
        surplus.append(not repeated[-1] and any(sum(side < set(other) for other in kept) >= 2 for side in sides))
        if not repeated[-1] and not surplus[-1]:
            kept.append(face)
    found = superfluous_faces(faces, *faces_of_vertices(faces, 7))
    assert found[0].tolist() == repeated
    assert found[1].tolist() == surplus
    assert any(repeated) and any(surplus)
