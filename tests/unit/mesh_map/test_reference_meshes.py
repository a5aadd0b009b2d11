"""The real meshes load with the published counts, and the reference's layer chain gives the reference's numbers."""

from pathlib import Path

import numpy as np
import pytest
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from mbf_mesh_nav.files.mesh_io import read_mesh
from mbf_mesh_nav.map.map_builder import build_mesh_map
from mbf_mesh_nav.map.map_parameters import MeshMapParameters
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.mesh.repair import MeshError, checked_mesh

# file, vertices after joining identical ones, faces of the file, components, defects that need a repair
PUBLISHED = [
    ("mesh_navigation_tutorials/floor_is_lava_map.ply", 8100, 15960, 1, []),
    ("mesh_navigation_tutorials/floor_is_lava_world.ply", 52, 86, 1, []),
    ("mesh_navigation_tutorials/floor_is_lava_world.dae", 52, 86, 1, []),
    ("mesh_navigation_tutorials/tray_map.ply", 1257, 2416, 1, []),
    ("mesh_navigation_tutorials/tray_world.ply", 8, 10, 1, []),
    ("mesh_navigation_tutorials/parking_garage_world.dae", 444, 662, 1, ["zero_area"]),
    ("mesh_navigation_tutorials/parking_garage_flipped.dae", 444, 662, 1, ["zero_area", "facing_down"]),
    ("mesh_mppi/plane.ply", 289, 512, 1, []),
    ("mesh_mppi/sphere.ply", 2562, 5120, 1, []),
    ("rmagine/triangle.ply", 3, 1, 1, []),
    ("rmagine/two_cubes.dae", 16, 24, 2, []),
    ("rmagine/many_objects.dae", 1198, 2331, 7, ["non_manifold"]),
    ("rmcl_examples/trays.dae", 72, 90, 9, []),
    ("rmcl_examples/sphere.dae", 482, 960, 1, []),
    ("uos_tools/floor.dae", 467, 932, 3, ["zero_area"]),
    ("derived/parking_garage_1m.ply", 60101, 115862, 1, []),
    ("derived/botanical_garden_largest.ply", 22206, 34843, 1, []),
    ("derived/floor_is_lava_lvr2_layout.h5", 8100, 15960, 1, []),
]


@pytest.mark.parametrize(("file", "vertex_count", "face_count", "components", "defects"), PUBLISHED)
def test_mesh_loads_with_the_published_counts(
    shared_data: Path, file: str, vertex_count: int, face_count: int, components: int, defects: list[str]
):
    vertices, faces = read_mesh(shared_data / "meshes" / file)
    assert len(faces) == face_count

    if defects:
        with pytest.raises(MeshError) as error:
            checked_mesh(vertices, faces, ["duplicate_vertices"], file)
        assert [reason.split(":")[0] for reason in error.value.reasons] == defects
    mesh, _ = checked_mesh(vertices, faces, ["duplicate_vertices", *defects], file)
    mesh_map = MeshMap.from_arrays(mesh.vertices, mesh.faces)
    assert len(mesh_map.vertices) == pytest.approx(vertex_count, abs=1 if defects else 0)
    assert len(np.unique(mesh_map.components[mesh_map.faces[:, 0]])) == components


def reference_chain(file: Path, inscribed_radius: float) -> MeshMap:
    """The layers of the tutorials' configuration file."""
    inflation = {
        "inflation_radius": 1.5,
        "inscribed_radius": inscribed_radius,
        "lethal_value": np.inf,
        "inscribed_value": 1.0,
        "cost_scaling_factor": 2.0,
    }
    parameters = MeshMapParameters(
        mesh_file=str(file),
        layers=[
            {"name": "border", "type": "border"},
            {"name": "height_diff", "type": "height_diff"},
            {"name": "roughness", "type": "roughness"},
            {"name": "static", "type": "weighted_sum", "inputs": ["height_diff", "border", "roughness"]},
            {"name": "static_inflation", "type": "inflation", "inputs": ["static"]},
            {"name": "obstacle", "type": "obstacle"},
            {"name": "obstacle_inflation", "type": "inflation", "inputs": ["obstacle"]},
            {"name": "final", "type": "max_combination", "inputs": ["static_inflation", "obstacle_inflation"]},
        ],
        default_layer="final",
        edge_cost_factor=5.0,
    )
    blocks = {
        "border": {"border_cost": 1.0, "threshold": 0.2},
        "height_diff": {"threshold": 0.2},
        "roughness": {"threshold": 0.8},
        "static_inflation": inflation,
        "obstacle_inflation": inflation,
        "obstacle": {"robot_height": 0.7, "obstacle_max_range": 10.0},
    }
    return build_mesh_map(parameters, blocks)


def region_of(mesh_map: MeshMap, point: list[float], cost_limit: float) -> int:
    """Number of the region of passable faces the point lies in; a face is passable if its three corners are."""
    passable = (mesh_map.snapshot().costs < cost_limit)[mesh_map.faces].all(axis=1)
    face, corner = np.nonzero(mesh_map.face_neighbours >= 0)
    other = mesh_map.face_neighbours[face, corner]
    joined = passable[face] & passable[other]
    count = len(mesh_map.faces)
    graph = coo_matrix((np.ones(joined.sum()), (face[joined], other[joined])), shape=(count, count))
    located = mesh_map.locate_one(point, 0.3)
    assert located is not None
    assert passable[located.face]
    return int(connected_components(graph, directed=False)[1][located.face])


def test_floor_is_lava_has_the_lethal_vertices_of_the_reference(shared_data: Path):
    layers = reference_chain(shared_data / "meshes/mesh_navigation_tutorials/floor_is_lava_map.ply", 0.35).layers

    counts = {name: int(layer.lethal.sum()) for name, layer in layers.items()}
    assert counts["height_diff"] == 3340
    assert counts["border"] == 238
    assert counts["roughness"] == 0
    assert counts["final"] == 3564


@pytest.mark.parametrize(("inscribed_radius", "connected"), [(0.1, True), (0.25, True), (0.35, True), (0.4, False)])
def test_floor_is_lava_plateaus_are_joined_up_to_0_35_m_and_cut_at_0_4(
    shared_data: Path, inscribed_radius: float, connected: bool
):
    mesh_map = reference_chain(shared_data / "meshes/mesh_navigation_tutorials/floor_is_lava_map.ply", inscribed_radius)

    # Costs below 1: the far end itself is 0.403 m from the border.
    near_end = region_of(mesh_map, [-0.7, -7.25, -0.11], 1.0)
    far_end = region_of(mesh_map, [6.7, 0.25, -0.12], 1.0)

    assert (near_end == far_end) is connected


def test_two_storeys_of_the_garage_are_distinguished(shared_data: Path):
    vertices, faces = read_mesh(shared_data / "meshes/derived/parking_garage_1m.ply")
    mesh_map = MeshMap.from_arrays(vertices, faces)
    upward = np.flatnonzero(mesh_map.face_normals[:, 2] > 0.99)[::500]
    centres = mesh_map.vertices[mesh_map.faces[upward]].mean(axis=1)

    found = mesh_map.locate(centres + np.array([0.0, 0.0, 0.2]), 0.5)

    np.testing.assert_allclose(found.points[:, 2], centres[:, 2], atol=0.21)
    assert (found.faces >= 0).all()
    assert np.ptp(centres[:, 2]) > 15.0
