"""Fault table, row 23: malformed meshes: every defect by name, random damage of arrays and files."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from mbf_mesh_nav.files.lvr2_io import write_lvr2_mesh
from mbf_mesh_nav.files.mesh_io import read_mesh
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh
from mbf_mesh_nav.mesh.repair import REPAIRS, MeshError, checked_mesh


def good() -> tuple[np.ndarray, np.ndarray]:
    vertices, faces = heightfield_mesh(np.zeros((4, 4)), 1.0, 1.0)
    return vertices.copy(), faces.copy()


def nan_vertex():
    vertices, faces = good()
    vertices[5, 1] = np.nan
    return vertices, faces


def infinite_vertex():
    vertices, faces = good()
    vertices[0, 2] = np.inf
    return vertices, faces


def absurd_vertex():
    vertices, faces = good()
    vertices[3, 1] = -1e200
    return vertices, faces


def index_too_large():
    vertices, faces = good()
    faces[7, 1] = 16
    return vertices, faces


def negative_index():
    vertices, faces = good()
    faces[7, 1] = -1
    return vertices, faces


def zero_area():
    vertices, faces = good()
    return vertices, np.vstack([faces, [0, 1, 2]])


def twice_the_same_corner():
    vertices, faces = good()
    return vertices, np.vstack([faces, [0, 0, 1]])


def duplicate_face():
    vertices, faces = good()
    return vertices, np.vstack([faces, faces[3][[1, 2, 0]]])


def third_face_at_an_edge():
    vertices, faces = good()
    fin = np.vstack([vertices, [1.5, 1.5, 1.0]])
    return fin, np.vstack([faces, [6, 9, 16]])


def one_face_turned_over():
    vertices, faces = good()
    faces[8] = faces[8][::-1]
    return vertices, faces


def all_faces_turned_over():
    vertices, faces = good()
    return vertices, faces[:, ::-1].copy()


def moebius_band():
    """A band of squares, its end joined to its beginning with a half turn."""
    turns = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    boundaries = [
        np.stack([(2 + s * np.cos(turns / 2)) * np.cos(turns), (2 + s * np.cos(turns / 2)) * np.sin(turns)], axis=1)
        for s in (-0.4, 0.4)
    ]
    heights = [s * np.sin(turns / 2) for s in (-0.4, 0.4)]
    vertices = np.vstack(
        [np.column_stack([boundary, height]) for boundary, height in zip(boundaries, heights, strict=True)]
    )
    low, high = np.arange(24), np.arange(24) + 24
    next_low, next_high = np.append(low[1:], high[0]), np.append(high[1:], low[0])
    return vertices, np.vstack([np.stack([low, next_low, next_high], 1), np.stack([low, next_high, high], 1)])


DEFECTS = [
    (nan_vertex, "non_finite", [5]),
    (infinite_vertex, "non_finite", [0]),
    (absurd_vertex, "non_finite", [3]),
    (index_too_large, "index_out_of_range", [7]),
    (negative_index, "index_out_of_range", [7]),
    (zero_area, "zero_area", [18]),
    (twice_the_same_corner, "zero_area", [18]),
    (duplicate_face, "duplicate_faces", [18]),
    (third_face_at_an_edge, "non_manifold", [18]),
    (all_faces_turned_over, "facing_down", list(range(18))),
]


@pytest.mark.parametrize(("make", "name", "indices"), DEFECTS, ids=lambda value: getattr(value, "__name__", None))
def test_defect_is_refused_by_name_with_count_and_indices(make, name, indices):
    with pytest.raises(MeshError) as error:
        checked_mesh(*make(), file="broken.ply")

    assert error.value.file == "broken.ply"
    assert [reason.split(":")[0] for reason in error.value.reasons] == [name]
    assert str(indices[0]) in str(error.value)


@pytest.mark.parametrize(("make", "name", "indices"), DEFECTS, ids=lambda value: getattr(value, "__name__", None))
def test_defect_is_repaired_on_request_and_the_input_is_left_alone(make, name, indices):
    vertices, faces = make()
    before = vertices.copy(), faces.copy()

    mesh, report = checked_mesh(vertices, faces, [name])

    assert report[name].repaired
    assert report[name].indices.tolist() == indices
    np.testing.assert_array_equal(vertices, before[0])
    np.testing.assert_array_equal(faces, before[1])
    _, second = checked_mesh(mesh.vertices, mesh.faces)
    assert not second.refusals


def test_a_face_wound_against_its_neighbours_is_turned_round_unasked_and_reported():
    vertices, faces = one_face_turned_over()

    mesh, report = checked_mesh(vertices, faces)

    assert str(report["flipped_winding"]) == (
        "flipped_winding: 1 faces are wound against their neighbours (indices 8) - repaired"
    )
    np.testing.assert_array_equal(mesh.faces, good()[1])


def test_a_one_sided_surface_is_refused_and_the_message_names_the_option_that_accepts_it():
    vertices, faces = moebius_band()

    with pytest.raises(MeshError, match="edges of a one-sided surface cannot agree") as error:
        checked_mesh(vertices, faces)

    assert error.value.hint.endswith("mesh_map: {repair: [flipped_winding, facing_down]}")
    assert len(checked_mesh(vertices, faces, ["flipped_winding", "facing_down"])[0].faces) == len(faces)


@pytest.mark.parametrize(("make", "name", "indices"), DEFECTS, ids=lambda value: getattr(value, "__name__", None))
def test_the_error_says_how_to_have_the_defect_repaired(make, name, indices):
    with pytest.raises(MeshError, match=rf"mesh_map: {{repair: \[small_components, {name}\]}}$") as error:
        checked_mesh(*make(), repair=["small_components"])
    listed = error.value.hint.partition("[")[2].rstrip("]}").split(", ")
    checked_mesh(*make(), repair=listed)


def test_all_defects_are_reported_at_once():
    vertices, faces = nan_vertex()
    faces = np.vstack([faces, [0, 1, 2], [0, 1, 99], faces[17]])

    with pytest.raises(MeshError) as error:
        checked_mesh(vertices, faces)

    names = [reason.split(":")[0] for reason in error.value.reasons]
    assert names == ["index_out_of_range", "non_finite", "zero_area", "duplicate_faces"]


@pytest.mark.parametrize(
    ("vertices", "faces", "text"),
    [
        (np.zeros((3, 2)), np.array([[0, 1, 2]]), "vertices must be"),
        (np.zeros((3, 3)), np.array([[0.0, 1.0, 2.0]]), "faces must be"),
        (np.zeros((3, 3)), np.zeros((0, 3), int), "no face"),
        (np.zeros((3, 3)), np.array([[0, 1, 2]]), "no area"),
    ],
)
def test_arrays_that_are_no_mesh_are_refused(vertices, faces, text):
    with pytest.raises(MeshError, match=text):
        checked_mesh(vertices, faces)


# Random damage: whatever the arrays or bytes, the answer is a sound map or one MeshError.
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
def test_damaged_mesh_is_repaired_into_a_sound_map_or_refused(seed):
    vertices, faces = damaged(seed)

    try:
        mesh = MeshMap.from_arrays(vertices, faces, repair=list(REPAIRS))
    except MeshError as error:
        assert "one-sided" in str(error) or "no face is left" in str(error)
        return

    assert np.isfinite(mesh.vertices).all()
    assert len(mesh.neighbours) == 2 * len(mesh.edges)
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
