"""Refining paths of the vertex graph: shorter, never more expensive, on free surface, with the same ends."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mbf_abstract.geometry import Path, Pose
from mbf_abstract.outcomes import RefinePathOutcome
from mbf_abstract.plugins import PlanRequest
from mbf_abstract.time.cancel import CancelToken
from mbf_mesh_nav.map.ground import ground_heights
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.planners.any_angle import AnyAnglePlanner
from mbf_mesh_nav.planners.astar import AStarPlanner
from mbf_mesh_nav.refiners.string_pulling import StringPullingRefiner

INTEGRATION_STEP = 0.005
"""m between the places at which a path's cost is sampled; costs of the maps below change by at most 20 a metre."""


def sampled_cost(mesh_map, positions, factor):
    """The slow twin of a path's cost: the costs of the nearest surface, added up in short steps."""
    total = 0.0
    costs = np.minimum(mesh_map.snapshot().costs, 1.0)
    for start, end in itertools.pairwise(positions):
        length = float(np.sqrt(((end - start) ** 2).sum()))
        count = max(1, int(np.ceil(length / INTEGRATION_STEP)))
        places = start + (end - start) * ((np.arange(count) + 0.5) / count)[:, None]
        spots = mesh_map.locate(places)
        along = (spots.barycentric * costs[mesh_map.faces[spots.faces]]).sum(axis=1)
        total += length * (1.0 + factor * float(along.mean()))
    return total


def planned(make_plugin, mesh_map, start, goal, planner=AStarPlanner):
    heights = [max(ground_heights(mesh_map, *place)) for place in (start, goal)]
    poses = [Pose((*place, height)) for place, height in zip((start, goal), heights, strict=True)]
    result = make_plugin(planner, mesh_map).make_plan(PlanRequest(*poses))
    assert result.path is not None, result.message
    return result.path


def refined(make_plugin, mesh_map, path, **parameters):
    result = make_plugin(StringPullingRefiner, mesh_map, **parameters).apply_refinement(path, CancelToken())
    assert result.outcome == RefinePathOutcome.SUCCESS, result.message
    return result.path


def turning(path):
    """Sum of all turns [rad] of a path seen from above."""
    steps = np.diff(path.positions[:, :2], axis=0)
    headings = np.arctan2(steps[:, 1], steps[:, 0])
    return float(np.abs((np.diff(headings) + np.pi) % (2.0 * np.pi) - np.pi).sum())


def test_a_path_along_the_edges_of_a_plain_becomes_the_straight_line(make_plugin, plain):
    mesh_map = plain()
    path = planned(make_plugin, mesh_map, (0.6, 0.6), (5.2, 2.4))
    straight = float(np.hypot(4.6, 1.8))
    assert path.length > 1.05 * straight

    pulled = refined(make_plugin, mesh_map, path)

    assert pulled.length == pytest.approx(straight, rel=1e-9)
    assert turning(pulled) < 1e-6


def hilly(seed, paint):
    """Bumps with costs of two length scales, and three lethal discs off the ends."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.arange(41) * 0.15, np.arange(41) * 0.15)
    a, b, c, d = rng.uniform(0.5, 2.0, 4)
    mesh_map = MeshMap.from_heights(0.2 * np.sin(a * x + b) * np.cos(c * y + d), 0.15, 0.15)
    centres = rng.uniform(1.5, 4.5, (3, 2))

    def costs(vertices):
        values = 0.45 * (1.0 + np.sin(3.0 * vertices[:, 0] * a) * np.sin(2.0 * vertices[:, 1] * c))
        for centre in centres:
            values[((vertices[:, :2] - centre) ** 2).sum(axis=1) < 0.4**2] = np.inf
        return values

    return paint(mesh_map, costs, edge_cost_factor=2.0)


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 10_000))
def test_a_refined_path_costs_no_more_and_stays_on_free_surface(make_plugin, paint, seed):
    mesh_map = hilly(seed, paint)
    path = planned(make_plugin, mesh_map, (0.5, 0.7), (5.3, 5.2))

    pulled = refined(make_plugin, mesh_map, path)

    assert pulled.positions[[0, -1]] == pytest.approx(path.positions[[0, -1]], abs=1e-9)
    assert pulled[-1].orientation == path[-1].orientation
    assert sampled_cost(mesh_map, pulled.positions, 2.0) <= 1.002 * sampled_cost(mesh_map, path.positions, 2.0)
    spots = mesh_map.locate(0.5 * (pulled.positions[1:] + pulled.positions[:-1]))
    assert spots.distances.max() < 1e-6, "a refined path leaves the surface"
    lethal_corners = mesh_map.snapshot().lethal[mesh_map.faces[spots.faces]]
    free_share = (lethal_corners * spots.barycentric).sum(axis=1)
    assert free_share.max() < 1e-6, "a refined path leads over lethal surface"


def test_over_costs_a_refined_path_is_nearly_as_good_as_that_of_the_wave(make_plugin, paint):
    ratios = []
    for seed in range(12):
        mesh_map = hilly(seed, paint)
        ends = (0.5, 0.7), (5.3, 5.2)
        best = planned(make_plugin, mesh_map, *ends, planner=AnyAnglePlanner)
        raw = planned(make_plugin, mesh_map, *ends)
        pulled = refined(make_plugin, mesh_map, raw)
        costs = [sampled_cost(mesh_map, path.positions, 2.0) for path in (pulled, best, raw)]
        ratios.append((costs[0] / costs[1], costs[2] / costs[1]))
    pulled_ratios, raw_ratios = zip(*ratios, strict=True)
    assert np.mean(pulled_ratios) < 1.02 < np.mean(raw_ratios)


def test_a_detour_around_costs_is_not_pulled_through_them(make_plugin, plain, paint):
    mesh_map = paint(plain(), lambda v: np.where(np.hypot(v[:, 0] - 3.0, v[:, 1] - 3.0) < 1.0, 0.9, 0.0), 20.0)
    path = planned(make_plugin, mesh_map, (1.0, 3.0), (5.0, 3.0))

    pulled = refined(make_plugin, mesh_map, path)

    assert pulled.length < path.length
    assert np.hypot(pulled.positions[:, 0] - 3.0, pulled.positions[:, 1] - 3.0).min() > 0.95


def test_poses_far_apart_are_followed_over_the_surface_between_them(make_plugin, hills):
    path = planned(make_plugin, hills, (0.5, 0.5), (5.3, 4.1))
    sparse = Path(path.positions[::9], path.orientations[::9], path.frame_id, path.stamp)

    pulled = refined(make_plugin, hills, sparse)

    middles = 0.5 * (pulled.positions[1:] + pulled.positions[:-1])
    assert hills.locate(middles).distances.max() < 1e-6
    assert pulled.length < path.length


def test_a_pose_off_the_surface_is_named(make_plugin, hills):
    path = planned(make_plugin, hills, (0.5, 0.5), (3.0, 2.0))
    floating = Path(path.positions + np.array([0.0, 0.0, 2.0]), path.orientations, path.frame_id, path.stamp)

    result = make_plugin(StringPullingRefiner, hills).apply_refinement(floating, CancelToken())

    assert result.outcome == RefinePathOutcome.MAP_ERROR
    assert "pose 0 of the path, (0.50, 0.50, " in result.message
    assert result.path is floating


def test_a_path_that_drives_backward_is_left_as_it_is(make_plugin, hills):
    path = planned(make_plugin, hills, (0.5, 0.5), (3.0, 2.0))
    backward = Path.from_points(path.positions[::-1], path[0].orientation, frame_id=path.frame_id)
    turned = Path(path.positions, backward.orientations[::-1], path.frame_id, path.stamp)

    result = make_plugin(StringPullingRefiner, hills).apply_refinement(turned, CancelToken())

    assert result.outcome == RefinePathOutcome.SUCCESS
    assert result.path is turned
    assert "backward" in result.message


def test_a_canceled_refinement_hands_the_path_back(make_plugin, hills):
    path = planned(make_plugin, hills, (0.5, 0.5), (5.3, 4.1))
    token = CancelToken()
    token.cancel("enough")

    result = make_plugin(StringPullingRefiner, hills).apply_refinement(path, token)

    assert (result.outcome, result.message) == (RefinePathOutcome.CANCELED, "enough")
    assert result.path is path
