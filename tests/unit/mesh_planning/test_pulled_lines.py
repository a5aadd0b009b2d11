"""Where pulled paths lead between poses, in random worlds: on the map, and where the robot touches nothing new."""

import itertools

import numpy as np
import pytest

from mbf_abstract.geometry import Path, Pose
from mbf_abstract.maps.queries import AS_CONFIGURED, CellState
from mbf_abstract.outcomes import RefinePathOutcome
from mbf_abstract.plugins import PlanRequest
from mbf_abstract.time.cancel import CancelToken
from mbf_mesh_nav.kernels.mesh.touching_discs import touching_discs
from mbf_mesh_nav.layers.inflation import InflationLayer
from mbf_mesh_nav.map.layer import LayerContext
from mbf_mesh_nav.map.layer_graph import LayerGraph
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.map.places import ON_EDGE
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh
from mbf_mesh_nav.planners.astar import AStarPlanner
from mbf_mesh_nav.planners.dijkstra import DijkstraPlanner
from mbf_mesh_nav.refiners.string_pulling import StringPullingRefiner

STEP = 0.02
"""m between the places that are looked at."""
HARD = (17,)
"""A world in which a pulled path once touched what its plan did not."""


def without_discs(vertices, faces, discs):
    """Faces whose middles are in none of these discs."""
    for centre, radius in discs:
        middles = np.asarray(vertices)[faces].mean(axis=1)[:, :2]
        faces = faces[np.hypot(*(middles - centre).T) > radius]
    return faces


@pytest.fixture(scope="session")
def world(paint):
    """``world(rng)``: hills of 8 m with holes, lethal discs, inflation and a round robot."""

    def make(rng):
        spacing = float(rng.choice([0.1, 0.15, 0.25]))
        x, y = np.meshgrid(*2 * [np.arange(int(8 / spacing)) * spacing])
        a, b, c, d = rng.uniform(0.3, 1.5, 4)
        vertices, faces = heightfield_mesh(
            rng.uniform(0, 0.4) * np.sin(a * x + b) * np.cos(c * y + d), spacing, spacing
        )
        holes = [(rng.uniform(1, 7, 2), rng.uniform(0.2, 1.0)) for _ in range(rng.integers(0, 4))]
        mesh_map = MeshMap.from_arrays(vertices, without_discs(vertices, faces, holes))
        discs = [(rng.uniform(1, 7, 2), rng.uniform(0.05, 0.7)) for _ in range(rng.integers(2, 8))]

        def lethal(at):
            return np.where(np.any([np.hypot(*(at[:, :2] - c).T) < r for c, r in discs], axis=0), np.inf, 0.0)

        return with_inflation(
            paint(mesh_map, lethal), float(rng.uniform(0.15, 0.35)), float(rng.choice([0.0, 1.0, 5.0]))
        )

    return make


def with_inflation(mesh_map, radius, edge_cost_factor):
    """The map for a robot of ``radius`` [m]."""
    (painted,) = mesh_map.layers.values()
    parameters = InflationLayer.Parameters(inscribed_radius=radius, inflation_radius=radius + 0.4)
    inflation = InflationLayer(LayerContext("costs", mesh_map.topology, mesh_map.locator, parameters, (painted,)))
    inflation.recompute()
    mesh_map.set_layers(LayerGraph([painted, inflation]), "costs", edge_cost_factor)
    mesh_map.inscribed_radius = radius
    return mesh_map


def densely(positions):
    """Poses on the lines between positions (n, 3), at most ``STEP`` apart."""
    places = [positions[-1:]]
    for a, b in itertools.pairwise(positions):
        count = max(1, int(np.ceil(np.sqrt(((b - a) ** 2).sum()) / STEP)))
        places.append(a + np.arange(count)[:, None] / count * (b - a))
    return [Pose(tuple(place)) for place in np.concatenate(places).tolist()]


@pytest.mark.parametrize("seeds", [HARD, range(1000, 1012)], ids=["found", "random"])
def test_between_its_poses_a_pulled_path_is_on_the_map_and_touches_nothing_new(make_plugin, world, seeds):
    count = 0
    for seed in seeds:
        rng = np.random.default_rng(seed)
        mesh_map = world(rng)
        for planner_class in (AStarPlanner, DijkstraPlanner, AStarPlanner):
            ends = mesh_map.locate(np.column_stack([rng.uniform(0.4, 7.4, (2, 2)), np.zeros(2)])).points
            request = PlanRequest(*(Pose(tuple(place)) for place in ends.tolist()))
            plan = make_plugin(planner_class, mesh_map).make_plan(request)
            if not plan.success or len(plan.path) < 4:
                continue
            count += 1
            result = make_plugin(StringPullingRefiner, mesh_map).apply_refinement(plan.path, CancelToken())
            assert result.outcome == RefinePathOutcome.SUCCESS
            assert mesh_map.first_line_outside(result.path.positions) == -1
            check = mesh_map.pose_check(AS_CONFIGURED)
            before, after = (
                max(check(pose).state for pose in densely(path.positions)) for path in (plan.path, result.path)
            )
            assert after <= max(before, CellState.INSCRIBED)
    assert count >= len(seeds)


@pytest.fixture(scope="module")
def plain_with_a_hole():
    """8 m of level ground with a hole of 2 m in its middle."""
    vertices, faces = heightfield_mesh(np.zeros((81, 81)), 0.1, 0.1)
    middles = np.asarray(vertices)[faces].mean(axis=1)[:, :2]
    return MeshMap.from_arrays(vertices, faces[np.abs(middles - 4.0).max(axis=1) > 1.0])


@pytest.mark.parametrize("y", [4.0, 4.3])
def test_a_path_over_a_hole_is_no_path(make_plugin, plain_with_a_hole, y):
    across = Path.from_points([(1.0, y, 0.0), (7.0, y, 0.0)])
    result = make_plugin(StringPullingRefiner, plain_with_a_hole).apply_refinement(across, CancelToken())
    assert result.outcome == RefinePathOutcome.MAP_ERROR and result.path is across
    assert f"the path leaves the surface after (3.00, {y:.2f}, 0.00)" in result.message


def test_lines_over_a_hole_leave_the_map_and_those_beside_it_do_not(plain_with_a_hole):
    rng, crossing, apart = np.random.default_rng(4), 0, 0
    for _ in range(200):
        points = np.column_stack([rng.uniform(0.1, 7.9, (6, 2)), np.zeros(6)])
        points = points[np.abs(points[:, :2] - 4.0).max(axis=1) > 1.0]
        over = [  # the slow twin: many places of each line, deep enough in the hole
            (np.abs((a + np.linspace(0, 1, 500)[:, None] * (b - a))[:, :2] - 4.0).max(axis=1) < 0.9).any()
            for a, b in itertools.pairwise(points)
        ]
        beside = [
            (np.abs((a + np.linspace(0, 1, 500)[:, None] * (b - a))[:, :2] - 4.0).max(axis=1) > 1.0).all()
            for a, b in itertools.pairwise(points)
        ]
        first = plain_with_a_hole.first_line_outside(points)
        assert not any(over) or 0 <= first <= over.index(True)
        assert not all(beside) or first == -1
        crossing, apart = crossing + any(over), apart + all(beside)
    assert min(crossing, apart) > 20


def test_discs_touch_what_a_pose_there_touches(world):
    for seed in range(5):
        rng = np.random.default_rng(seed)
        mesh_map = world(rng)
        spots = mesh_map.locate(np.column_stack([rng.uniform(0.0, 7.5, (300, 2)), np.zeros(300)]))
        mesh, snapshot = mesh_map.topology, mesh_map.snapshot()
        lethal = snapshot.lethal | ~np.isfinite(snapshot.costs)
        graph = mesh.neighbour_offsets, mesh.neighbours
        discs = spots.points, spots.faces, mesh_map.inscribed_radius, ON_EDGE
        touching = touching_discs(mesh.vertices, mesh.faces, *graph, lethal, *discs)
        check = mesh_map.pose_check(AS_CONFIGURED)
        assert touching.tolist() == [check(Pose(tuple(p))).state is CellState.LETHAL for p in spots.points.tolist()]
        assert 0.0 < touching.mean() < 1.0
