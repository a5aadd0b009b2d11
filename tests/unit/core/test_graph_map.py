"""A map that is a graph: distances, motion and plans as plain loops would find them."""

import itertools
import math

import networkx
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.maps.graph.graph_map import GraphMap, GraphMapParameters, grid_edges
from mbf_abstract.maps.graph.graph_planner import GraphPlanner
from mbf_abstract.maps.map_plugin import MapContext
from mbf_abstract.maps.queries import CellState
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import PlanRequest
from mbf_abstract.testing.contract.rig import rig

SHAPE, SPACING = (12, 16), 0.25  # rows and columns, m
LETHAL = st.sets(st.integers(0, SHAPE[0] * SHAPE[1] - 1), max_size=25)
PLACES = st.tuples(st.floats(0.0, 3.7), st.floats(0.0, 2.7))


class Grid(GraphMap):
    def __init__(self, lethal=(), **parameters):
        rows, columns = (index.ravel() for index in np.indices(SHAPE))
        nodes = np.column_stack([columns * SPACING, rows * SPACING, np.zeros(len(rows))])
        mask = np.isin(np.arange(len(nodes)), list(lethal))
        super().__init__(nodes, grid_edges(SHAPE), mask, GraphMapParameters(**parameters), "map")

    def nodes_at(self, points):
        columns, rows = np.round(points[:, :2].T / SPACING).astype(int)
        inside = (columns >= 0) & (columns < SHAPE[1]) & (rows >= 0) & (rows < SHAPE[0])
        return np.where(inside, rows * SHAPE[1] + columns, -1)


def plan(grid, start, goal, **request):
    with rig(GraphPlanner, lambda base: MapContext(**vars(base), navigation_map=grid), None, start) as made:
        return made.plugin.make_plan(PlanRequest(start, goal, **request))


def test_a_map_knows_the_sources_of_its_layers():
    grid = Grid(obstacles={"sources": ("right", "left")})

    assert grid.source_names == ("left", "right")
    assert grid.listens_to("left") and not grid.listens_to("up")


@given(LETHAL, PLACES)
def test_clearances_and_the_nearest_obstacle_are_those_of_a_loop_over_all_pairs(lethal, place):
    grid = Grid(lethal)
    gaps = [min((math.dist(a, grid.nodes[b]) for b in lethal), default=math.inf) for a in grid.nodes]
    here = min((math.dist((*place, 0.0), grid.nodes[b]) for b in lethal), default=math.inf)
    offset = grid.nearest_obstacle(Pose.planar(*place), 1.0)

    assert grid.state.clearance == pytest.approx(gaps)
    assert (offset is None) == (here > 1.0)
    assert offset is None or math.hypot(*offset) == pytest.approx(here)


@given(LETHAL, PLACES, st.floats(-3.1, 3.1), st.floats(-0.5, 0.5), st.floats(-1.0, 1.0))
@example({4 * SHAPE[1] + 6}, (1.0, 1.0), 0.0, 0.5, 0.0)  # straight at it
def test_a_motion_is_free_if_no_small_step_of_it_comes_too_near(lethal, place, yaw, vx, wz):
    grid = Grid(lethal)
    x, y = place
    track, heading = [], yaw
    for _ in range(1000):
        track.append(grid.node_at(x, y))
        x, y, heading = x + 0.001 * vx * math.cos(heading), y + 0.001 * vx * math.sin(heading), heading + 0.001 * wz
    clearance = [0.0 if node < 0 else grid.state.clearance[node] for node in track]
    nearer = any(b < min(a, grid.robot_radius) for a, b in itertools.pairwise(clearance))
    said = grid.obstacle_ahead(Pose.planar(*place, yaw), Twist.planar(vx, wz=wz), 1.0)

    assert nearer or not said
    # between two of its looks, which are 5 cm apart, it may cut the corner of a node's cell
    blocked = [i for i, (a, b) in enumerate(itertools.pairwise(clearance)) if b < min(a, grid.robot_radius)]
    assert said or len(blocked) < 100


@given(LETHAL)
def test_a_plan_costs_what_networkx_finds(lethal):
    grid = Grid(lethal, robot_radius=0.2, inflation={"inflation_radius": 0.6})
    start, goal = Pose.planar(0.5, 0.5), Pose.planar(3.25, 2.25)
    ends = grid.node_at(start.x, start.y), grid.node_at(goal.x, goal.y)
    free, costs = grid.free_nodes(), grid.state.costs
    graph = networkx.Graph()
    graph.add_nodes_from(np.flatnonzero(free).tolist())
    for a, b in grid.edges.tolist():
        if free[a] and free[b]:
            graph.add_edge(a, b, weight=math.dist(grid.nodes[a], grid.nodes[b]) * (1.0 + 0.5 * (costs[a] + costs[b])))
    found = plan(grid, start, goal)

    if not free[ends[0]] or not free[ends[1]]:
        assert found.outcome in (GetPathOutcome.BLOCKED_START, GetPathOutcome.BLOCKED_GOAL)
    elif not networkx.has_path(graph, *ends):
        assert found.outcome == GetPathOutcome.NO_PATH_FOUND
    else:
        assert found.cost == pytest.approx(networkx.shortest_path_length(graph, *ends, weight="weight"))


def test_a_blocked_goal_is_approached_within_the_tolerance_by_its_nearest_free_node():
    grid = Grid({6 * SHAPE[1] + 8}, robot_radius=0.3)
    start, goal = Pose.planar(0.25, 0.25), Pose.planar(2.0, 1.5)

    assert plan(grid, start, goal).outcome == GetPathOutcome.BLOCKED_GOAL
    found = plan(grid, start, goal, dist_tolerance=0.4)
    assert found.path[-1].distance_to(goal) == pytest.approx(math.hypot(0.25, 0.25))


def test_a_robot_that_touches_something_may_drive_away_from_it_but_not_on():
    grid = Grid({6 * SHAPE[1] + 8}, robot_radius=0.4)
    touching = Pose.planar(1.75, 1.5)

    assert grid.obstacle_ahead(touching, Twist.planar(0.5), 1.0)
    assert not grid.obstacle_ahead(touching, Twist.planar(-0.5), 1.0)
    assert not grid.obstacle_ahead(touching, Twist.planar(wz=1.0), 1.0)


def test_the_end_of_the_ground_is_an_obstacle():
    assert Grid().obstacle_ahead(Pose.planar(3.5, 1.0), Twist.planar(0.5), 1.5)
    assert Grid().place(4.5, 1.0).state is CellState.OUTSIDE


def test_an_override_of_the_inflation_ends_with_the_first_update_after_its_time():
    grid = Grid({6 * SHAPE[1] + 8}, inflation={"inflation_radius": 1.0})
    wide = grid.state.costs.copy()
    grid.set_layer_parameters("inflation", grid.inflation.parameters.model_copy(update={"inflation_radius": 0.3}), 5.0)

    grid.update(None, 4.9)
    assert (grid.state.costs > 0.0).sum() < (wide > 0.0).sum()
    grid.update(None, 5.0)
    assert np.array_equal(grid.state.costs, wide)
