"""The mask of blocked vertices that is brought up to date from plan to plan."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from mbf_mesh_nav.layers.keepout import KeepoutLayer, KeepoutParameters
from mbf_mesh_nav.map.layer import NOTHING_CHANGED, LayerContext
from mbf_mesh_nav.map.layer_graph import LayerGraph
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.search.blocked_vertices import BlockedVertices

COSTS = [0.0, 0.5, 1.0, 2.0, np.inf, np.nan]


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 10_000))
def test_the_remembered_mask_equals_that_of_the_snapshot_after_every_change(seed):
    rng = np.random.default_rng(seed)
    mesh_map = MeshMap.from_heights(np.zeros((6, 7)), 0.1, 0.1)
    layer = KeepoutLayer(LayerContext("seen", mesh_map.topology, mesh_map.locator, KeepoutParameters()))
    mesh_map.set_layers(LayerGraph([layer]), "seen", 1.0)
    remembered = BlockedVertices(mesh_map)
    given_out = []
    for _ in range(6):
        for _ in range(rng.integers(0, 3)):
            chosen = rng.random(42) < 0.2
            costs = np.where(chosen, rng.choice(COSTS, 42), layer.costs).astype(np.float32)
            lethal = layer.lethal ^ (rng.random(42) < 0.1)
            changed = layer.replace(costs, lethal)
            mesh_map.apply(lambda visited, changed=changed: changed if visited is layer else NOTHING_CHANGED)
        if rng.random() < 0.2:
            mesh_map.set_edge_cost_factor(1.0)  # begins anew: what changed is not known
        snapshot, limit = mesh_map.snapshot(), float(rng.choice([0.8, 1.5]))

        mask = remembered.at(snapshot, limit)

        np.testing.assert_array_equal(mask, snapshot.blocked(limit))
        given_out.append((mask, mask.copy()))
    assert all(np.array_equal(mask, copy) for mask, copy in given_out)
