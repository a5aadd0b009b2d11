"""What is repaired, dropped, merged and split; that every defect is found is in tests/faults/test_malformed_mesh.py."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.mesh.densify import densify
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh
from mbf_mesh_nav.mesh.repair import REPAIRS, MeshError, checked_mesh


def good() -> tuple[np.ndarray, np.ndarray]:
    vertices, faces = heightfield_mesh(np.zeros((4, 4)), 1.0, 1.0)
    return vertices.copy(), faces.copy()


def test_unreferenced_vertices_and_components_are_reported_but_harmless():
    vertices, faces = good()
    far = np.vstack([vertices, vertices + np.array([10.0, 0.0, 0.0]), [[50.0, 0.0, 0.0]]])

    mesh, report = checked_mesh(far, np.vstack([faces, faces + 16]))

    assert report["components"].count == 2
    assert report["unreferenced"].indices.tolist() == [32]
    assert len(mesh.vertices) == 33


def test_small_components_and_unreferenced_vertices_can_be_dropped():
    vertices, faces = good()
    far = np.vstack([[[50.0, 0.0, 0.0]], vertices + np.array([10.0, 0.0, 0.0]), vertices])
    chosen = np.vstack([faces[:4] + 1, faces + 17])

    mesh = MeshMap.from_arrays(far, chosen, repair=["small_components", "unreferenced"])

    assert len(mesh.vertices) == 16
    assert (mesh.input_to_internal[:17] == -1).all()
    np.testing.assert_allclose(mesh.vertices[mesh.input_to_internal[17:]], vertices)
    assert np.isnan(mesh.to_input_order(mesh.snapshot().costs)[:17]).all()


def test_merged_vertices_share_one_internal_number():
    vertices, faces = good()
    soup, corners = vertices[faces].reshape(-1, 3), np.arange(54).reshape(-1, 3)

    mesh = MeshMap.from_arrays(soup, corners, repair=["duplicate_vertices"])

    assert len(mesh.vertices) == 16
    np.testing.assert_array_equal(mesh.vertices[mesh.input_to_internal], soup)


def test_moebius_band_cannot_be_wound_and_says_so():
    angle = np.linspace(0.0, 2.0 * np.pi, 20, endpoint=False)
    boundaries = [
        np.column_stack(
            [
                (4 + s * np.cos(angle / 2)) * np.cos(angle),
                (4 + s * np.cos(angle / 2)) * np.sin(angle),
                s * np.sin(angle / 2),
            ]
        )
        for s in (-1.0, 1.0)
    ]
    vertices = np.stack(boundaries, axis=1).reshape(-1, 3)
    faces = []
    for i in range(20):
        a, b = 2 * i, 2 * i + 1
        c, d = (2 * i + 2, 2 * i + 3) if i < 19 else (1, 0)
        faces += [[a, c, b], [c, d, b]]

    with pytest.raises(MeshError, match="one-sided"):
        checked_mesh(vertices, np.array(faces))


def test_unknown_repair_is_refused_with_the_known_ones():
    with pytest.raises(MeshError, match=r"unknown repair 'everything'.*zero_area"):
        checked_mesh(*good(), ["everything"])
    assert "zero_area" in REPAIRS


@pytest.mark.parametrize(("scale", "offset"), [(1e-3, 0.0), (1.0, 1e4), (1e3, 1e6)])
def test_checks_do_not_depend_on_scale_and_offset(scale, offset):
    rng = np.random.default_rng(0)
    vertices, faces = heightfield_mesh(rng.random((6, 6)), 0.5, 0.5)

    mesh, report = checked_mesh(vertices * scale + offset, faces)

    assert not report.findings
    assert len(mesh.faces) == len(faces)


def test_densify_splits_conformingly_and_keeps_the_surface():
    vertices, faces = heightfield_mesh(np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 2.0]]), 3.0, 1.0)
    mesh, _ = checked_mesh(vertices, faces)

    fine = densify(mesh, 0.4)

    _, report = checked_mesh(fine.vertices, fine.faces)
    edges = fine.vertices[fine.faces] - np.roll(fine.vertices[fine.faces], 1, axis=1)
    assert not report.findings
    assert np.linalg.norm(edges, axis=2).max() <= 0.4
    assert _area(fine.vertices, fine.faces) == pytest.approx(_area(vertices, faces))
    assert set(fine.face_source) == set(range(len(faces)))
    np.testing.assert_array_equal(fine.vertices[:6], vertices)
    assert (fine.vertex_source[6:] == -1).all()


def test_densify_refuses_a_length_that_needs_too_many_faces():
    mesh, _ = checked_mesh(*good())

    with pytest.raises(MeshError, match=r"hall\.ply: densify: edges of at most 0\.01 m need more than 1000 faces"):
        densify(mesh, 0.01, max_faces=1000, file="hall.ply")


def storeys(*turned: bool) -> tuple[np.ndarray, np.ndarray]:
    """Floors of 4 x 4 m, one above the other, those that are True wound the wrong way."""
    vertices, faces = good()
    above = [vertices + np.array([0.0, 0.0, 3.0 * level]) for level in range(len(turned))]
    wound = [faces[:, ::-1] if down else faces for down in turned]
    return np.vstack(above), np.vstack([corners + 16 * level for level, corners in enumerate(wound)])


@pytest.mark.parametrize("repair", [["facing_down"], ["flipped_winding", "facing_down"]])
def test_a_storey_that_faces_down_is_reported_with_its_faces_and_turned_round(repair):
    mesh, report = checked_mesh(*storeys(False, True, False), repair)

    assert report["facing_down"].indices.tolist() == list(range(18, 36))
    assert "1 of 3 components" in report["facing_down"].text
    assert (MeshMap.from_arrays(mesh.vertices, mesh.faces).face_normals[:, 2] > 0.0).all()


def test_one_storey_may_face_down_like_a_ceiling_but_not_most_of_the_mesh():
    mesh, report = checked_mesh(*storeys(False, True))

    assert report["facing_down"].count == 18
    assert (MeshMap.from_arrays(mesh.vertices, mesh.faces).face_normals[:, 2] < 0.0).sum() == 18
    with pytest.raises(MeshError, match="facing_down: 36 faces face down, those of 2 of 3 components"):
        checked_mesh(*storeys(True, True, False))


def touching(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Floors that touch, each the next one, in the point of a corner."""
    vertices, faces = good()
    moved = [vertices + np.array([3.0 * i, 3.0 * i, 0.0]) for i in range(count)]
    mesh, _ = checked_mesh(np.vstack(moved), np.vstack([faces + 16 * i for i in range(count)]), ["duplicate_vertices"])
    return mesh.vertices, mesh.faces


def test_vertices_where_groups_of_faces_touch_in_a_point_are_reported_and_split():
    vertices, faces = touching(3)

    _, reported = checked_mesh(vertices, faces)
    mesh = MeshMap.from_arrays(vertices, faces, repair=["non_manifold_vertices"])

    assert not reported["non_manifold_vertices"].repaired
    assert reported["non_manifold_vertices"].indices.tolist() == [15, 30]
    assert len(mesh.vertices) == 48
    assert mesh.components.max() == 2
    assert (mesh.internal_to_input == -1).sum() == 2
    np.testing.assert_array_equal(mesh.vertices[mesh.input_to_internal], vertices)
    assert "non_manifold_vertices" not in checked_mesh(mesh.vertices, mesh.faces)[1]


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 100_000))
def test_after_splitting_faces_hang_together_over_edges_exactly_if_over_vertices(seed):
    rng = np.random.default_rng(seed)
    heights = np.where(rng.random((7, 8)) < 0.3, np.nan, rng.random((7, 8)))
    heights[:2, :2] = 0.0
    vertices, faces = heightfield_mesh(heights, 1.0, 1.0)

    mesh = MeshMap.from_arrays(vertices, faces, repair=["non_manifold_vertices"])

    face, corner = np.nonzero(mesh.face_neighbours >= 0)
    pairs = face, mesh.face_neighbours[face, corner]
    graph = coo_array((np.ones(len(face)), pairs), shape=(len(faces), len(faces)))
    patches = connected_components(graph, directed=False)[1]
    labels = mesh.components[mesh.faces[:, 0]]
    assert len(set(zip(patches, labels, strict=True))) == patches.max() + 1 == len(set(labels))
    np.testing.assert_array_equal(np.sort(_centres(mesh), axis=0), np.sort(vertices[faces].mean(axis=1), axis=0))


def test_two_cones_that_touch_at_their_tips_are_split():
    boundary = np.array([[1.0, 0.0, 1.0], [-0.5, 0.9, 1.0], [-0.5, -0.9, 1.0]])
    vertices = np.vstack([[0.0, 0.0, 0.0], boundary, boundary * [1.0, 1.0, -1.0]])
    cone = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1]])
    faces = np.vstack([cone, np.where(cone > 0, cone + 3, 0)[:, ::-1]])

    mesh, report = checked_mesh(vertices, faces, ["non_manifold_vertices", "facing_down"])

    assert report["non_manifold_vertices"].indices.tolist() == [0]
    assert len(mesh.vertices) == 8


# A face without area joins the two short edges on its one side to the long one on the other.
P, Q, M, ABOVE, BELOW = (0.0, 0.0, 0.0), (2.0, 0.0, 0.0), (0.5, 0.0, 0.0), (1.0, 1.0, 0.0), (1.0, -1.0, 0.0)


def test_a_face_without_area_is_flipped_away_and_its_neighbours_stay_joined():
    vertices = np.array([P, Q, M, ABOVE, BELOW])
    faces = np.array([[0, 1, 3], [0, 2, 1], [0, 4, 2], [2, 4, 1]])

    mesh = MeshMap.from_arrays(vertices, faces, repair=["zero_area"])

    assert mesh.report["zero_area"].indices.tolist() == [1]
    assert (mesh.face_neighbours >= 0).sum() == 8
    assert sorted(mesh.topology.internal_to_input_faces.tolist()) == [0, 0, 2, 3]
    assert _area(mesh.vertices, mesh.faces) == pytest.approx(2.0)
    assert (mesh.face_normals[:, 2] > 0.0).all()


def test_a_row_of_faces_without_area_leaves_no_crack():
    middles = [(x, 0.0, 0.0) for x in (0.25, 0.75, 1.0, 1.5)]
    vertices = np.array([P, Q, ABOVE, BELOW, *middles])
    line = [0, 4, 5, 6, 7, 1]
    slivers = [[line[i], line[i + 1], 1] for i in range(4)]
    lower = [[3, line[i + 1], line[i]] for i in range(5)]

    mesh, report = checked_mesh(vertices, np.array([[0, 1, 2], *slivers, *lower]), ["zero_area"])

    assert report["zero_area"].count == 4
    assert "crack" not in report["zero_area"].text
    assert (MeshMap.from_arrays(mesh.vertices, mesh.faces).face_neighbours < 0).sum() == 4
    assert len(mesh.faces) == 10


def test_two_corners_of_a_flat_face_in_one_place_become_one_vertex():
    vertices = np.array([P, P, Q, ABOVE, BELOW])
    faces = np.array([[0, 2, 3], [0, 1, 2], [1, 4, 2]])

    mesh, _ = checked_mesh(vertices, faces, ["zero_area"])

    assert len(mesh.vertices) == 4
    assert mesh.input_to_vertex.tolist() == [0, 0, 1, 2, 3]
    assert (MeshMap.from_arrays(mesh.vertices, mesh.faces).face_neighbours >= 0).sum() == 2


def test_a_crack_that_cannot_be_closed_is_reported():
    vertices = np.array([P, Q, M, ABOVE, BELOW, (0.5, 1.0, 1.0)])
    # The face across the long edge is there, but so is an edge from the middle to its tip.
    faces = np.array([[0, 1, 3], [0, 2, 1], [0, 4, 2], [2, 4, 1], [3, 2, 5]])

    _, report = checked_mesh(vertices, faces, ["zero_area"])

    assert "at 1 of them the neighbours cannot be joined" in report["zero_area"].text


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 100_000))
def test_any_grid_with_edges_split_on_one_side_only_is_joined_again(seed):
    """Split edges at random points, add the sliver that hides the crack, as CAD exporters do, and repair it."""
    rng = np.random.default_rng(seed)
    vertices, faces = heightfield_mesh(rng.random((4, 4)), 1.0, 1.0)
    corners, points = faces.tolist(), vertices.tolist()
    for face in rng.choice(len(faces), 6, replace=False):
        a, b, c = corners[face]
        points.append((vertices[a] + rng.uniform(0.1, 0.9) * (vertices[b] - vertices[a])).tolist())
        middle = len(points) - 1
        corners[face] = [a, middle, c]
        corners += [[middle, b, c], [a, b, middle]]

    mesh, report = checked_mesh(np.array(points), np.array(corners), ["zero_area"])

    assert report["zero_area"].count == 6
    assert "crack" not in report["zero_area"].text
    assert _area(mesh.vertices, mesh.faces) == pytest.approx(_area(vertices, faces))
    whole = MeshMap.from_arrays(mesh.vertices, mesh.faces)
    border = whole.face_neighbours < 0
    on_border = whole.vertices[np.unique(whole.faces[border | np.roll(border, 1, axis=1)])]
    assert ((on_border[:, :2] < 1e-9) | (on_border[:, :2] > 3.0 - 1e-9)).any(axis=1).all()


def _centres(mesh: MeshMap) -> np.ndarray:
    return mesh.vertices[mesh.faces].mean(axis=1)


def _area(vertices: np.ndarray, faces: np.ndarray) -> float:
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)
