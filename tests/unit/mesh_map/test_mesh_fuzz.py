"""Random damage: whatever the arrays or bytes, the answer is a sound map or one MeshError."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from mbf_mesh_nav.heightfield_mesh import heightfield_mesh
from mbf_mesh_nav.lvr2_io import write_lvr2_mesh
from mbf_mesh_nav.mesh_io import read_mesh
from mbf_mesh_nav.mesh_map import MeshMap
from mbf_mesh_nav.repair import REPAIRS, MeshError

VERTICES, FACES = heightfield_mesh(np.random.default_rng(0).random((6, 5)), 0.5, 0.5)


def damaged(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """The mesh with some coordinates, indices, faces and windings replaced at random."""
    rng = np.random.default_rng(seed)
    vertices, faces = VERTICES.copy(), FACES.astype(np.int64)
    values = np.array([np.nan, np.inf, 0.0, 1e30, -1e30, 0.5])
    for _ in range(rng.integers(0, 4)):
        vertices[rng.integers(len(vertices)), rng.integers(3)] = rng.choice(values)
    for _ in range(rng.integers(0, 6)):
        faces[rng.integers(len(faces)), rng.integers(3)] = rng.integers(-2, len(vertices) + 2)
    faces = np.vstack([faces, faces[rng.integers(0, len(faces), rng.integers(0, 4))]])
    turned = rng.random(len(faces)) < 0.2
    return vertices, np.where(turned[:, None], faces[:, ::-1], faces)


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 100_000))
def test_damaged_mesh_is_mended_into_a_sound_map_or_refused(seed):
    vertices, faces = damaged(seed)

    try:
        mesh = MeshMap.from_arrays(vertices, faces, repair=list(REPAIRS))
    except MeshError as error:
        assert "one-sided" in str(error) or "no face is left" in str(error)
        return

    assert np.isfinite(mesh.vertices).all()
    counts = np.bincount(mesh.neighbour_edges, minlength=len(mesh.edges))
    assert (counts == 2).all()
    edges = np.sort(np.stack([mesh.faces, np.roll(mesh.faces, -1, axis=1)], axis=2), axis=2).reshape(-1, 2)
    assert np.unique(edges, axis=0, return_counts=True)[1].max() <= 2
    face, corner = np.nonzero(mesh.face_neighbours >= 0)
    across = mesh.face_neighbours[face, corner]
    assert (mesh.face_neighbours[across] == face[:, None]).any(axis=1).all()
    assert (mesh.locate(mesh.vertices[mesh.faces].mean(axis=1)).faces >= 0).all()


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 100_000))
def test_damaged_mesh_without_repairs_is_taken_whole_or_refused(seed):
    vertices, faces = damaged(seed)

    try:
        mesh = MeshMap.from_arrays(vertices, faces)
    except MeshError as error:
        assert error.reasons
        return
    assert len(mesh.faces) == len(faces)


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """One good file of every format, as bytes."""
    folder = tmp_path_factory.mktemp("meshes")
    mesh = trimesh.Trimesh(VERTICES, FACES, process=False)
    for ending in ("ply", "stl", "obj", "off", "glb"):
        mesh.export(folder / f"mesh.{ending}")
    write_lvr2_mesh(folder / "mesh.h5", VERTICES, FACES)
    return {path.suffix: path.read_bytes() for path in folder.iterdir()}


@settings(deadline=None, max_examples=60)
@given(st.sampled_from([".ply", ".stl", ".obj", ".off", ".glb", ".h5"]), st.integers(0, 100_000))
def test_damaged_file_is_read_or_refused_with_its_name(files, tmp_path_factory, ending, seed):
    rng = np.random.default_rng(seed)
    content = bytearray(files[ending])
    for _ in range(rng.integers(1, 8)):
        content[rng.integers(len(content))] = rng.integers(256)
    file = tmp_path_factory.mktemp("damaged") / f"mesh{ending}"
    file.write_bytes(content[: rng.integers(1, len(content) + 1)])

    try:
        vertices, faces = read_mesh(file)
    except MeshError as error:
        assert error.file == str(file)
        return
    assert vertices.shape[1] == faces.shape[1] == 3
