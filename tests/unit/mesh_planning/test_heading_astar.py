"""Planning with headings: against a naive twin, and on a hill that may be climbed but not traversed."""

import heapq
from dataclasses import dataclass

import numpy as np
import pytest
import scipy.sparse.csgraph
from hypothesis import given, settings
from hypothesis import strategies as st

from mbf_abstract.geometry import Pose
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import PlanRequest
from mbf_mesh_nav.kernels.compiled import Index, kernel
from mbf_mesh_nav.kernels.layers.chassis import Scratch, scratch_for
from mbf_mesh_nav.kernels.search.dijkstra import SearchGraph, propagate_distances
from mbf_mesh_nav.kernels.search.goal_bound import GoalBound, bound_at, weights_of_arrivals
from mbf_mesh_nav.kernels.search.heading_astar import DRIVABLE, FORBIDDEN, HEADING_STEP, HEADINGS
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.mesh.surface_point import surface_point_at_vertex
from mbf_mesh_nav.planners.heading_astar import HeadingAStarPlanner, may_turn_to
from mbf_mesh_nav.search.heading_limits import NO_CHASSIS
from mbf_mesh_nav.search.heading_search import HeadingSearch, PricedHeadings
from mbf_mesh_nav.search.leg_search import LegQuery


def passed_headings(heading, new):
    """Headings a robot passes on the short way from one to another, the new one included."""
    turn = (new - heading) % 16
    turn = turn if turn <= 8 else turn - 16
    return [(heading + np.sign(turn) * k) % 16 for k in range(1, abs(turn) + 1)]


@dataclass
class RandomLimits:
    """Headings and moves forbidden at random."""

    allowed: np.ndarray
    roll: np.ndarray
    known: np.ndarray
    scratch: Scratch
    chassis = NO_CHASSIS
    knows_footprint = False

    @classmethod
    def on(cls, search, vertex_count, rng):
        known = np.where(rng.random(len(search.graph.moves.ends)) < 0.9, DRIVABLE, FORBIDDEN).astype(np.uint8)
        roll = rng.uniform(-0.4, 0.4, (vertex_count, 16)).astype(np.float32)
        return cls(rng.random((vertex_count, 16)) < 0.85, roll, known, scratch_for(vertex_count))


def query_between(mesh_map, start, goal):
    ends = (surface_point_at_vertex(mesh_map, vertex) for vertex in (start, goal))
    snapshot = mesh_map.snapshot()
    return LegQuery(*ends, snapshot, snapshot.lethal, np.zeros(1, np.uint8))


def slow_search(moves, weights, limits, costs, start, target, offset, goal_heading):
    """The twin: Dijkstra over (vertex, heading) with heapq."""
    best, queue, total, allowed = {start: 0.0}, [(0.0, start)], np.inf, limits.allowed
    turning = costs.turning * HEADING_STEP
    while queue:
        cost, (vertex, heading) = heapq.heappop(queue)
        if cost > best[vertex, heading]:
            continue
        if vertex == target:
            last_turn = passed_headings(heading, goal_heading)
            if all(allowed[vertex, h] for h in last_turn):
                total = min(total, cost + offset + turning * len(last_turn))
        for slot in range(moves.offsets[vertex], moves.offsets[vertex + 1]):
            other, new = int(moves.ends[slot]), int(moves.headings[slot])
            passed = passed_headings(heading, new)
            if (
                limits.known[slot] == FORBIDDEN
                or not allowed[other, new]
                or not all(allowed[vertex, h] for h in passed)
            ):
                continue
            new_cost = cost + weights[slot] * (1 + costs.roll * abs(limits.roll[other, new])) + turning * len(passed)
            if new_cost < best.get((other, new), np.inf):
                best[other, new] = new_cost
                heapq.heappush(queue, (new_cost, (other, new)))
    return total


@given(seed=st.integers(0, 10**6))
@settings(max_examples=15, deadline=None)
def test_the_search_finds_the_cost_of_the_naive_one(seed):
    rng = np.random.default_rng(seed)
    mesh_map = MeshMap.from_heights(rng.uniform(0, 0.2, (6, 6)), 0.5, 0.5)
    search, costs, count = HeadingSearch(mesh_map), PricedHeadings(0.7, 0.2), len(mesh_map.vertices)
    limits = RandomLimits.on(search, count, rng)
    start, target, goal_heading = 0, count - 1, int(rng.integers(16))
    query = query_between(mesh_map, start, target)
    begin = np.array([start * HEADINGS + 2], np.int32), np.zeros(1, np.float32)
    end = np.array([target], np.int32), np.full(1, 0.1, np.float32), np.array([goal_heading], np.int32)
    found = search.cheapest_path(query, limits, costs, begin, end)
    moves, weights = search.graph.moves, search.graph.weights(query.snapshot, query.blocked)
    expected = slow_search(moves, weights, limits, costs, (start, 2), target, 0.1, goal_heading)
    assert (found is None) == (expected == np.inf)
    assert found is None or found[1] == pytest.approx(expected, rel=1e-5)


@given(seed=st.integers(0, 10**6), beyond=st.sampled_from([0.0, 0.3]))
@settings(max_examples=15, deadline=None)
def test_the_bound_that_guides_the_search_is_never_above_the_costs_without_turns(seed, beyond):
    rng = np.random.default_rng(seed)
    mesh_map = MeshMap.from_heights(rng.uniform(0, 0.2, (12, 12)), 0.5, 0.5)
    search, count = HeadingSearch(mesh_map), len(mesh_map.vertices)
    limits, moves, arrivals = RandomLimits.on(search, count, rng), search.graph.moves, search.graph.arrivals
    # 1. The wave as the search spreads it, to a vertex in the middle, so that half of the map lies outside.
    start, goal = 78, int(rng.integers(12))
    blocked, weights = np.zeros(count, bool), search.graph.weights(mesh_map.snapshot(), np.zeros(count, bool))
    limited = limits.allowed, limits.roll, 0.7, limits.known, FORBIDDEN
    backwards = weights_of_arrivals(arrivals, moves.headings, weights, *limited)
    distances, ends = np.full(count, np.inf, np.float32), (mesh_map.vertices, *mesh_map.vertices[[start, goal]])
    distances[goal] = 0.0
    propagate_distances(
        SearchGraph(arrivals.offsets, arrivals.origins, backwards, blocked), distances, np.full(count, -1, np.int32),
        np.array([goal], np.int32), 0.5, np.array([start], np.int32), np.full(1, beyond, np.float32),
        np.zeros(1, np.uint8), ends[:2],
    )  # fmt: skip
    found = bounds_of_all(GoalBound(distances, float(distances[start]) + beyond, *ends), count)
    # 2. The costs of driving each move, by SciPy from everywhere to the goal.
    begins = np.repeat(np.arange(count), np.diff(moves.offsets))
    driven = weights * (1 + 0.7 * np.abs(limits.roll[moves.ends, moves.headings]))
    driven[~limits.allowed[moves.ends, moves.headings] | (limits.known == FORBIDDEN)] = np.inf
    matrix = scipy.sparse.csr_matrix((driven, (moves.ends, begins)), shape=(count, count))
    true = scipy.sparse.csgraph.dijkstra(matrix, indices=goal)
    assert (found <= true).all()
    if np.isfinite(true[start]):  # from the start on it is as good as the costs themselves
        assert found[start] == pytest.approx(true[start], rel=1e-4)


@kernel
def bounds_of_all(bound, count):
    found = np.empty(count, dtype=np.float32)
    for vertex in range(count):
        found[vertex] = bound_at(bound, Index(vertex))
    return found


@pytest.fixture(scope="module")
def ridge():
    """A long ridge along x with flanks of 0.4 rad between two plains."""
    y = np.arange(61) * 0.2
    height = np.clip(np.tan(0.4) * (3.0 - np.abs(y - 6.0)), 0.0, None)
    return MeshMap.from_heights(np.tile(height[:, None], (1, 61)), 0.2, 0.2)


def roll_of(path):
    """Largest roll [rad] of the path's poses: the y axis against the horizontal."""
    return max(abs(np.arcsin(pose.rotation[2, 1])) for pose in path)


def test_a_flank_is_climbed_straight_and_not_traversed(make_plugin, ridge):
    # Along the diagonals of this mesh the shortest way leads over the flank, no other is as short.
    start, goal = Pose.planar(9.0, 1.0, 1.57, 0.0), Pose.planar(2.0, 11.0, 1.57, 0.0)
    careless = make_plugin(HeadingAStarPlanner, ridge, max_roll=1.5, max_pitch=1.5, roll_cost=0.0, turning_cost=0.0)
    careful = make_plugin(HeadingAStarPlanner, ridge, max_roll=0.2, max_pitch=0.5)
    request = PlanRequest(start, goal)
    assert roll_of(careless.make_plan(request).path) > 0.25
    result = careful.make_plan(request)
    assert result.success, result.message
    assert roll_of(result.path) < 0.21


def test_a_flank_too_steep_to_climb_is_no_path(make_plugin, ridge):
    planner = make_plugin(HeadingAStarPlanner, ridge, max_roll=0.2, max_pitch=0.3)
    result = planner.make_plan(PlanRequest(Pose.planar(2.0, 1.0, 1.57), Pose.planar(2.0, 11.0, 1.57)))
    assert result.outcome == GetPathOutcome.NO_PATH_FOUND


@pytest.mark.parametrize(
    "goal", [Pose.planar(2.0, 4.5, 0.0, z=0.6), Pose.planar(2.02, 4.0, 0.0, z=0.4)], ids=["far", "same-face"]
)
def test_a_goal_heading_that_tilts_too_far_is_refused_and_named(make_plugin, ridge, goal):
    planner = make_plugin(HeadingAStarPlanner, ridge, max_roll=0.2, max_pitch=0.5)
    result = planner.make_plan(PlanRequest(Pose.planar(2.0, 4.0, 1.57, z=0.4), goal))
    assert result.outcome == GetPathOutcome.NO_PATH_FOUND
    assert "tilt forbids the heading 0.00 rad at the goal" in result.message


def test_a_tolerance_ends_at_the_nearest_place_the_tilt_lets_the_robot_stand_at_with_its_heading(make_plugin, ridge):
    planner = make_plugin(HeadingAStarPlanner, ridge, max_roll=0.2, max_pitch=0.5)
    # Half a metre up a flank, looking along it; the plain before it ends at y = 3.
    start, goal = Pose.planar(2.0, 1.0, 1.57), Pose.planar(2.0, 3.5, 0.0, z=0.2)
    assert not planner.make_plan(PlanRequest(start, goal, dist_tolerance=0.3)).success
    result = planner.make_plan(PlanRequest(start, goal, dist_tolerance=1.5))
    assert result.success, result.message
    assert result.path[-1].position == pytest.approx((2.0, 3.0, 0.0))


@pytest.mark.parametrize("heading", [0, 5, 15])
def test_turning_to_a_heading_passes_the_same_headings_as_in_the_search(heading):
    allowed = np.random.default_rng(heading).random((200, 16)) < 0.8
    naive = [[all(row[h] for h in passed_headings(begin, heading)) for begin in range(16)] for row in allowed]
    np.testing.assert_array_equal(may_turn_to(allowed, heading), naive)


def test_a_tilt_layer_that_is_none_is_refused_when_the_planner_is_made(make_plugin, plain, paint):
    mesh_map = paint(plain(), lambda v: np.zeros(len(v)))
    for name in ("painted", "tlit"):
        with pytest.raises(ValueError, match=f"a layer of type tilt .of the map: none., got '{name}'"):
            make_plugin(HeadingAStarPlanner, mesh_map, tilt_layer=name)
    for name in ("tilt", ""):
        make_plugin(HeadingAStarPlanner, mesh_map, tilt_layer=name)


def test_turning_costs_make_paths_with_fewer_turns(make_plugin, hills):
    def turns(turning_cost):
        planner = make_plugin(HeadingAStarPlanner, hills, turning_cost=turning_cost, max_roll=1.0, max_pitch=1.0)
        steps = np.diff(
            planner.make_plan(PlanRequest(Pose.planar(0.5, 0.5), Pose.planar(5.5, 3.0))).path.positions, axis=0
        )
        yaws = np.arctan2(steps[1:-1, 1], steps[1:-1, 0])
        return np.count_nonzero(np.abs(np.diff(yaws)) > 0.1)

    assert turns(2.0) < turns(0.0)
