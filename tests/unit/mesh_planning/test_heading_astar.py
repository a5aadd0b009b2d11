"""Planning with headings: against a naive twin, and on a hill that may be climbed but not traversed."""

import heapq

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mbf_abstract.geometry import Pose
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import PlanRequest
from mbf_mesh_nav.kernels.layers.footprint_sweep import scratch_for
from mbf_mesh_nav.kernels.search.heading_astar import DRIVABLE, HEADING_STEP, HEADINGS, search_with_heading
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.planners.heading_astar import HeadingAStarPlanner, may_turn_to
from mbf_mesh_nav.search.drive_graph import DriveGraph
from mbf_mesh_nav.search.heading_limits import NO_CHASSIS


def passed_headings(heading, new):
    """Headings a robot passes on the short way from one to another, the new one included."""
    turn = (new - heading) % 16
    turn = turn if turn <= 8 else turn - 16
    return [(heading + np.sign(turn) * k) % 16 for k in range(1, abs(turn) + 1)]


def slow_search(moves, weights, allowed, roll, roll_cost, turning_cost, start, target, offset, goal_heading):
    """The twin: Dijkstra over (vertex, heading) with heapq."""
    best, queue, total = {start: 0.0}, [(0.0, start)], np.inf
    while queue:
        cost, (vertex, heading) = heapq.heappop(queue)
        if cost > best[vertex, heading]:
            continue
        if vertex == target:
            last_turn = passed_headings(heading, goal_heading)
            if all(allowed[vertex, h] for h in last_turn):
                total = min(total, cost + offset + turning_cost * HEADING_STEP * len(last_turn))
        for slot in range(moves.offsets[vertex], moves.offsets[vertex + 1]):
            other, new = int(moves.ends[slot]), int(moves.headings[slot])
            passed = passed_headings(heading, new)
            if not allowed[other, new] or not all(allowed[vertex, h] for h in passed):
                continue
            drive = weights[slot] * (1 + roll_cost * abs(roll[other, new]))
            new_cost = cost + drive + turning_cost * HEADING_STEP * len(passed)
            if new_cost < best.get((other, new), np.inf):
                best[other, new] = new_cost
                heapq.heappush(queue, (new_cost, (other, new)))
    return total


@given(seed=st.integers(0, 10**6))
@settings(max_examples=15, deadline=None)
def test_the_search_finds_the_cost_of_the_naive_one(seed):
    rng = np.random.default_rng(seed)
    mesh_map = MeshMap.from_heights(rng.uniform(0, 0.2, (6, 6)), 0.5, 0.5)
    count = len(mesh_map.vertices)
    allowed, roll = rng.random((count, 16)) < 0.85, rng.uniform(-0.4, 0.4, (count, 16)).astype(np.float32)
    graph, blocked = DriveGraph(mesh_map.topology), np.zeros(count, bool)
    moves, weights = graph.moves, graph.weights(mesh_map.snapshot(), blocked)
    start, target, goal_heading = 0, count - 1, int(rng.integers(16))
    distances, predecessors = np.full(16 * count, np.inf, np.float32), np.full(16 * count, -1, np.int32)
    distances[start * HEADINGS + 2] = 0.0
    state, total = search_with_heading(
        mesh_map.topology.surface, moves, weights, blocked, allowed, roll, 0.7, 0.2, distances, predecessors,
        np.array([start * HEADINGS + 2], np.int32), np.array([target], np.int32), np.full(1, 0.1, np.float32),
        np.array([goal_heading], np.int32), mesh_map.vertices[target],
        np.full(len(weights), DRIVABLE, np.uint8), NO_CHASSIS, scratch_for(count),
        np.zeros(1, np.uint8),
    )  # fmt: skip
    expected = slow_search(moves, weights, allowed, roll, 0.7, 0.2, (start, 2), target, 0.1, goal_heading)
    assert total == pytest.approx(expected, rel=1e-5)
    assert (state < 0) == (expected == np.inf)


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
