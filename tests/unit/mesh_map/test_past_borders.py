"""Positions past the border of a surface: the kernel, compared with the same in whole arrays."""

import numpy as np
import pytest

from mbf_abstract.geometry.arithmetic import norm
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.mesh.borders import BORDER_SLACK, ON_EDGE, beyond_border
from mbf_mesh_nav.mesh.checked_mesh import CheckedMesh
from mbf_mesh_nav.mesh.locate import SurfaceLocator
from mbf_mesh_nav.mesh.topology import build_topology


def naive(topology, places, location):
    """As the kernel, for all places at once."""
    on_surface = np.maximum(location.faces, 0)
    offsets = np.where(location.faces[:, None] >= 0, places - location.points, 0.0)
    normals = topology.face_normals[on_surface]
    sideways = offsets - (offsets * normals).sum(axis=1, keepdims=True) * normals
    near = np.nan_to_num(location.barycentric, nan=1.0) > ON_EDGE
    on_border = (~np.roll(near, -2, axis=1) & (topology.face_neighbours[on_surface] < 0)).any(axis=1)
    in_vertex = near.sum(axis=1) == 1
    on_border |= in_vertex & (near & topology.border_vertices[topology.faces[on_surface]]).any(axis=1)
    return on_border & (norm(sideways) > BORDER_SLACK)


@pytest.fixture(scope="module")
def surface():
    """A rough field of 3 m x 3 m with a hole in it."""
    rng = np.random.default_rng(2)
    whole = MeshMap.from_heights(rng.uniform(0.0, 0.2, (31, 31)), 0.1, 0.1).topology
    middles = whole.vertices[whole.faces].mean(axis=1)
    faces = np.ascontiguousarray(whole.faces[np.hypot(middles[:, 0] - 1.5, middles[:, 1] - 1.5) > 0.5])
    used = np.unique(faces).astype(np.int32)
    corners = np.searchsorted(used, faces).astype(np.int32)
    own = np.arange(len(used), dtype=np.int32), np.arange(len(faces), dtype=np.int32)
    topology = build_topology(CheckedMesh(whole.vertices[used], corners, own[0], own[1], own[0]))
    return topology, SurfaceLocator(topology)


def test_the_kernel_says_what_whole_arrays_say(surface):
    topology, locator = surface
    rng = np.random.default_rng(3)
    beside = rng.uniform((-0.4, -0.4, -0.5), (3.4, 3.4, 0.7), (4000, 3))
    corners = topology.vertices[rng.integers(len(topology.vertices), size=500)] + rng.normal(0.0, 0.06, (500, 3))
    places = np.concatenate([beside, corners])
    location = locator.locate(places, 0.6)
    past = beyond_border(topology, places, location)
    assert past.tolist() == naive(topology, places, location).tolist()
    assert (location.faces < 0).any() and past.any() and not past.all()
