"""Parts that meet become one surface: rounding of their transforms, mirrored parts, surfaces that only touch."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from mbf_mesh_nav.files.mesh_io import read_mesh
from mbf_mesh_nav.map.map_builder import build_mesh_map
from mbf_mesh_nav.map.map_parameters import MeshMapParameters
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh
from mbf_mesh_nav.mesh.mesh_report import MeshError
from mbf_mesh_nav.mesh.repair import checked_mesh

rotation_matrix = trimesh.transformations.rotation_matrix
translation_matrix = trimesh.transformations.translation_matrix
TILE = heightfield_mesh(np.zeros((5, 5)), 0.1, 0.1)


def scene_of(*transforms: np.ndarray) -> trimesh.Scene:
    """One flat tile, placed once for every transform."""
    scene, tile = trimesh.Scene(), trimesh.Trimesh(*TILE, process=False)
    for number, transform in enumerate(transforms):
        scene.add_geometry(tile, node_name=f"tile{number}", geom_name="tile", transform=transform)
    return scene


def test_a_part_of_an_obj_file_is_one_of_its_objects_and_not_all_of_them(tmp_path):
    file = tmp_path / "rooms.obj"
    rooms = [f"o {name}\nv {x} 0 0\nv {x + 1} 0 0\nv {x} 1 0\n" for name, x in (("hall", 0), ("lab", 5))]
    file.write_text(f"{rooms[0]}f 1 2 3\n{rooms[1]}f 4 5 6\n")

    assert read_mesh(file, "lab")[0][:, 0].min() == 5.0 and len(read_mesh(file, "lab")[1]) == 1
    assert read_mesh(file, "hall")[0][:, 0].max() == 1.0
    assert len(read_mesh(file)[1]) == 2
    with pytest.raises(MeshError, match="no part 'attic', the parts are: hall, lab"):
        read_mesh(file, "attic")


@pytest.mark.parametrize("angle", [0.0, 0.3])
def test_tiles_laid_edge_to_edge_by_their_nodes_are_one_surface(tmp_path, angle):
    turned = rotation_matrix(angle, [0, 0, 1])
    scene_of(*[turned @ translation_matrix([0.4 * i, 0, 0]) for i in range(3)]).export(tmp_path / "tiles.glb")

    mesh = build_mesh_map(MeshMapParameters(mesh_file=str(tmp_path / "tiles.glb")))

    assert mesh.components.max() == 0
    assert len(mesh.vertices) == 5 * 13
    assert "10 of them to within" in mesh.report["duplicate_vertices"].text
    assert (mesh.input_to_internal >= 0).all()


@settings(deadline=None, max_examples=30)
@given(st.floats(-3.1, 3.1), st.floats(-50.0, 50.0), st.integers(0, 1000))
def test_any_placement_of_tiles_in_single_precision_is_joined(angle, shift, seed):
    turn = rotation_matrix(angle, np.random.default_rng(seed).normal(size=3))
    vertices = np.vstack([TILE[0] + [0.4 * i, shift, 0.0] for i in range(3)]) @ turn[:3, :3].T
    noise = np.random.default_rng(seed).uniform(-1e-8, 1e-8, vertices.shape)
    faces = np.vstack([TILE[1] + 25 * i for i in range(3)])

    mesh, report = checked_mesh(
        vertices + noise, faces, ["duplicate_vertices", "facing_down", "zero_area"], join_distance=1e-5
    )

    assert len(mesh.vertices) == 65
    assert "components" not in report


def test_the_distance_for_joining_can_be_set():
    vertices, faces = np.vstack([TILE[0], TILE[0] + [0.41, 0.0, 0.0]]), np.vstack([TILE[1], TILE[1] + 25])

    apart, _ = checked_mesh(vertices, faces, ["duplicate_vertices"])
    joined, _ = checked_mesh(vertices, faces, ["duplicate_vertices"], join_distance=0.011)

    assert len(apart.vertices) == 50
    assert len(joined.vertices) == 45


def test_faces_smaller_than_the_distance_for_joining_stay_as_they_are():
    vertices, faces = heightfield_mesh(np.zeros((5, 5)), 1e-7, 1e-7)
    vertices = np.vstack([vertices, TILE[0] + 100.0])

    mesh, report = checked_mesh(vertices, np.vstack([faces, TILE[1] + 25]), ["duplicate_vertices"])

    assert "duplicate_vertices" not in report
    assert len(mesh.faces) == 2 * len(faces)


def test_a_part_that_its_node_mirrors_faces_up_like_the_others(tmp_path):
    mirrored = np.diag([-1.0, 1.0, 1.0, 1.0])
    scene_of(np.eye(4), mirrored).export(tmp_path / "mirrored.glb")

    mesh = build_mesh_map(MeshMapParameters(mesh_file=str(tmp_path / "mirrored.glb"), up_axis="z"))

    assert len(read_mesh(tmp_path / "mirrored.glb")[1]) == 2 * len(TILE[1])
    assert (mesh.face_normals[:, 2] > 0.99).all()
    assert mesh.components.max() == 0
