"""Replanning by repair: after any change of costs the answer is that of a search from scratch."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mbf_abstract.cancel import CancelToken
from mbf_abstract.geometry import Pose
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import PlanRequest
from mbf_mesh_nav.mesh_map import MeshMap
from mbf_mesh_nav.planners.repairing import RepairingPlanner

REQUEST = PlanRequest(Pose.planar(0.31, 0.27), Pose.planar(3.72, 3.58))


@pytest.fixture(scope="module")
def bumpy():
    rng = np.random.default_rng(2)
    return MeshMap.from_heights(rng.uniform(0, 0.1, (21, 21)), 0.2, 0.2)


def repaint(mesh_map, rng):
    """Change the costs of one random disc of the painted layer, up, down or to lethal."""
    layer = mesh_map.layers["painted"]
    costs = layer.costs.copy()
    center, radius = rng.uniform(0.5, 3.5, 2), rng.uniform(0.2, 0.9)
    disc = np.linalg.norm(mesh_map.vertices[:, :2] - center, axis=1) < radius
    costs[disc] = rng.choice([0.0, 0.3, 0.8, np.inf])
    ends = np.linalg.norm(mesh_map.vertices[:, None, :2] - [[0.31, 0.27], [3.72, 3.58]], axis=2).min(axis=1) < 0.3
    costs[ends] = rng.uniform(0, 0.5)
    mesh_map._publish({"painted": layer.replace(costs, ~np.isfinite(costs))})


@given(seed=st.integers(0, 10**6))
@settings(max_examples=25, deadline=None)
def test_after_a_series_of_changes_the_repaired_field_is_the_one_from_scratch(make_plugin, paint, bumpy, seed):
    rng = np.random.default_rng(seed)
    paint(bumpy, lambda v: np.zeros(len(v)), edge_cost_factor=3.0)
    repairing = make_plugin(RepairingPlanner, bumpy)
    repairing.make_plan(REQUEST)
    for _ in range(4):
        repaint(bumpy, rng)
        kept = repairing.make_plan(REQUEST)
        scratch_planner = make_plugin(RepairingPlanner, bumpy)
        scratch = scratch_planner.make_plan(REQUEST)
        assert (kept.outcome, kept.cost) == (scratch.outcome, scratch.cost)
        if scratch_planner._wave is not None and repairing._wave is not None:
            np.testing.assert_array_equal(repairing._wave.distances, scratch_planner._wave.distances)


def test_a_small_change_recomputes_a_small_part(make_plugin, paint, bumpy):
    paint(bumpy, lambda v: np.zeros(len(v)), edge_cost_factor=3.0)
    planner = make_plugin(RepairingPlanner, bumpy)
    planner.make_plan(REQUEST)
    before = planner._wave.distances.copy()
    layer = bumpy.layers["painted"]
    costs = layer.costs.copy()
    costs[np.linalg.norm(bumpy.vertices[:, :2] - [0.6, 3.4], axis=1) < 0.25] = np.inf
    bumpy._publish({"painted": layer.replace(costs, ~np.isfinite(costs))})
    planner.make_plan(REQUEST)
    assert 0 < np.count_nonzero(planner._wave.distances != before) < 0.1 * len(before)


def test_a_cancelled_repair_is_forgotten(make_plugin, paint, bumpy):
    paint(bumpy, lambda v: np.zeros(len(v)))
    planner = make_plugin(RepairingPlanner, bumpy)
    expected = planner.make_plan(REQUEST).cost
    token = CancelToken()
    token.cancel()
    cancelled = planner.make_plan(PlanRequest(REQUEST.start, REQUEST.goal, cancel_token=token))
    assert cancelled.outcome == GetPathOutcome.CANCELED and planner._wave is None
    assert planner.make_plan(REQUEST).cost == expected
