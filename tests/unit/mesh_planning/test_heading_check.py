"""Planners that know no headings return paths whose headings the tilt allows, or say where it does not."""

import math
from unittest import mock

import numpy as np
import pytest

from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.polyline import polyline_lengths
from mbf_abstract.plugins import PlanRequest
from mbf_mesh_nav.planners.any_angle import AnyAnglePlanner
from mbf_mesh_nav.planners.astar import AStarPlanner
from mbf_mesh_nav.planners.cvp import CVPPlanner
from mbf_mesh_nav.planners.dijkstra import DijkstraPlanner
from mbf_mesh_nav.planners.repairing import RepairingPlanner
from mbf_mesh_nav.search import heading_check
from tests.unit.mesh_planning.test_heading_limits import ROUNDING, footprint_use, rough_map

PLANNERS = (DijkstraPlanner, AStarPlanner, CVPPlanner, AnyAnglePlanner, RepairingPlanner)
SEEDS = (0, 2, 3)  # on the terrain of seed 1 no plan is without a note
FORBIDS = "the tilt forbids the heading"


def requests(mesh_map, seed, count=8):
    rng = np.random.default_rng(seed)
    for ends in rng.uniform(0.7, 4.1, (count, 2, 2)):
        heights = 10.0 - mesh_map.locator.cast_rays(np.column_stack([ends, [10.0, 10.0]]), [0.0, 0.0, -1.0])[1]
        start, goal = (Pose((x, y, z)) for (x, y), z in zip(ends.tolist(), heights.tolist(), strict=True))
        yield PlanRequest(start, goal, angle_tolerance=math.pi)


def uses_by_hand(mesh_map, request, positions):
    """Greatest share of a limit (n,) in the middles of pieces of a path, by rays; none in the faces of the ends."""
    lengths = polyline_lengths(positions)
    pieces = np.linspace(0.0, lengths[-1], max(math.ceil(lengths[-1] / heading_check.SPACING), 1) + 1)
    at = 0.5 * (pieces[1:] + pieces[:-1])
    there = lambda along: np.array([np.interp(along, lengths, axis) for axis in positions.T])  # noqa: E731
    uses, settings = [], mesh_map.layers["tilt"].parameters
    ends = {
        v for pose in (request.start, request.goal) for v in mesh_map.faces[mesh_map.locate_one(pose.position).face]
    }
    for length in at:
        point, chord = there(length), there(length + 0.25) - there(length - 0.25)
        place = mesh_map.locate_one(point)
        if mesh_map.faces[place.face][np.argmax(place.barycentric)] in ends:
            continue
        if mesh_map.layers["tilt"].allowed[mesh_map.faces[place.face]].all():
            continue  # the search of a heading-aware planner does not look there either
        heading = chord[:2] / np.hypot(*chord[:2])
        uses.append(footprint_use(mesh_map, settings, point[None], *heading)[0])
    return np.array([0.0, *uses])


@pytest.mark.parametrize("planner_class", PLANNERS)
@pytest.mark.parametrize("seed", SEEDS)
def test_a_plan_without_a_note_keeps_to_headings_the_tilt_allows(make_plugin, planner_class, seed):
    mesh_map = rough_map(seed)
    planner = make_plugin(planner_class, mesh_map)
    plans = [(request, planner.make_plan(request)) for request in requests(mesh_map, seed)]
    allowed = [(request, plan) for request, plan in plans if plan.success and FORBIDS not in plan.message]
    assert allowed
    for request, plan in allowed:
        assert uses_by_hand(mesh_map, request, plan.path.positions).max() <= 1.0 + ROUNDING


@pytest.mark.parametrize("planner_class", PLANNERS)
def test_other_plans_are_found_where_the_first_does_not_hold(make_plugin, planner_class):
    noted = []
    for shares in ((), heading_check.SHARES):
        with mock.patch.object(heading_check, "SHARES", shares):
            results = [
                make_plugin(planner_class, mesh_map).make_plan(request)
                for seed, mesh_map in ((seed, rough_map(seed)) for seed in SEEDS)
                for request in requests(mesh_map, seed)
            ]
        noted.append(sum(FORBIDS in result.message for result in results if result.success))
    assert noted[1] < noted[0]  # on so small a map there is not always a way around


def test_where_no_plan_holds_the_one_with_least_forbidden_is_returned_and_says_where(make_plugin):
    found = 0
    for seed in SEEDS:
        mesh_map = rough_map(seed)
        careless = make_plugin(DijkstraPlanner, mesh_map, tilt_layer="")
        planner = make_plugin(DijkstraPlanner, mesh_map)
        for request in requests(mesh_map, seed):
            first, result = careless.make_plan(request), planner.make_plan(request)
            assert FORBIDS not in first.message
            assert first.success == result.success
            if result.success and FORBIDS in result.message:
                found += 1
                beyond = [
                    np.minimum(uses[uses > 1.0], heading_check.WORST_COUNTED).sum()
                    for uses in (uses_by_hand(mesh_map, request, plan.path.positions) for plan in (result, first))
                ]
                assert beyond[0] <= beyond[1] + 0.5  # by hand only the middles of the pieces are looked at
    assert found


def test_looking_for_another_plan_leaves_nothing_behind_that_a_repairing_planner_remembers(make_plugin):
    mesh_map = rough_map(1)
    kept = make_plugin(RepairingPlanner, mesh_map)
    for request in requests(mesh_map, 1):
        results = [
            kept.make_plan(request),
            kept.make_plan(request),
            make_plugin(RepairingPlanner, mesh_map).make_plan(request),
        ]
        assert len({result.outcome for result in results}) == 1
        assert len({result.cost for result in results}) == 1
