"""Replanning by repair: after any change of costs the answer is that of a search from scratch."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mbf_abstract.geometry import Pose
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import PlanRequest
from mbf_abstract.time.cancel import CancelToken
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.map.snapshot import REMEMBERED_CHANGES
from mbf_mesh_nav.planners.repairing import RepairingPlanner

REQUEST = PlanRequest(Pose.planar(0.31, 0.27), Pose.planar(3.72, 3.58))


@pytest.fixture(scope="module")
def bumpy():
    rng = np.random.default_rng(2)
    return MeshMap.from_heights(rng.uniform(0, 0.1, (21, 21)), 0.2, 0.2)


def show(mesh_map, costs):
    """Give the painted layer new costs."""
    mesh_map.apply(lambda layer: layer.replace(costs, ~np.isfinite(costs)))


def repaint(mesh_map, rng):
    """Change the costs of one random disc of the painted layer, up, down or to lethal."""
    costs = mesh_map.layers["painted"].costs.copy()
    center, radius = rng.uniform(0.5, 3.5, 2), rng.uniform(0.2, 0.9)
    disc = np.linalg.norm(mesh_map.vertices[:, :2] - center, axis=1) < radius
    costs[disc] = rng.choice([0.0, 0.3, 0.8, np.inf])
    ends = np.linalg.norm(mesh_map.vertices[:, None, :2] - [[0.31, 0.27], [3.72, 3.58]], axis=2).min(axis=1) < 0.3
    costs[ends] = rng.uniform(0, 0.5)
    show(mesh_map, costs)


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
    costs = bumpy.layers["painted"].costs.copy()
    costs[np.linalg.norm(bumpy.vertices[:, :2] - [0.6, 3.4], axis=1) < 0.25] = np.inf
    show(bumpy, costs)
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


def test_a_corner_of_the_goals_face_that_becomes_free_counts_as_a_way_to_the_goal(make_plugin, paint, bumpy):
    corner = bumpy.faces[bumpy.locate_one(REQUEST.goal.position).face][0]
    paint(bumpy, lambda v: np.where(np.arange(len(v)) == corner, np.inf, 0.0))
    planner = make_plugin(RepairingPlanner, bumpy)
    planner.make_plan(REQUEST)
    free = np.zeros(len(bumpy.vertices), np.float32)
    show(bumpy, free)
    planner.make_plan(REQUEST)
    scratch = make_plugin(RepairingPlanner, bumpy)
    scratch.make_plan(REQUEST)
    np.testing.assert_array_equal(planner._wave.distances, scratch._wave.distances)


def test_a_planner_that_missed_too_many_changes_starts_over(make_plugin, paint, bumpy):
    paint(bumpy, lambda v: np.zeros(len(v)), edge_cost_factor=1.0)
    planner = make_plugin(RepairingPlanner, bumpy)
    planner.make_plan(REQUEST)
    for change in range(REMEMBERED_CHANGES + 1):
        costs = np.zeros(len(bumpy.vertices), np.float32)
        costs[change] = 0.5
        show(bumpy, costs)
    assert bumpy.changes_between(planner._wave.version, bumpy.snapshot().version) is None
    assert planner.make_plan(REQUEST).cost == make_plugin(RepairingPlanner, bumpy).make_plan(REQUEST).cost


def test_another_cost_limit_starts_over(make_plugin, paint, bumpy):
    paint(bumpy, lambda v: np.where(abs(v[:, 0] - v[:, 1]) < 0.5, 0.5, 0.0))
    planner = make_plugin(RepairingPlanner, bumpy)
    planner.make_plan(PlanRequest(Pose.planar(0.2, 3.0), Pose.planar(1.0, 3.6)))
    planner.parameters = RepairingPlanner.Parameters(cost_limit=0.4)
    crossing = PlanRequest(Pose.planar(3.6, 1.0), Pose.planar(1.0, 3.6))
    assert planner.make_plan(crossing).outcome == GetPathOutcome.NO_PATH_FOUND
