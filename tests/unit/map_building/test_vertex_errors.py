"""Each vertex of a built map has the error of its own place, which grows where the points disagree."""

import numpy as np
import pytest
from cloud_files import write_ply
from hypothesis import given, settings
from hypothesis import strategies as st
from surveyed_ground import flat, from_wrong_poses, ground, hills

from mbf_mesh_nav.building.decimation import carried_errors, decimated, decimated_to
from mbf_mesh_nav.building.map_build import build_map
from mbf_mesh_nav.building.surface import build_surface
from mbf_mesh_nav.files.vertex_errors import VertexErrors, read_vertex_errors
from mbf_mesh_nav.kernels.building.disagreement import sums_around
from mbf_mesh_nav.kernels.building.patches import link_patches
from mbf_mesh_nav.map.mesh_map import MeshMap

BOULDERS = np.array([(x, y) for x in (3.0, 5.5, 8.0, 10.5, 13.0) for y in (3.0, 6.0, 9.0)])
RADIUS, HEIGHT = 0.25, 0.25


def from_boulders(x, y):
    """Distances (n,) of places from the nearest boulder [m]."""
    return np.hypot(np.subtract.outer(x, BOULDERS[:, 0]), np.subtract.outer(y, BOULDERS[:, 1])).min(axis=1)


def with_boulders(x, y):
    """Level ground with round boulders of 0.25 m."""
    beside = np.minimum(from_boulders(x, y) / RADIUS, 1.0)
    return HEIGHT * np.sqrt(1.0 - beside * beside)


def places_of(surface):
    """Distances (V,) of the vertices from the boulders, and which are farther than a metre from the survey's edge."""
    inner = ((surface.vertices[:, :2] > 1.0) & (surface.vertices[:, :2] < (15.0, 11.0))).all(axis=1)
    return from_boulders(*surface.vertices[:, :2].T), inner


def rms(values):
    return np.sqrt((values * values).mean())


@pytest.mark.parametrize("seed", [31, 32, 33])
def test_boulders_that_wrong_poses_smear_state_their_error_and_the_ground_around_them_does_not(seed):
    rng = np.random.default_rng(seed)
    surface = build_surface(from_wrong_poses(rng, ground(rng, with_boulders)))
    away, inner = places_of(surface)
    at_boulder, beside = away < 0.3, inner & (away > 0.8)
    wrong = surface.vertices[:, 2] - with_boulders(*surface.vertices[:, :2].T)
    assert rms(wrong[at_boulder]) > 2.0 * rms(wrong[beside]), "the boulders are smeared"
    stated, usual = surface.height_errors[at_boulder], np.median(surface.height_errors[beside])
    assert rms(stated) > 2.0 * usual
    assert 0.5 * rms(wrong[at_boulder]) < rms(stated) < 2.0 * rms(wrong[at_boulder])
    assert np.quantile(surface.height_errors[beside], 0.9) < 1.25 * usual


def test_without_wrong_poses_the_error_is_that_of_few_points():
    surface = build_surface(ground(np.random.default_rng(34), flat))
    _, inner = places_of(surface)
    errors = surface.height_errors[inner]
    # Four points a cell and noise of 2 cm; the mean of 1/n is 0.33.
    assert np.median(errors) == pytest.approx(0.02 * np.sqrt(0.33), rel=0.1)
    assert np.quantile(errors, 0.99) < 2.0 * np.median(errors)


def sums_one_by_one(distances, firsts, ends, links, used):
    """Naive twin of ``sums_around``."""
    result = np.zeros((len(firsts), 4))
    for patch, linked in enumerate(links):
        for one in [patch, *linked[linked >= 0]]:
            own = distances[firsts[one] : ends[one]].astype(float)
            own = own[np.isfinite(own)]
            if used[one] and len(own):
                result[patch] += [(own * own).sum(), len(own), 1.0, 1.0 / len(own)]
    return result


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 10_000))
def test_the_sums_around_a_patch_are_those_of_itself_and_its_neighbours(seed):
    rng = np.random.default_rng(seed)
    columns, rows = 5, 4
    counts = rng.integers(0, 4, columns * rows)
    ends = np.cumsum(counts).astype(np.int64)
    distances = np.where(rng.random(ends[-1]) < 0.2, np.nan, rng.normal(0.0, 0.05, ends[-1])).astype(np.float32)
    cells, heights = np.arange(columns * rows, dtype=np.int32), rng.normal(0.0, 0.2, columns * rows)
    links = link_patches(cells, heights, np.arange(columns * rows + 1, dtype=np.int32), columns, 0.3)
    arrays = distances, ends - counts, ends, links, rng.random(columns * rows) < 0.8
    np.testing.assert_allclose(sums_around(*arrays), sums_one_by_one(*arrays))


def test_the_map_file_keeps_the_error_of_each_vertex(tmp_path):
    rng = np.random.default_rng(35)
    write_ply(tmp_path / "scan.ply", from_wrong_poses(rng, ground(rng, with_boulders)))
    facts, surface, _ = build_map([tmp_path / "scan.ply"], tmp_path / "map.ply")
    errors = read_vertex_errors(tmp_path / "map.ply")
    np.testing.assert_array_equal(errors.of_vertices, surface.height_errors.astype(np.float32))
    np.testing.assert_array_equal(errors.of_places, surface.place_errors.astype(np.float32))
    assert facts.height_error == pytest.approx(rms(surface.height_errors))


def test_a_decimated_surface_has_the_errors_of_what_lies_around_its_vertices():
    rng = np.random.default_rng(36)
    surface = build_surface(from_wrong_poses(rng, ground(rng, with_boulders)))
    whole = surface.vertices, surface.faces
    stated = VertexErrors(surface.height_errors, surface.place_errors)
    assert carried_errors(decimated(*whole, 1e-6), *whole, stated) is stated
    mesh = decimated_to(*whole, 0.25)
    errors, _ = carried_errors(mesh, *whole, stated)
    away = from_boulders(*mesh.vertices[:, :2].T)
    assert rms(errors[away < 0.4]) > 1.5 * np.median(errors)
    assert rms(errors) > rms(surface.height_errors), "decimation adds its own"


def test_on_gentle_hills_decimation_adds_what_its_faces_are_off():
    surface = build_surface(ground(np.random.default_rng(37), hills))
    mesh = decimated_to(surface.vertices, surface.faces, 0.25)
    exact = np.zeros(len(surface.vertices))
    for errors in carried_errors(mesh, surface.vertices, surface.faces, VertexErrors(exact, exact)):
        assert 0.5 * mesh.error_rms < rms(errors) < 2.0 * mesh.error_rms


def differences(vertices, faces, truth, rng, length=0.55):
    """How wrong the difference of two heights on a map (n,) is, over sqrt(2), at random places `length` apart [m]."""
    on_map = MeshMap.from_arrays(vertices, faces).locator
    places, angles = rng.uniform((2.0, 2.0), (14.0, 10.0), (4000, 2)), rng.uniform(0.0, 2.0 * np.pi, 4000)
    wrong = []
    for xy in (places, places + length * np.column_stack([np.cos(angles), np.sin(angles)])):
        _, lengths = on_map.cast_rays(np.column_stack([xy, np.full(4000, 50.0)]), np.tile([0.0, 0.0, -1.0], (4000, 1)))
        wrong.append(50.0 - lengths - truth(*xy.T))
    return (wrong[0] - wrong[1]) / np.sqrt(2.0)


def test_between_the_vertices_heights_differ_by_what_is_stated_of_places():
    rng = np.random.default_rng(38)
    surface = build_surface(ground(rng, hills))
    found = rms(differences(surface.vertices, surface.faces, hills, rng))
    assert 0.95 * found < np.median(surface.place_errors) < 1.25 * found < np.median(surface.height_errors)


def test_places_of_a_decimated_surface_are_less_wrong_than_its_vertices_and_not_better_than_they_are():
    rng = np.random.default_rng(40)
    surface = build_surface(ground(rng, hills))
    whole, stated = (surface.vertices, surface.faces), VertexErrors(surface.height_errors, surface.place_errors)
    mesh = decimated_to(*whole, 0.25)
    of_vertices, of_places = carried_errors(mesh, *whole, stated)
    found = rms(differences(mesh.vertices, mesh.faces, hills, rng))
    assert found < np.median(of_places) < 0.85 * np.median(of_vertices)


@pytest.mark.parametrize("relief", [flat, hills])
def test_where_heights_are_smoothed_places_are_not_better_than_they_are(relief):
    rng = np.random.default_rng(39)
    surface = build_surface(from_wrong_poses(rng, ground(rng, relief)))
    found = rms(differences(surface.vertices, surface.faces, relief, rng))
    assert found < np.median(surface.place_errors) <= np.median(surface.height_errors)
