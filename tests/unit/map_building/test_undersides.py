"""Solids as inputs of a map: their tops are ground, their undersides are none, and low ceilings stay in the way."""

import numpy as np
import pytest
import trimesh

from mbf_mesh_nav.building.clouds.point_cloud import read_clouds
from mbf_mesh_nav.building.clouds.undersides import out_of_reach
from mbf_mesh_nav.building.surface import build_surface
from mbf_mesh_nav.map.mesh_map import MeshMap


def slab(x, y, top, thickness=0.3, size=(12.0, 8.0)):
    """A closed box with its corner of least coordinates at (x, y) and its top at a height [m]."""
    box = trimesh.creation.box((*size, thickness))
    box.apply_translation((x + 0.5 * size[0], y + 0.5 * size[1], top - 0.5 * thickness))
    return box


def surface_of(parts, file):
    trimesh.util.concatenate(parts).export(file)
    cloud = read_clouds([file])
    return build_surface(cloud.points), cloud.notes


def hidden(mesh, points, faces, clearance=1.5):
    arrays = (np.asarray(mesh.vertices), np.asarray(mesh.faces), np.asarray(points), np.asarray(faces))
    return out_of_reach(*arrays, clearance)


@pytest.mark.parametrize("thickness", [0.05, 0.3, 0.5, 2.0])
@pytest.mark.parametrize("turned", [False, True], ids=["outward", "inside out"])
def test_the_top_of_a_slab_is_the_ground_however_thick_it_is(thickness, turned, tmp_path):
    box = slab(0.0, 0.0, top=0.0, thickness=thickness)
    if turned:
        box.invert()
    surface, notes = surface_of([box], tmp_path / "slab.off")
    np.testing.assert_allclose(surface.vertices[:, 2], 0.0, atol=1e-9)
    assert len(surface.faces) * 0.5 * surface.patches.grid.cell**2 == pytest.approx(96.0, rel=0.05)
    assert notes[1].endswith("samples left out, on solids with no ground below, or less than the clearance above it")


def test_a_ground_closed_far_below_as_by_poissons_method_is_the_ground_alone(tmp_path):
    ball = trimesh.creation.icosphere(4, 8.0)
    ball.vertices[:, 2] = np.where(ball.vertices[:, 2] > 0.0, 0.05, 1.0) * ball.vertices[:, 2]
    surface, _ = surface_of([ball], tmp_path / "closed.off")
    assert surface.vertices[:, 2].min() > -0.5
    assert surface.vertices[:, 2].max() == pytest.approx(0.4, abs=0.05)


@pytest.mark.parametrize(("underside", "free"), [(1.2, False), (2.2, True)])
def test_a_storey_has_the_height_below_the_slab_above_it_and_not_below_its_top(underside, free, tmp_path):
    ground, above = slab(0.0, 0.0, top=0.0), slab(0.0, 0.0, top=underside + 0.4, thickness=0.4, size=(6.0, 8.0))
    surface, _ = surface_of([ground, above], tmp_path / "storeys.off")
    x, z = surface.vertices[:, 0], surface.vertices[:, 2]
    below, far = (z < 0.1) & (x < 5.5), (z < 0.1) & (x > 6.5)
    assert below.any() == free
    assert far.any() and (z[far] < 0.01).all()
    tops = z[(z > 0.1) & (x < 5.5)]
    assert len(tops) == 0 or np.median(tops) == pytest.approx(underside + 0.4, abs=0.02)


def test_a_wall_that_reaches_into_its_floor_stands_on_it(tmp_path):
    floor, wall = slab(0.0, 0.0, top=0.0), slab(6.0, 0.0, top=2.5, thickness=2.7, size=(0.2, 6.0))
    surface, _ = surface_of([floor, wall], tmp_path / "wall.off")
    x, y, z = surface.vertices.T
    np.testing.assert_allclose(z, 0.0, atol=0.05)  # the foot of the wall is sampled, too
    assert not ((x > 6.0) & (x < 6.2) & (y < 5.8)).any()  # it stands there


def test_open_meshes_are_sampled_on_both_sides_as_nobody_knows_which_one_is_up():
    box = slab(0.0, 0.0, top=0.0)
    points, faces = box.sample(2000, return_index=True, seed=3)
    assert hidden(box, points, faces).any()
    lid = trimesh.Trimesh(box.vertices, box.faces[1:], process=False)
    on_lid = faces > 0
    assert not hidden(lid, points[on_lid], faces[on_lid] - 1).any()


def test_a_ramp_that_begins_on_the_floor_leads_to_the_storey_above_it(tmp_path):
    ramp = slab(2.0, 3.0, top=0.0, size=(12.0, 3.0))
    ramp.vertices[:, 2] += 2.4 / 12.0 * (ramp.vertices[:, 0] - 2.0)
    parts = [slab(0.0, 0.0, top=0.0, size=(20.0, 9.0)), ramp, slab(14.0, 0.0, top=2.4, size=(6.0, 9.0))]
    surface, _ = surface_of(parts, tmp_path / "ramp.off")
    mesh_map = MeshMap.from_arrays(surface.vertices, surface.faces)
    start, top = (mesh_map.locate_one(place).face for place in ((1.0, 4.5, 0.0), (17.0, 4.5, 2.4)))
    assert (
        mesh_map.topology.components[mesh_map.faces[start, 0]] == mesh_map.topology.components[mesh_map.faces[top, 0]]
    )
    x, _, z = surface.vertices[(surface.vertices[:, 1] > 3.5) & (surface.vertices[:, 1] < 5.5)].T
    on_ramp = (x > 2.5) & (x < 13.5) & (z > 0.1 * (x - 2.0))
    np.testing.assert_allclose(z[on_ramp], 0.2 * (x[on_ramp] - 2.0), atol=0.06)
    assert not ((x > 2.5) & (x < 8.0) & ~on_ramp).any()  # below the ramp a robot does not fit


def hits(mesh, chosen, point, up):
    """Distances from a point straight up or down to the chosen triangles, one by one."""
    for a, b, c in mesh.triangles[chosen]:
        corners = np.vstack([np.column_stack([a, b, c])[:2], np.ones(3)])
        weights = np.linalg.solve(corners, [point[0], point[1], 1.0])
        distance = up * (weights @ (a[2], b[2], c[2]) - point[2])
        if (weights >= 0.0).all() and distance >= 0.0:
            yield distance


def test_what_is_hidden_is_so_by_a_search_of_all_faces():
    rng = np.random.default_rng(5)
    parts = [trimesh.creation.box(rng.uniform(0.5, 3.0, 3)) for _ in range(12)]
    for part in parts:
        part.apply_transform(trimesh.transformations.random_rotation_matrix(rng.random(3)))
        part.apply_translation(rng.uniform(0.0, 6.0, 3))
    mesh = trimesh.util.concatenate(parts)
    points, faces = mesh.sample(1500, return_index=True, seed=7)
    mask = hidden(mesh, points, faces, clearance=0.8)
    upward = mesh.face_normals[:, 2]
    for point, face, is_hidden in zip(points + 1e-3 * mesh.face_normals[faces], faces, mask, strict=True):
        ceiling = min(hits(mesh, upward < -0.1, point, 1.0), default=np.inf)
        expected = min(hits(mesh, upward > 0.1, point, 1.0), default=np.inf) < ceiling
        if upward[face] > 0.1:
            expected |= ceiling < 0.8
        else:
            gap = min(hits(mesh, upward > 0.1, point, -1.0), default=np.inf)
            expected |= np.isinf(gap) or (upward[face] < -0.1 and gap < 0.8)
        assert is_hidden == expected
    assert 0.2 < mask.mean() < 0.9
