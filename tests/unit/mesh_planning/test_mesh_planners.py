"""What every planner on meshes promises: outcomes, exact ends, tolerance, via points, cancel."""

import networkx
import numpy as np
import pytest

from mbf_abstract.geometry import Pose
from mbf_abstract.maps.queries import PlaceQuery
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import PlanRequest
from mbf_abstract.time.cancel import CancelToken
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.planners.any_angle import AnyAnglePlanner
from mbf_mesh_nav.planners.astar import AStarPlanner
from mbf_mesh_nav.planners.cvp import CVPPlanner
from mbf_mesh_nav.planners.dijkstra import DijkstraPlanner
from mbf_mesh_nav.planners.heading_astar import HeadingAStarPlanner
from mbf_mesh_nav.planners.repairing import RepairingPlanner

PLANNERS = [DijkstraPlanner, AStarPlanner, CVPPlanner, RepairingPlanner, AnyAnglePlanner, HeadingAStarPlanner]


@pytest.fixture(params=PLANNERS, ids=lambda planner: planner.__name__)
def planner_class(request):
    return request.param


def wall(vertices, x_from=2.9, x_to=3.1, open_above=np.inf):
    inside = (vertices[:, 0] > x_from) & (vertices[:, 0] < x_to) & (vertices[:, 1] < open_above)
    return np.where(inside, np.inf, 0.0)


def test_the_path_starts_on_the_surface_and_ends_with_the_goal_pose(planner_class, make_plugin, hills):
    goal = Pose.planar(5.03, 4.11, 2.0, 0.1)
    result = make_plugin(planner_class, hills).make_plan(PlanRequest(Pose.planar(0.57, 0.33, 0.0, 0.3), goal))
    assert result.outcome == GetPathOutcome.SUCCESS, result.message
    first = result.path.positions[0]
    assert hills.locate([first]).distances[0] < 1e-6
    assert np.linalg.norm(first - [0.57, 0.33, 0.3]) < 0.3
    assert result.path.positions[-1].tolist() == list(goal.position)
    assert result.path[-1].angle_to(goal) < 1e-6
    straight = np.linalg.norm(result.path.positions[-1] - first)
    assert straight <= result.path.length <= 1.5 * straight


@pytest.mark.parametrize("graph_planner", [DijkstraPlanner, AStarPlanner, RepairingPlanner])
def test_a_plan_between_vertices_costs_what_networkx_finds(graph_planner, make_plugin, paint):
    rng = np.random.default_rng(3)
    mesh_map = MeshMap.from_heights(rng.uniform(0.0, 0.1, (9, 9)), 0.3, 0.3)
    paint(mesh_map, lambda v: np.where(rng.random(len(v)) < 0.1, np.inf, rng.random(len(v))), edge_cost_factor=2.0)
    graph = mesh_map.vertex_graph()
    planner = make_plugin(graph_planner, mesh_map)
    ends = [name for name in graph if graph.degree(name) and np.isfinite(graph.nodes[name]["cost"])]
    for _ in range(20):
        start, goal = (int(name) for name in rng.choice(ends, 2, replace=False))
        poses = (Pose(tuple(graph.nodes[name]["position"])) for name in (start, goal))
        result = planner.make_plan(PlanRequest(*poses))
        assert result.success == networkx.has_path(graph, start, goal)
        if result.success:
            assert result.cost == pytest.approx(networkx.dijkstra_path_length(graph, start, goal), rel=1e-5)


def test_a_plan_costs_what_the_map_of_its_start_says_though_that_changes_meanwhile(make_plugin, paint):
    mesh_map = paint(MeshMap.from_heights(np.zeros((11, 11)), 0.5, 0.5), lambda v: np.full(len(v), 0.5), 1.0)
    planner = make_plugin(DijkstraPlanner, mesh_map)
    request = PlanRequest(Pose.planar(0.2, 0.2), Pose.planar(4.7, 4.6))
    expected = planner.make_plan(request).cost
    find_leg = planner.find_leg

    def find_late(query):
        mesh_map.set_edge_cost_factor(50.0)
        return find_leg(query)

    planner.find_leg = find_late
    assert planner.make_plan(request).cost == pytest.approx(expected)


def test_start_and_goal_in_one_face_give_two_poses(planner_class, make_plugin, plain):
    request = PlanRequest(Pose.planar(1.02, 1.02), Pose.planar(1.05, 1.03, 1.0))
    result = make_plugin(planner_class, plain()).make_plan(request)
    assert len(result.path) == 2
    assert result.path[-1].yaw == pytest.approx(1.0)


def test_a_start_off_the_surface_is_out_of_map_and_names_the_distance(planner_class, make_plugin, plain):
    request = PlanRequest(Pose.planar(1.0, 1.0, z=2.5), Pose.planar(4.0, 4.0))
    result = make_plugin(planner_class, plain()).make_plan(request)
    assert result.outcome == GetPathOutcome.OUT_OF_MAP
    assert "start" in result.message and "2.50 m" in result.message


def test_a_goal_in_a_lethal_spot_is_blocked_goal_and_names_the_layer(planner_class, make_plugin, plain, paint):
    mesh_map = paint(plain(), wall)
    planner = make_plugin(planner_class, mesh_map)
    result = planner.make_plan(PlanRequest(Pose.planar(1.0, 1.0), Pose.planar(3.0, 3.0)))
    assert result.outcome == GetPathOutcome.BLOCKED_GOAL
    assert "is blocked: lethal in layer painted; lethal ground of painted separates them" in result.message
    result = planner.make_plan(PlanRequest(Pose.planar(3.0, 1.0), Pose.planar(1.0, 3.0)))
    assert result.outcome == GetPathOutcome.BLOCKED_START


def test_a_goal_above_the_cost_limit_is_blocked(planner_class, make_plugin, plain, paint):
    mesh_map = paint(plain(), lambda v: np.where(v[:, 0] > 4.0, 0.8, 0.1))
    request = PlanRequest(Pose.planar(1.0, 1.0), Pose.planar(5.0, 3.0))
    assert make_plugin(planner_class, mesh_map).make_plan(request).success
    result = make_plugin(planner_class, mesh_map, cost_limit=0.8).make_plan(request)
    assert result.outcome == GetPathOutcome.BLOCKED_GOAL


def test_a_wall_across_the_map_is_no_path_found(planner_class, make_plugin, plain, paint):
    planner = make_plugin(planner_class, paint(plain(), wall))
    result = planner.make_plan(PlanRequest(Pose.planar(1.0, 1.0), Pose.planar(5.0, 3.0)))
    assert result.outcome == GetPathOutcome.NO_PATH_FOUND


def test_a_lethal_wall_that_costs_nothing_is_not_crossed_either(planner_class, make_plugin, plain, paint):
    mesh_map = paint(plain(), lambda v: np.zeros(len(v)))
    lethal = np.isinf(wall(mesh_map.vertices))
    mesh_map.apply(lambda layer: layer.replace(layer.costs.copy(), lethal))
    planner = make_plugin(planner_class, mesh_map)
    result = planner.make_plan(PlanRequest(Pose.planar(1.0, 1.0), Pose.planar(5.0, 3.0)))
    assert result.outcome == GetPathOutcome.NO_PATH_FOUND
    assert planner.make_plan(PlanRequest(Pose.planar(3.0, 1.0), Pose.planar(5.0, 3.0))).outcome == (
        GetPathOutcome.BLOCKED_START
    )


def test_a_gap_in_the_wall_is_used_and_the_wall_is_not_touched(planner_class, make_plugin, plain, paint):
    mesh_map = paint(plain(), lambda v: wall(v, open_above=5.0))
    result = make_plugin(planner_class, mesh_map).make_plan(PlanRequest(Pose.planar(1.0, 1.0), Pose.planar(5.0, 1.0)))
    assert result.success, result.message
    crossing = np.abs(result.path.positions[:, 0] - 3.0) < 0.15
    assert crossing.any() and (result.path.positions[crossing, 1] > 4.8).all()


def test_goals_on_another_component_are_refused_at_once_with_both_sizes(planner_class, make_plugin):
    patch = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    vertices = np.concatenate([patch, np.add(patch, [5, 0, 0]), [[6, 1, 0]]])
    mesh_map = MeshMap.from_arrays(vertices, [[0, 1, 2], [3, 4, 5], [4, 6, 5]])
    request = PlanRequest(Pose.planar(0.2, 0.2), Pose.planar(5.2, 0.2))
    result = make_plugin(planner_class, mesh_map).make_plan(request)
    assert result.outcome == GetPathOutcome.NO_PATH_FOUND
    assert "component" in result.message and "3 vertices" in result.message and "4 vertices" in result.message


@pytest.mark.parametrize("goal", [Pose.planar(3.0, 3.0, 0.7), Pose.planar(6.3, 3.0, 0.7), Pose.planar(5.0, 3.0, 0.7)])
def test_a_tolerance_ends_at_the_nearest_free_reachable_vertex(planner_class, make_plugin, plain, paint, goal):
    # blocked goal in the wall; goal off the map; goal behind the closed wall
    mesh_map = paint(plain(), wall)
    request = PlanRequest(Pose.planar(1.0, 1.0), goal, dist_tolerance=3.8)
    result = make_plugin(planner_class, mesh_map, max_surface_distance=0.1).make_plan(request)
    assert result.success, result.message
    free = mesh_map.vertices[mesh_map.vertices[:, 0] < 2.9]
    nearest = np.linalg.norm(free - goal.position, axis=1).min()
    assert result.path[-1].distance_to(goal) == pytest.approx(nearest)
    assert result.path[-1].yaw == pytest.approx(0.7)


def test_a_tolerance_too_small_keeps_the_reason(planner_class, make_plugin, plain, paint):
    request = PlanRequest(Pose.planar(1.0, 1.0), Pose.planar(5.0, 3.0), dist_tolerance=0.5)
    result = make_plugin(planner_class, paint(plain(), wall)).make_plan(request)
    assert result.outcome == GetPathOutcome.NO_PATH_FOUND


def test_via_points_are_passed_in_order(planner_class, make_plugin, hills):
    via = (Pose.planar(5.0, 0.52), Pose.planar(0.48, 5.0))
    request = PlanRequest(Pose.planar(0.5, 0.5), Pose.planar(5.0, 5.0), via=via)
    path = make_plugin(planner_class, hills).make_plan(request).path
    visits = [int(np.argmin(np.linalg.norm(path.positions[:, :2] - pose.position[:2], axis=1))) for pose in via]
    assert visits == sorted(visits)
    for index, pose in zip(visits, via, strict=True):
        assert np.linalg.norm(path.positions[index, :2] - pose.position[:2]) < 0.05


def test_a_token_set_before_planning_gives_canceled(planner_class, make_plugin, hills):
    token = CancelToken()
    token.cancel("changed my mind")
    request = PlanRequest(Pose.planar(0.5, 0.5), Pose.planar(5.0, 5.0), cancel_token=token)
    result = make_plugin(planner_class, hills).make_plan(request)
    assert (result.outcome, result.message) == (GetPathOutcome.CANCELED, "changed my mind")


def test_costs_move_the_path_aside(planner_class, make_plugin, plain, paint):
    def hill_of_cost(v):
        return 0.9 * np.exp(-((v[:, 0] - 3) ** 2 + (v[:, 1] - 3) ** 2))

    request = PlanRequest(Pose.planar(1.0, 3.0), Pose.planar(5.0, 3.0))
    mesh_map = plain()
    direct = make_plugin(planner_class, paint(mesh_map, hill_of_cost)).make_plan(request)
    aside = make_plugin(planner_class, paint(mesh_map, hill_of_cost, edge_cost_factor=5.0)).make_plan(request)
    assert np.abs(direct.path.positions[:, 1] - 3).max() < 0.3
    assert np.abs(aside.path.positions[:, 1] - 3).max() > 0.5
    assert aside.cost > direct.cost


@pytest.mark.parametrize("edge_cost_factor", [0.0, 2.0])
def test_the_cost_of_a_plan_is_its_length_and_what_the_map_collects_along_it(
    planner_class, make_plugin, plain, paint, edge_cost_factor
):
    mesh_map = paint(plain(), lambda v: 0.1 * v[:, 0], edge_cost_factor)
    planner = make_plugin(
        planner_class, mesh_map, **({"turning_cost": 0.0} if "Heading" in planner_class.__name__ else {})
    )
    for start, goal in [
        ((1.0, 1.0), (1.0, 1.0)),
        ((1.02, 1.02), (1.05, 1.03)),
        ((1.1, 1.1), (1.2, 1.2)),
        ((1, 1), (5, 4)),
    ]:
        result = planner.make_plan(PlanRequest(Pose.planar(*start), Pose.planar(*goal)))
        points = np.linspace(result.path.positions[:-1], result.path.positions[1:], 101)
        means = 1.0 + edge_cost_factor * 0.1 * points[:, :, 0].mean(axis=0)
        lengths = np.linalg.norm(np.diff(result.path.positions, axis=0), axis=1)
        straight_ends = 0.3 * edge_cost_factor * 0.4  # planners on edges count the steps within the end faces bare
        assert result.cost == pytest.approx(lengths @ means, abs=straight_ends + 1e-5)


def test_the_tolerance_finds_what_the_planner_itself_can_reach(planner_class, make_plugin, plain, paint):
    # A lethal disc around the goal with a spit of single free vertices into it: no way over whole faces.
    def costs(vertices):
        in_disc = np.hypot(vertices[:, 0] - 4.0, vertices[:, 1] - 3.0) < 1.1
        spit = (np.abs(vertices[:, 1] - 3.0) < 0.05) & (vertices[:, 0] < 3.9)
        return np.where(in_disc & ~spit, np.inf, 0.0)

    planner = make_plugin(planner_class, paint(plain(), costs))
    request = PlanRequest(Pose.planar(1.0, 3.0), Pose.planar(4.0, 3.0), dist_tolerance=1.5)
    result = planner.make_plan(request)
    assert result.success, result.message
    assert np.linalg.norm(result.path.positions[-1] - [4.0, 3.0, 0.0]) <= 1.5


def test_a_place_for_the_robot_is_looked_for_on_its_own_storey_only(plain, paint):
    floor = plain(3.0, 3.0)
    storeys = [floor.vertices, floor.vertices + np.array([0.0, 0.0, 1.2])]
    mesh_map = MeshMap.from_arrays(np.vstack(storeys), np.vstack([floor.faces, floor.faces + len(floor.vertices)]))
    paint(mesh_map, lambda v: np.where(v[:, 2] > 1.0, np.inf, 0.0))
    below, above = (mesh_map.find_valid_pose(Pose.planar(1.5, 1.5, z=z), 2.0, 0.0, PlaceQuery()) for z in (0.0, 1.2))
    assert below.pose is not None and above.pose is None
