"""Mesh files as worlds."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from terrain.physics.world import BulletWorld
from terrain.worlds.mesh_world import MeshFileError, read_mesh_world


def test_a_mesh_with_y_up_is_turned_and_scaled(tmp_path: Path) -> None:
    file = tmp_path / "ramp.obj"
    file.write_text("v 0 100 0\nv 200 100 0\nv 0 100 -200\nf 1 2 3\n")
    mesh = read_mesh_world(file, "y", 0.01)
    assert np.allclose(mesh.vertices, [[0, 0, 1], [2, 0, 1], [0, 2, 1]]) and mesh.faces.tolist() == [[0, 1, 2]]


def test_a_gltf_stands_as_its_format_says(tmp_path: Path) -> None:
    corners, faces = np.array([[0.0, 1.0, 0.0], [2.0, 1.0, 0.0], [0.0, 1.0, -2.0]]), [[0, 1, 2]]
    trimesh.Trimesh(corners, faces, process=False).export(tmp_path / "ramp.glb")
    assert np.allclose(read_mesh_world(tmp_path / "ramp.glb").vertices, [[0, 0, 1], [2, 0, 1], [0, 2, 1]])


def test_a_real_level_stands_in_the_world(shared_data: Path) -> None:
    mesh = read_mesh_world(shared_data / "terrain/recast/nav_test.obj", "y")
    assert len(mesh.faces) == 1612
    with BulletWorld() as world:
        world.add_mesh(mesh.vertices, mesh.faces)
        low, high = mesh.vertices[:, :2].min(axis=0), mesh.vertices[:, :2].max(axis=0)
        xy = np.random.default_rng(0).uniform(low, high, (200, 2))
        assert np.isfinite(world.vertical_rays(xy)).mean() > 0.2


@pytest.mark.parametrize(
    ("name", "content", "reason"),
    [
        ("a.obj", "", "no face"),
        ("a.obj", "v 0 0 0\nv 1 0 0\n", "no face"),
        ("a.obj", "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "vertex 0"),
        ("a.xyzw", "what", "unknown ending"),
        ("a.ply", "ply\nwhat", "line 2: expected a line that begins with"),
    ],
)
def test_a_bad_mesh_is_refused_with_its_name_and_reason(tmp_path: Path, name: str, content: str, reason: str) -> None:
    (tmp_path / name).write_text(content)
    with pytest.raises(MeshFileError, match=reason) as caught:
        read_mesh_world(tmp_path / name)
    assert name in str(caught.value)
    with pytest.raises(MeshFileError, match="there is no such file"):
        read_mesh_world(tmp_path / "missing.obj")
