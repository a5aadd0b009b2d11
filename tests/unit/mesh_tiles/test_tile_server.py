"""A folder of tiles behind the server: plans, questions and messages are those of the whole mesh."""

import shutil

import numpy as np
import pytest
from test_tile_planning import ROUNDING, build_storeys
from tiled_terrains import SPACING, WholeMap, settings, terrain

from mbf_abstract.config.findings import ConfigError
from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.goals.goal_types import GetPathGoal
from mbf_abstract.maps.map_plugin import MapContext
from mbf_abstract.maps.map_queries import check_path
from mbf_abstract.maps.queries import CellState, PlaceQuery
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import PlanRequest
from mbf_abstract.server.factory import read_config
from mbf_abstract.server.plugin_host import ServerError
from mbf_abstract.testing.contract import check_planner
from mbf_abstract.testing.contract.rig import rig
from mbf_abstract.testing.loopback import LoopbackSession
from mbf_mesh_nav.map.ground import ground_heights
from mbf_mesh_nav.mesh.mesh_report import MeshError
from mbf_mesh_nav.planners.astar import AStarPlanner
from mbf_mesh_nav.planners.hierarchical import HierarchicalPlanner
from mbf_mesh_nav.plugins import MeshContext
from mbf_mesh_nav.tiles.building.build import build_tiles
from mbf_mesh_nav.tiles.building.sources import HeightSource
from mbf_mesh_nav.tiles.serving import surroundings
from mbf_mesh_nav.tiles.serving.navigation_map import TiledNavigationMap
from mbf_mesh_nav.tiles.serving.squares import KEPT_VERTICES
from mbf_mesh_nav.tiles.stored_tiles import sound_tile
from mbf_mesh_nav.tiles.tile import read_tile, tile_file
from mbf_mesh_nav.tiles.tiled_map import TiledMap


@pytest.fixture
def tiled(tiled_hills):
    return TiledNavigationMap(TiledMap(tiled_hills))


def planned(planner_class, navigation_map, *requests):
    """Results of one planner on a map."""
    context = MapContext if isinstance(navigation_map, TiledNavigationMap) else MeshContext
    make = lambda base: context(**vars(base), navigation_map=navigation_map)  # noqa: E731
    with rig(planner_class, make, None, Pose.planar(0.0, 0.0)) as made:
        return [made.plugin.make_plan(request) for request in requests]


def on_both(tiled, whole, *requests):
    """Results on the tiles, each beside that on the whole mesh."""
    answers = planned(HierarchicalPlanner, tiled, *requests), planned(AStarPlanner, whole.map, *requests)
    return zip(*answers, strict=True)


def pose(position, yaw=0.4):
    x, y, z = np.asarray(position, dtype=float).tolist()
    return Pose.planar(x, y, yaw, z)


def places_anywhere(whole, count, seed):
    """Positions on the mesh, free or not."""
    rng = np.random.default_rng(seed)
    return whole.map.vertices[rng.integers(0, len(whole.map.vertices), count)] + 0.1


def test_paths_outcomes_and_costs_are_those_of_the_whole_mesh(tiled, whole_hills):
    ends = [*whole_hills.free_places(16, 11), *places_anywhere(whole_hills, 8, 12)]
    requests = [PlanRequest(pose(ends[i]), pose(ends[-1 - i], 1.0)) for i in range(len(ends) // 2)]
    requests += [PlanRequest(pose(ends[i]), pose(ends[i + 1])) for i in range(6)]
    found = 0
    for ours, exact in on_both(tiled, whole_hills, *requests):
        assert ours.outcome == exact.outcome, (ours.message, exact.message)
        if exact.path is not None:
            found += 1
            assert exact.cost * (1.0 - ROUNDING) <= ours.cost <= 1.03 * exact.cost
            for end in (0, -1):
                assert ours.path[end].distance_to(exact.path[end]) < 1e-9
            assert ours.path[-1].yaw == pytest.approx(exact.path[-1].yaw)
            assert ours.path.frame_id == exact.path.frame_id
            lengths = [np.linalg.norm(np.diff(one.path.positions, axis=0), axis=1).sum() for one in (ours, exact)]
            assert lengths[0] == pytest.approx(lengths[1], rel=0.1)
        elif exact.outcome in (GetPathOutcome.BLOCKED_START, GetPathOutcome.BLOCKED_GOAL):
            assert ours.message == exact.message
    assert found > 4


def test_via_points_are_passed_in_their_order(tiled, whole_hills):
    stops = [pose(place) for place in whole_hills.free_places(4, 21)]
    request = PlanRequest(stops[0], stops[-1], via=tuple(stops[1:-1]))
    for ours, exact in on_both(tiled, whole_hills, request):
        assert ours.outcome == exact.outcome == GetPathOutcome.SUCCESS
        assert ours.cost == pytest.approx(exact.cost, rel=0.03)
        passed = [min(range(len(ours.path)), key=lambda i, s=s: ours.path[i].distance_to(s)) for s in stops]
        assert passed == sorted(passed)
        assert all(ours.path[i].distance_to(s) < 0.01 for i, s in zip(passed, stops, strict=True))


@pytest.mark.parametrize("tolerance", [0.3, 50.0])
def test_with_a_tolerance_a_path_ends_at_the_same_vertex_near_a_goal_that_cannot_be_reached(
    tiled, whole_hills, tolerance
):
    blocked = whole_hills.map.vertices[whole_hills.blocked]
    rng = np.random.default_rng(31)
    goals = [*blocked[rng.integers(0, len(blocked), 5)], (20.0, 60.0, 0.0)]
    start = pose(whole_hills.free_places(1, 3)[0])
    requests = [PlanRequest(start, pose(goal), dist_tolerance=tolerance) for goal in goals]
    for ours, exact in on_both(tiled, whole_hills, *requests):
        assert ours.outcome == exact.outcome, (ours.message, exact.message)
        if exact.path is not None:
            assert ours.path[-1].distance_to(exact.path[-1]) < 1e-6
            assert ours.message.split("; ")[-1] == exact.message.split("; ")[-1]


def test_a_goal_off_the_map_is_explained_with_the_heights_there(tiled, whole_hills):
    start = pose(whole_hills.free_places(1, 3)[0])
    above = whole_hills.free_places(1, 5)[0] + (0.0, 0.0, 3.0)
    requests = [PlanRequest(start, pose(goal)) for goal in (above, (-9.0, 4.0, 0.0))]
    for ours, exact in on_both(tiled, whole_hills, *requests):
        assert ours.outcome == exact.outcome == GetPathOutcome.OUT_OF_MAP and ours.permanent
        assert ours.message.split("; ")[-1] == exact.message.split("; ")[-1]


def test_there_is_no_path_to_another_storey_and_planning_again_does_not_help(tmp_path):
    tiled = TiledNavigationMap(build_storeys(tmp_path / "map", portal_length=2.0))
    between, above = planned(
        HierarchicalPlanner,
        tiled,
        PlanRequest(pose((1.2, 2.0, 0.0)), pose((38.7, 2.0, 3.0))),
        PlanRequest(pose((1.2, 2.0, 3.0)), pose((38.7, 2.0, 3.0))),
    )
    assert between.outcome == GetPathOutcome.NO_PATH_FOUND and between.permanent
    assert above.outcome == GetPathOutcome.SUCCESS
    assert sorted(tiled.ground_heights(9.7, 2.0)) == pytest.approx([0.0, 3.0])


def test_the_planner_keeps_the_contract_of_planners(tiled, whole_hills):
    easy = [(pose(a), pose(b)) for a, b in whole_hills.free_places(4, 8).reshape(-1, 2, 3)]
    nowhere = (easy[0][0], Pose.planar(-50.0, 0.0))
    make = lambda base: MapContext(**vars(base), navigation_map=tiled)  # noqa: E731
    check_planner(HierarchicalPlanner, easy, make_context=make, unreachable=[nowhere], cancel_within=1.0)


def test_questions_have_the_answers_of_the_whole_mesh(tiled, whole_hills):
    whole = whole_hills.map
    whole.inscribed_radius = tiled.inscribed_radius
    assert whole.inscribed_radius == 0.3
    queries = [PlaceQuery(), PlaceQuery(safety_dist=1.5, lethal_cost_mult=2.0)]
    states = set()
    for place in [*places_anywhere(whole_hills, 24, 41), (12.0, 12.0, 0.0), (-3.0, 2.0, 0.0)]:
        there = pose(place)
        ours, exact = tiled.point_check()(there), whole.point_check()(there)
        assert ours.state == exact.state and ours.cost == pytest.approx(exact.cost, rel=1e-5, nan_ok=True)
        for query in queries:
            ours, exact = tiled.pose_check(query)(there), whole.pose_check(query)(there)
            assert ours.state == exact.state and ours.cost == pytest.approx(exact.cost, rel=1e-5, nan_ok=True)
            states.add(exact.state)
        command = Twist.planar(vx=0.8, wz=0.3)
        ahead, exact_ahead = (one.obstacle_ahead(there, command, 4.0) for one in (tiled, whole))
        assert ahead == exact_ahead
        assert tiled.nearest_obstacle(there, 5.0) == pytest.approx(whole.nearest_obstacle(there, 5.0))
        valid, exact_valid = (one.find_valid_pose(there, 6.0, 0.1, queries[0]) for one in (tiled, whole))
        assert valid.state == exact_valid.state and (valid.pose is None) == (exact_valid.pose is None)
        if valid.pose is not None:
            assert valid.pose.distance_to(exact_valid.pose) < 1e-9
        assert tiled.ground_heights(there.x, there.y) == pytest.approx(ground_heights(whole, there.x, there.y))
    assert states == {CellState.FREE, CellState.LETHAL, CellState.OUTSIDE}


def test_a_path_over_many_tiles_is_checked_as_on_the_whole_mesh_and_few_surroundings_are_kept(tiled, whole_hills):
    whole_hills.map.inscribed_radius = tiled.inscribed_radius
    points = whole_hills.map.locate(np.linspace((4.0, 5.0, 0.0), (44.0, 43.0, 0.0), 60), 30.0).points
    path = Path.from_points(points)
    ours, exact = (check_path(one.pose_check(PlaceQuery()), path) for one in (tiled, whole_hills.map))
    assert (ours.last_checked, ours.state) == (exact.last_checked, exact.state)
    assert ours.cost == pytest.approx(exact.cost, rel=1e-5)
    assert 0 < tiled._squares.kept_size <= KEPT_VERTICES


def test_surroundings_that_are_near_each_other_are_cut_out_once(tiled, monkeypatch):
    cut, mesh_within = [], surroundings.mesh_within
    monkeypatch.setattr(
        "mbf_mesh_nav.tiles.serving.squares.mesh_within", lambda *args: cut.append(args) or mesh_within(*args)
    )
    for x in np.linspace(20.0, 21.0, 20):
        tiled.point_check()(Pose.planar(x, 20.0))
    assert len(cut) <= 2


def serve(session, folder, config):
    file = folder / "robot.yaml"
    file.write_text(config, "utf-8")
    return session.serve(*read_config(file), session.robot, session.transforms)


def config(folder, more="", block=""):
    planner = "planners: [{name: far, type: tiles.hierarchical}]\n"
    return f"backend: tiles\n{planner}tiled_map:\n  folder: {folder}\n{block}{more}"


def test_the_action_interface_plans_on_tiles(tiled_hills, whole_hills, tmp_path):
    start, goal = map(pose, whole_hills.free_places(2, 15))
    with LoopbackSession(start) as session:
        server = serve(session, tmp_path, config(tiled_hills))
        result = session.navigator.send(GetPathGoal(goal)).wait()
        assert result.outcome == GetPathOutcome.SUCCESS and result.planner == "far"
        assert result.cost == pytest.approx(whole_hills.cost(start.position, goal.position), rel=0.03)
        assert server.queries.check_point(goal).state < CellState.LETHAL
        assert server.map_views[0] == "safe" and set(server.map_views) == set(server.tiled_map.tiled.index.layers)
        server.set_footprint(0.5)
        assert server.tiled_map.inscribed_radius == 0.5
        assert "built for a robot with a radius of 0.3 m, this one has 0.5 m" in server.notes[-1]
        with pytest.raises(ValueError, match="treats the robot as a disc"):
            server.set_footprint([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)])


def test_the_picture_shows_the_highest_cost_of_every_pixel(tiled_hills, whole_hills, tmp_path):
    with LoopbackSession(Pose.planar(0.0, 0.0)) as session:
        server = serve(session, tmp_path, config(tiled_hills))
        view = server.map_view("steepness")
    assert type(view) is server.map_view_type
    layer, vertices = whole_hills.map.layers["steepness"], whole_hills.map.vertices
    left, _, bottom, _ = view.extent
    side = (view.extent[1] - left) / view.costs.shape[1]
    expected = np.full(view.costs.shape, np.nan)
    values = np.where(layer.lethal, np.inf, layer.costs)
    columns, rows = np.floor((vertices[:, :2] - (left, bottom)) / side).astype(int).T
    for row, column, value in zip(rows, columns, values, strict=True):
        expected[row, column] = np.fmax(expected[row, column], value)
    assert np.array_equal(np.isnan(view.costs), np.isnan(expected)) and np.isnan(expected).any()
    assert np.allclose(view.costs, expected, equal_nan=True)


@pytest.mark.parametrize(
    ("block", "more", "error", "text"),
    [
        ("  profile: fast\n", "", MeshError, "no cost profile 'fast', the map has: default"),
        ("  window: 1.0e+200\n", "", ConfigError, r"tiled_map.window: expected .*\b10000\b.*, got 1e\+200"),
        ("  memory: 1000\n", "", MeshError, "MB of memory, allowed are 0.001 MB"),
        ("", "global_frame: odom\n", MeshError, "in the frame 'map', the global_frame of the configuration is 'odom'"),
        ("", "controllers: [{name: field, type: vector_field}]\n", ServerError, "needs the whole mesh in memory"),
    ],
)
def test_what_does_not_fit_the_map_is_refused_at_the_start(tiled_hills, tmp_path, block, more, error, text):
    with LoopbackSession(Pose.planar(0.0, 0.0)) as session, pytest.raises(error, match=text):
        serve(session, tmp_path, config(tiled_hills, more, block))


def test_a_folder_in_a_home_that_is_not_known_is_no_folder_of_tiles(tmp_path):
    with LoopbackSession(Pose.planar(0.0, 0.0)) as session, pytest.raises(MeshError, match="no such folder of tiles"):
        serve(session, tmp_path, config("~nobody_of_this_name/map"))


def test_planners_for_one_mesh_are_refused_at_the_start(tiled_hills, tmp_path):
    text = config(tiled_hills).replace("tiles.hierarchical", "cvp")
    with LoopbackSession(Pose.planar(0.0, 0.0)) as session, pytest.raises(ConfigError, match="needs the whole mesh"):
        serve(session, tmp_path, text)


def test_the_planner_is_refused_on_another_map(whole_hills):
    with pytest.raises(ValueError, match=r"HierarchicalPlanner needs a TiledNavigationMap .*, .* is a MeshMap"):
        planned(HierarchicalPlanner, whole_hills.map)


def test_a_tile_that_is_damaged_while_the_server_runs_is_a_map_error(tiled_hills, whole_hills, tmp_path):
    folder = shutil.copytree(tiled_hills, tmp_path / "map")
    start, goal = whole_hills.free_places(2, 15)
    tiled = TiledNavigationMap(TiledMap(folder))
    key = tuple((start[:2] // 12.0).astype(int))
    assert read_tile(tile_file(folder, key)).core_vertices
    tile_file(folder, key).write_bytes(b"none")
    (result,) = planned(HierarchicalPlanner, tiled, PlanRequest(pose(start), pose(goal)))
    assert result.outcome == GetPathOutcome.MAP_ERROR and f"tile_{key[0]}_{key[1]}.npz" in result.message


def cut_out(tiled, low, high):
    found = surroundings.mesh_within(tiled, low, high, lambda key: sound_tile(tiled.folder, tiled.index, key))
    return None if found is None else found.map


def test_where_tiles_differ_about_a_shared_vertex_it_has_the_worse_value(tiled_hills, tmp_path):
    folder = shutil.copytree(tiled_hills, tmp_path / "map")
    tiled = TiledMap(folder)
    tile = read_tile(tile_file(folder, (1, 1)))
    everywhere = np.ones(tile.core_vertices, dtype=np.bool_)
    tiled.change_layer((1, 1), "safe", np.full(len(everywhere), np.inf, dtype=np.float32), everywhere)
    there = cut_out(tiled, (6.0, 6.0), (18.0, 18.0))
    shared = {tuple(position) for position in tile.vertices[tile.shared]}
    is_shared = np.array([tuple(position) in shared for position in there.vertices])
    assert is_shared.any() and there.snapshot().lethal[is_shared].all()


def test_surroundings_are_the_same_piece_of_the_whole_mesh(tiled_hills, whole_hills):
    tiled = TiledMap(tiled_hills)
    there, whole = cut_out(tiled, (10.0, 9.0), (26.0, 31.0)), whole_hills.map
    low, high = np.array([10.0, 9.0]), np.array([26.0, 31.0])
    corners = whole.vertices[whole.faces][:, :, :2]
    chosen = ((corners.max(axis=1) >= low) & (corners.min(axis=1) <= high)).all(axis=1)
    assert len(there.faces) == chosen.sum()
    ours = {frozenset(map(tuple, there.vertices[face].tolist())) for face in there.faces}
    assert ours == {frozenset(map(tuple, whole.vertices[face].tolist())) for face in whole.faces[chosen]}
    place = {tuple(position): number for number, position in enumerate(whole.vertices.tolist())}
    order = [place[tuple(position)] for position in there.vertices.tolist()]
    for name, layer in there.layers.items():
        assert np.array_equal(layer.lethal, whole.layers[name].lethal[order]), name
        assert np.allclose(layer.costs, whole.layers[name].costs[order], rtol=1e-6), name
    assert there.snapshot().edge_cost_factor == 1.5
    assert cut_out(tiled, (100.0, 0.0), (120.0, 9.0)) is None


def test_another_terrain_with_walls_gives_the_same_outcomes(tmp_path):
    heights = terrain(65, seed=5, walls=30)
    build_tiles(HeightSource(heights, SPACING, SPACING), tmp_path / "map", settings(tile_size=8.0))
    whole, tiled = WholeMap(heights), TiledNavigationMap(TiledMap(tmp_path / "map"))
    places = [*whole.free_places(12, 1), *places_anywhere(whole, 12, 2)]
    requests = [PlanRequest(pose(a), pose(b), dist_tolerance=1.0) for a, b in zip(places, places[::-1], strict=True)]
    for ours, exact in on_both(tiled, whole, *requests):
        assert ours.outcome == exact.outcome, (ours.message, exact.message)
