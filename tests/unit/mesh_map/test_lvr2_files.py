"""HDF5 files of lvr2: both layouts in and out, damaged ones refused, failed writes that leave nothing."""

import h5py
import numpy as np
import pytest

from mbf_mesh_nav.files.lvr2_io import LAYOUTS, write_lvr2_map, write_lvr2_mesh
from mbf_mesh_nav.files.mesh_io import read_mesh
from mbf_mesh_nav.map.map_builder import build_mesh_map
from mbf_mesh_nav.map.map_parameters import MeshMapParameters
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh
from mbf_mesh_nav.mesh.repair import MeshError

VERTICES, FACES = heightfield_mesh(np.random.default_rng(0).random((12, 10)) * 0.1, 0.1, 0.1)


def stored(file, name):
    with h5py.File(file) as opened:
        return opened[name][()]


@pytest.mark.parametrize("layout", list(LAYOUTS))
def test_both_layouts_are_read_back_as_written_with_layer_costs(tmp_path, layout):
    file = tmp_path / "map.h5"
    costs = np.arange(len(VERTICES), dtype=np.float32)

    write_lvr2_mesh(file, VERTICES, FACES, {"height_diff": costs, "vertex_normals": VERTICES}, "site/mesh", layout)

    vertices, faces = read_mesh(file)
    np.testing.assert_allclose(vertices, VERTICES, atol=1e-6)
    np.testing.assert_array_equal(faces, FACES)
    group = f"site/mesh/{LAYOUTS[layout][1]}"
    np.testing.assert_array_equal(stored(file, f"{group}/height_diff")[:, 0], costs)
    assert stored(file, f"{group}/vertex_normals").shape == (len(VERTICES), 3)
    with pytest.raises(MeshError, match="not overwritten"):
        write_lvr2_mesh(file, VERTICES, FACES)


def test_map_is_saved_with_its_layers_in_the_callers_numbering(tmp_path):
    order = np.random.default_rng(1).permutation(len(VERTICES))
    shuffled, corners = VERTICES[order], np.argsort(order)[FACES]
    parameters = MeshMapParameters(layers=[{"name": "rough", "type": "roughness"}])
    mesh = build_mesh_map(parameters, vertices=shuffled, faces=corners)

    write_lvr2_map(tmp_path / "map.h5", mesh)

    vertices, faces = read_mesh(tmp_path / "map.h5")
    np.testing.assert_allclose(vertices, shuffled, atol=1e-6)
    assert {tuple(sorted(face)) for face in faces.tolist()} == {tuple(sorted(face)) for face in corners.tolist()}
    rough = stored(tmp_path / "map.h5", "mesh/vertex_attributes/rough")[:, 0]
    np.testing.assert_array_equal(rough, mesh.to_input_order(mesh.layers["rough"].costs).astype(np.float32))


def test_a_layer_whose_costs_the_normals_would_replace_is_refused(tmp_path):
    parameters = MeshMapParameters(layers=[{"name": "vertex_normals", "type": "roughness"}])
    mesh = build_mesh_map(parameters, vertices=VERTICES, faces=FACES)
    with pytest.raises(MeshError, match="a layer is called 'vertex_normals'"):
        write_lvr2_map(tmp_path / "map.h5", mesh)
    assert not list(tmp_path.iterdir())


def test_old_layout_is_read(tmp_path):
    file = tmp_path / "old.h5"
    with h5py.File(file, "w") as handle:
        handle["mesh/channels/vertices"] = VERTICES.astype(np.float32)
        handle["mesh/channels/face_indices"] = FACES.astype(np.uint32)

    np.testing.assert_array_equal(read_mesh(file, "mesh")[1], FACES)


def test_hdf5_without_or_with_another_mesh_names_what_is_there(tmp_path):
    file = tmp_path / "odd.h5"
    with h5py.File(file, "w") as handle:
        handle["a/geometry/vertices"] = np.zeros((3, 3))
        handle["a/geometry/face_indices"] = np.zeros((1, 4), np.uint32)
        handle["a"].attrs["IO"] = "PointIO"

    with pytest.raises(MeshError, match=r"no mesh 'b'\. The meshes in it are: a"):
        read_mesh(file, "b")
    with pytest.raises(MeshError, match=r"expected \(n, 3\).*expected 'MeshIO'"):
        read_mesh(file)


def test_old_layout_is_written_where_old_programs_look(tmp_path):
    write_lvr2_mesh(tmp_path / "old.h5", VERTICES, FACES, {"roughness": np.ones(len(VERTICES))}, layout="channels")

    with h5py.File(tmp_path / "old.h5") as file:
        assert set(file["mesh/channels"]) == {"vertices", "face_indices", "roughness"}
        assert file["mesh/channels/face_indices"].dtype == np.uint32
        assert file["mesh/channels/roughness"].shape == (len(VERTICES), 1)


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"vertex_attributes": {"a": np.ones(3)}}, r"attribute 'a' has shape \(3,\), expected \(120"),
        ({"vertex_attributes": {"a/b": np.ones(120)}}, "cannot be called 'a/b'"),
        ({"vertex_attributes": {"vertices": np.ones(120)}, "layout": "channels"}, "cannot be called 'vertices'"),
        ({"vertex_attributes": {"a": np.array(["x"] * 120)}}, "cannot be written"),
        ({"layout": "newest"}, "unknown layout 'newest', the layouts are: mesh_io, channels"),
        ({"part": "/"}, "needs a part"),
    ],
)
def test_a_write_that_fails_is_one_error_and_leaves_no_file(tmp_path, options, text):
    with pytest.raises(MeshError, match=text):
        write_lvr2_mesh(tmp_path / "map.h5", VERTICES, FACES, **options)
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_is_not_there_is_named(tmp_path):
    with pytest.raises(MeshError, match="cannot be written") as error:
        write_lvr2_mesh(tmp_path / "none" / "map.h5", VERTICES, FACES)
    assert error.value.file == str(tmp_path / "none" / "map.h5")


def text_for_vertices(file):
    file["mesh/geometry/vertices"] = np.array([[b"a"] * 3] * 4)
    file["mesh/geometry/face_indices"] = np.zeros((2, 3), np.uint32)


def group_for_vertices(file):
    file.create_group("mesh/geometry/vertices")
    file["mesh/geometry/face_indices"] = np.zeros((2, 3), np.uint32)


def fractions_for_indices(file):
    file["mesh/channels/vertices"] = np.zeros((4, 3), np.float32)
    file["mesh/channels/face_indices"] = np.zeros((2, 3), np.float32)


@pytest.mark.parametrize(
    ("fill", "text"),
    [
        (text_for_vertices, r"/mesh/geometry/vertices holds \|S1, expected numbers"),
        (group_for_vertices, "/mesh/geometry/vertices is a group, expected an array"),
        (fractions_for_indices, "/mesh/channels/face_indices holds float32, expected integers"),
    ],
)
def test_channels_that_are_no_numbers_are_refused(tmp_path, fill, text):
    path = tmp_path / "odd.h5"
    with h5py.File(path, "w") as file:
        fill(file)
    with pytest.raises(MeshError, match=text):
        read_mesh(path)
