"""A decimated map is no farther from the whole one than its bound, wherever one looks."""

import numpy as np
import pytest
from cloud_files import write_ply
from surveyed_ground import ground, hills, tree

from mbf_mesh_nav.building.decimation import decimated, decimated_to
from mbf_mesh_nav.building.map_build import build_map
from mbf_mesh_nav.building.surface import SurfaceParameters, build_surface
from mbf_mesh_nav.files.map_header import read_map_header
from mbf_mesh_nav.map.mesh_map import MeshMap


@pytest.fixture(scope="module")
def surface():
    rng = np.random.default_rng(14)
    return build_surface(np.vstack([ground(rng, hills), tree(rng, 8.0, 6.0, hills(8.0, 6.0))]))


def some_places(vertices, faces, count=4000):
    """Places (n, 3) anywhere on a mesh."""
    rng = np.random.default_rng(15)
    weights = rng.dirichlet(np.ones(3), count)
    return (vertices[faces[rng.integers(0, len(faces), count)]] * weights[:, :, None]).sum(axis=1)


@pytest.mark.parametrize("bound", [0.03, 0.1])
def test_no_place_of_either_surface_is_farther_from_the_other_than_the_bound(surface, bound):
    coarse = decimated(surface.vertices, surface.faces, bound)
    assert len(coarse.faces) < 0.7 * len(surface.faces)
    assert 0.0 < coarse.error_rms < coarse.error_max <= bound
    one, other = (
        MeshMap.from_arrays(*mesh) for mesh in ((coarse.vertices, coarse.faces), (surface.vertices, surface.faces))
    )
    for here, there in ((one, other), (other, one)):
        distances = here.locate(some_places(there.vertices, there.faces)).distances
        assert distances.max() <= 1.1 * bound


def test_a_wider_bound_leaves_fewer_faces_and_the_hole_of_a_tree_stays_one(surface):
    fine, coarse = (decimated(surface.vertices, surface.faces, bound) for bound in (0.03, 0.1))
    assert len(coarse.faces) < len(fine.faces)
    mesh_map = MeshMap.from_arrays(coarse.vertices, coarse.faces)
    assert mesh_map.locate_one([8.0, 6.0, hills(8.0, 6.0)], 0.05) is None


def test_where_no_coarser_mesh_keeps_the_bound_nothing_is_left_out(surface):
    whole = decimated(surface.vertices, surface.faces, 1e-6)
    assert whole.faces is surface.faces
    assert whole.error_max == 0.0


def test_a_quarter_of_the_faces_covers_no_part_of_a_hole(surface):
    coarse = decimated_to(surface.vertices, surface.faces, 0.25)
    assert len(coarse.faces) == pytest.approx(0.25 * len(surface.faces), rel=0.1)
    mesh_map = MeshMap.from_arrays(surface.vertices, surface.faces)
    on_coarse = some_places(coarse.vertices, coarse.faces)
    near = np.hypot(*(on_coarse[:, :2] - (8.0, 6.0)).T) < 0.6
    assert mesh_map.locate(on_coarse[near]).distances.max() < 0.06


def test_the_map_file_states_what_decimation_adds_to_its_error(tmp_path):
    cloud = tmp_path / "scan.ply"
    write_ply(cloud, ground(np.random.default_rng(16), hills))
    whole, _, _ = build_map([cloud], tmp_path / "whole.ply")
    facts, _, _ = build_map([cloud], tmp_path / "coarse.ply", SurfaceParameters(decimation_bound=0.05))
    assert facts.faces < facts.faces_before == whole.faces
    assert whole.height_error < facts.height_error < 0.05
    assert read_map_header(tmp_path / "coarse.ply").height_error == facts.height_error
