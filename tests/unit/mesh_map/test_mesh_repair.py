"""What is repaired, dropped, merged and split; that every defect is found is in tests/faults/test_malformed_mesh.py."""

import numpy as np
import pytest

from mbf_mesh_nav.densify import densify
from mbf_mesh_nav.heightfield_mesh import heightfield_mesh
from mbf_mesh_nav.mesh_map import MeshMap
from mbf_mesh_nav.repair import REPAIRS, MeshError, checked_mesh


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


def test_moebius_strip_cannot_be_wound_and_says_so():
    angle = np.linspace(0.0, 2.0 * np.pi, 20, endpoint=False)
    rims = [
        np.column_stack(
            [
                (4 + s * np.cos(angle / 2)) * np.cos(angle),
                (4 + s * np.cos(angle / 2)) * np.sin(angle),
                s * np.sin(angle / 2),
            ]
        )
        for s in (-1.0, 1.0)
    ]
    vertices = np.stack(rims, axis=1).reshape(-1, 3)
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

    with pytest.raises(MeshError, match="more than 1000 faces"):
        densify(mesh, 0.01, max_faces=1000)


def _area(vertices: np.ndarray, faces: np.ndarray) -> float:
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)
