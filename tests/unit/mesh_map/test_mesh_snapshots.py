"""Snapshots: each is the state a new map would have, and none ever changes, whoever holds what of it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mbf_abstract.geometry import Pose
from mbf_abstract.maps.avoided_places import AvoidedPlace
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.map.snapshot import SnapshotSeries


@pytest.fixture(scope="module")
def topology():
    heights = np.random.default_rng(1).uniform(0, 0.2, (9, 8))
    return MeshMap.from_heights(heights, 0.3, 0.3).topology


def arrays_of(snapshot):
    return snapshot.costs, snapshot.lethal, snapshot.edge_weights


@given(seed=st.integers(0, 10**6))
@settings(max_examples=30, deadline=None)
def test_any_series_of_changes_gives_the_snapshots_of_new_maps_and_leaves_held_ones_alone(topology, seed):
    rng = np.random.default_rng(seed)
    costs, lethal = np.zeros(topology.vertex_count, np.float32), np.zeros(topology.vertex_count, np.bool_)
    series = SnapshotSeries(topology)
    snapshot = series.begin(costs, lethal, 2.0)
    held = []
    for version in range(1, 12):
        if rng.random() < 0.5:  # a plugin keeps one array, or a part of it
            array = arrays_of(snapshot)[rng.integers(3)]
            held.append((array[rng.integers(5) :], array[0:].copy()))
        changed = rng.choice(topology.vertex_count, rng.integers(1, 30), replace=False).astype(np.int32)
        costs[changed] = rng.choice([0.0, 0.4, np.inf], len(changed))
        lethal[changed] = rng.random(len(changed)) < 0.3
        snapshot = series.follow(costs, lethal, changed)
        assert snapshot.version == version
        for array, expected in zip(
            arrays_of(snapshot), arrays_of(SnapshotSeries(topology).begin(costs, lethal, 2.0)), strict=True
        ):
            np.testing.assert_array_equal(array, expected)
    for part, values in held:
        np.testing.assert_array_equal(part, values[len(values) - len(part) :])


def test_the_arrays_of_a_snapshot_nobody_holds_are_used_again(topology):
    costs, lethal = np.zeros(topology.vertex_count, np.float32), np.zeros(topology.vertex_count, np.bool_)
    series, changed = SnapshotSeries(topology), np.array([3, 4], np.int32)
    snapshot = series.begin(costs, lethal, 1.0)
    places = [snapshot.edge_weights.ctypes.data]
    for _ in range(4):
        snapshot = series.follow(costs, lethal, changed)
        places.append(snapshot.edge_weights.ctypes.data)
    assert places[0] == places[2] == places[4] != places[1] == places[3]
    held = snapshot.edge_weights[:2]
    series.follow(costs, lethal, changed)
    snapshot = series.follow(costs, lethal, changed)
    assert not np.shares_memory(snapshot.edge_weights, held)


def test_a_place_to_avoid_is_free_again_on_a_map_without_a_default_layer():
    mesh_map = MeshMap.from_heights(np.zeros((5, 5)), 0.5, 0.5)
    mesh_map.avoid([AvoidedPlace(Pose((1.0, 1.0, 0.0)), 0.6)])
    assert mesh_map.snapshot().lethal.any()
    mesh_map.avoid([])
    assert not mesh_map.snapshot().lethal.any()
