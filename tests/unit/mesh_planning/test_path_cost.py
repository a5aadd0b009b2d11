"""Length plus collected cost of ways through faces, against a naive twin."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mbf_mesh_nav.kernels.motion.path_costs import way_cost
from mbf_mesh_nav.map.mesh_map import MeshMap


def naive_cost(mesh, costs, factor, positions, point_faces):
    """Solve for the weights of the corners in the middle of each step; those of infinite cost do not count."""
    total = 0.0
    for start, end, face in zip(positions[:-1], positions[1:], point_faces[1:], strict=True):
        corners = mesh.faces[face]
        weights = np.linalg.lstsq(np.vstack([mesh.vertices[corners].T, np.ones(3)]), [*(start + end) / 2, 1.0])[0]
        finite = np.isfinite(costs[corners])
        cost = weights[finite] @ costs[corners][finite] / weights[finite].sum() if finite.any() else 0.0
        total += np.linalg.norm(end - start) * (1.0 + factor * cost)
    return total


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 10_000), st.sampled_from([0.0, 0.3, 2.0]))
def test_cost_of_a_way_equals_its_twin(seed, factor):
    rng = np.random.default_rng(seed)
    mesh = MeshMap.from_heights(rng.random((5, 6)), 0.5, 0.5)
    costs = rng.random(len(mesh.vertices), dtype=np.float32)
    costs[rng.random(len(costs)) < 0.2] = np.inf
    face = int(rng.integers(len(mesh.faces)))
    positions = rng.dirichlet([2.0, 2.0, 2.0], size=7) @ mesh.vertices[mesh.faces[face]]
    point_faces = np.full(7, face, dtype=np.int32)

    cost = way_cost(mesh.vertices, mesh.faces, costs, factor, positions, point_faces)

    assert cost == pytest.approx(naive_cost(mesh, costs, factor, positions, point_faces), rel=1e-9)
