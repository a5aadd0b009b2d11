"""Meshes of photogrammetry as point clouds: evenly sampled, z up, and the same points every time."""

import numpy as np
import pytest
import trimesh

from mbf_mesh_nav.building.clouds.point_cloud import read_clouds
from mbf_mesh_nav.building.surface import build_surface
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh
from mbf_mesh_nav.mesh.mesh_report import MeshError

HEIGHTS = 0.3 * np.sin(0.4 * np.arange(25))[:, None] + 0.2 * np.cos(0.3 * np.arange(33))[None, :]
HILL, FACES = heightfield_mesh(HEIGHTS, 0.5, 0.5)
Y_UP = np.column_stack([HILL[:, 0], HILL[:, 2], -HILL[:, 1]])


def exported(file, vertices=HILL, faces=FACES):
    trimesh.Trimesh(vertices, faces, process=False).export(file)
    return file


@pytest.mark.parametrize(("name", "vertices"), [("a.ply", HILL), ("a.obj", HILL), ("a.stl", HILL), ("a.glb", Y_UP)])
def test_a_mesh_becomes_the_same_hill(tmp_path, name, vertices):
    cloud = read_clouds([exported(tmp_path / name, vertices)])
    surface = build_surface(cloud.points)
    expected = build_surface(read_clouds([exported(tmp_path / "expected.off")]).points)
    assert surface.patches.grid.cell == 0.2
    np.testing.assert_allclose(surface.vertices, expected.vertices, atol=0.03)
    assert "1536 faces sampled with 100 points/m²" in cloud.notes[0]


def test_every_face_gets_points_by_its_area(tmp_path):
    large, small = np.array([[0, 0, 0], [9, 0, 0], [0, 9, 0]]), np.array([[20, 0, 0], [21, 0, 0], [20, 1, 0]])
    file = exported(tmp_path / "two.obj", np.vstack([large, small]).astype(float), [[0, 1, 2], [3, 4, 5]])
    points = read_clouds([file]).points
    of_large = points[points[:, 0] < 15.0]
    assert len(of_large) == pytest.approx(4050, abs=1)
    assert len(points) == 4100
    assert (of_large[:, 0] + of_large[:, 1] <= 9.0 + 1e-9).all()
    counts, _, _ = np.histogram2d(of_large[:, 0], of_large[:, 1], bins=(4, 4), range=((0, 4), (0, 4)))
    np.testing.assert_allclose(counts, 100.0, atol=6.0)  # far more even than random points


def test_a_fine_mesh_is_sampled_as_finely_as_it_is(tmp_path):
    vertices, faces = heightfield_mesh(np.zeros((81, 81)), 0.05, 0.05)
    cloud = read_clouds([exported(tmp_path / "fine.off", vertices, faces)])
    assert len(cloud.points) == pytest.approx(81 * 81, abs=2)


def test_the_same_mesh_gives_the_same_points_and_joins_a_scan(tmp_path):
    file = exported(tmp_path / "hill.obj")
    scan = tmp_path / "scan.xyz"
    np.savetxt(scan, np.add(HILL, (16.0, 0.0, 0.0)))
    one, other = read_clouds([file, scan]), read_clouds([file, scan])
    assert one.points.tobytes() == other.points.tobytes()
    assert np.ptp(one.points[:, 0]) == pytest.approx(32.0, abs=0.2)


def test_the_axis_and_the_unit_that_are_given_win(tmp_path):
    file = exported(tmp_path / "game.obj", 100.0 * Y_UP)
    cloud = read_clouds([file], up_axis="y", unit=0.01)
    np.testing.assert_allclose(cloud.points.min(axis=0), HILL.min(axis=0), atol=0.1)
    np.testing.assert_allclose(cloud.points.max(axis=0), HILL.max(axis=0), atol=0.1)


def test_meshes_that_cannot_be_sampled_and_elevation_models_are_refused(tmp_path):
    with pytest.raises(MeshError, match=r"m² of faces need 19\d* samples, the limit is 5000 \(max_points\)"):
        read_clouds([exported(tmp_path / "hill.obj")], max_points=5000)
    with pytest.raises(MeshError, match="its faces have no area"):
        read_clouds([exported(tmp_path / "line.off", np.eye(3) * 0.0, [[0, 1, 2]])])
    with pytest.raises(MeshError, match="expected points, got an elevation model; it is a map as it is"):
        read_clouds([tmp_path / "survey.tif"])
