"""Surroundings on a map of tiles: who waits for whom, how far they look, what is kept, and what a change does to it."""

import shutil
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from test_tile_server import config, planned, pose, serve
from tiled_terrains import SPACING, WholeMap, settings

from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.maps.queries import AS_CONFIGURED, CellState, PlaceQuery
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import PlanRequest
from mbf_abstract.testing.loopback import LoopbackSession
from mbf_abstract.time.cancel import CancelToken
from mbf_mesh_nav.map.map_parameters import MeshLayerEntry, MeshMapParameters
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.mesh.mesh_report import MeshError
from mbf_mesh_nav.planners.hierarchical import HierarchicalPlanner
from mbf_mesh_nav.tiles.building.build import build_tiles
from mbf_mesh_nav.tiles.building.sources import HeightSource, MeshSource
from mbf_mesh_nav.tiles.building.tile_settings import TileSettings
from mbf_mesh_nav.tiles.index import CostProfile, TileEntry, TileIndex
from mbf_mesh_nav.tiles.serving import navigation_map, squares
from mbf_mesh_nav.tiles.serving.navigation_map import TiledNavigationMap
from mbf_mesh_nav.tiles.serving.recently_used import RecentlyUsed
from mbf_mesh_nav.tiles.tile import read_tile, tile_file
from mbf_mesh_nav.tiles.tiled_map import TiledMap

DEADLINE = 100.0
"""Seconds, for what takes some milliseconds."""


@pytest.fixture
def tiled(tiled_hills):
    return TiledNavigationMap(TiledMap(tiled_hills))


@pytest.fixture
def changing(tiled_hills, tmp_path):
    """A map with files of its own."""
    return TiledNavigationMap(TiledMap(shutil.copytree(tiled_hills, tmp_path / "map")))


# --------------------------------------------------------------------------------------------------- waiting
def test_no_question_waits_for_a_search(tiled, whole_hills):
    kept, new = whole_hills.free_places(2, 15)
    tiled.point_check()(pose(kept))
    with ThreadPoolExecutor(1) as pool, tiled.turn_to_search():
        for place in (kept, new):
            pool.submit(tiled.point_check(), pose(place)).result(DEADLINE)
            pool.submit(tiled.obstacle_ahead, pose(place), Twist.planar(vx=0.5), 1.0).result(DEADLINE)
            pool.submit(tiled.find_valid_pose, pose(place), 1.0, 0.1, PlaceQuery()).result(DEADLINE)
        pool.submit(tiled.take_parameters, MeshMapParameters(inscribed_radius=0.2)).result(DEADLINE)


def test_a_goal_that_waits_for_the_search_of_another_one_can_be_cancelled(tiled, whole_hills):
    start, goal = map(pose, whole_hills.free_places(2, 15))
    token = CancelToken()
    with ThreadPoolExecutor(1) as pool, tiled.turn_to_search():
        waiting = pool.submit(planned, HierarchicalPlanner, tiled, PlanRequest(start, goal, cancel_token=token))
        assert not waiting.done()
        token.cancel("enough")
        (result,) = waiting.result(DEADLINE)
    assert result.outcome == GetPathOutcome.CANCELED and result.message == "enough"
    with tiled.turn_to_search() as moment:
        assert moment is not None


def test_values_are_made_again_after_they_were_forgotten_even_if_they_were_being_made():
    made = []

    def make(key):
        made.append(key)
        if len(made) == 1:
            values.clear()  # as another thread does
        return len(made)

    values = RecentlyUsed(make, 2)
    assert [values.get("a"), values.get("a"), values.get("a")] == [1, 2, 2]
    assert [values.get("b"), values.get("a"), values.get("c"), values.get("a"), values.get("b")] == [3, 2, 4, 2, 5]
    assert values.kept_size == 2


# --------------------------------------------------------------------------------------------------- geometry
def patch_under_large_faces():
    """A patch of a fine grid, and to its right two triangles of 400 m, whose corners are all far from it."""
    side = np.arange(0.0, 8.1, 0.5)
    x, y = (axis.ravel() for axis in np.meshgrid(side, side))
    count = len(side)
    first = (np.arange(count - 1)[:, None] * count + np.arange(count - 1)).ravel()
    faces = [[(a, a + 1, a + count + 1), (a, a + count + 1, a + count)] for a in first]
    fine = np.column_stack([x, y, np.zeros(len(x))])
    large = np.array([(9.0, -200.0, 0.0), (400.0, -200.0, 0.0), (400.0, 200.0, 0.0), (9.0, 200.0, 0.0)])
    extra = [(len(fine), len(fine) + 1, len(fine) + 2), (len(fine), len(fine) + 2, len(fine) + 3)]
    return np.vstack([fine, large]), np.array([*np.reshape(faces, (-1, 3)), *extra], dtype=np.int32)


def test_a_face_over_a_place_is_there_though_all_of_its_corners_are_far_away(tmp_path):
    vertices, faces = patch_under_large_faces()
    parameters = MeshMapParameters(layers=(MeshLayerEntry(name="slope", type="steepness"),))
    build_tiles(MeshSource(vertices, faces), tmp_path / "map", TileSettings(mesh_map=parameters, tile_size=64.0))
    tiled, whole = TiledNavigationMap(TiledMap(tmp_path / "map")), MeshMap.from_arrays(vertices, faces)
    assert tiled.tiled.index.spacing < 0.6
    for place in ((4.0, 4.0, 0.0), (20.0, 1.0, 0.0), (200.0, -20.0, 0.0), (300.0, 120.0, 0.0), (8.5, 4.0, 0.0)):
        there = tiled.point_check()(pose(place)).state
        assert there == whole.point_check()(pose(place)).state, place
    assert tiled.point_check()(pose((200.0, -20.0, 0.0))).state == CellState.FREE


@pytest.mark.parametrize("tile_size", [256.0, 12.0])
def test_the_spacing_is_that_of_the_vertices_however_large_a_tile_is(hills, tiled_hills, tmp_path, tile_size):
    folder = tiled_hills
    if tile_size == 256.0:
        folder = tmp_path / "map"
        build_tiles(HeightSource(hills, SPACING, SPACING), folder, settings(tile_size=tile_size))
    assert TiledMap(folder).index.spacing == pytest.approx(SPACING, rel=0.15)


def test_the_spacing_of_a_wall_is_not_nothing():
    entry = TileEntry(key=(0, 0), core_vertices=121, neighbours=600, shared=0, box=(3.0, 2.0, 0.0, 3.0, 7.0, 5.0))
    index = TileIndex(
        build="0" * 64,
        source="",
        frame_id="map",
        tile_size=256.0,
        portal_length=16.0,
        inscribed_radius=0.0,
        layers=("one",),
        default_layer="one",
        profiles={"default": CostProfile()},
        tiles=(entry,),
    )
    assert index.spacing == pytest.approx(0.5, rel=0.15)


# --------------------------------------------------------------------------------------------------- limits
def test_a_question_that_looks_too_far_is_refused_before_a_tile_is_read(tiled, monkeypatch):
    monkeypatch.setattr(squares, "mesh_within", None)
    assert tiled.reach == pytest.approx(255.0, rel=0.15)
    far = PlaceQuery(safety_dist=5000.0)
    for ask in (
        lambda: tiled.pose_check(far),
        lambda: tiled.find_valid_pose(Pose.planar(5.0, 5.0), 0.0, 0.0, far),
        lambda: tiled.nearest_obstacle(Pose.planar(5.0, 5.0), 5000.0),
    ):
        with pytest.raises(ValueError, match=r"looks 500\d m around a place .*, the limit on this map of tiles is 24"):
            ask()
    text = tiled.obstacle_ahead(Pose.planar(5.0, 5.0), Twist.planar(vx=20.0), 100.0)
    assert "needs 2001 m of the map of tiles around the robot, the limit is 24" in text


def test_as_many_surroundings_are_kept_as_have_so_many_vertices(tiled, monkeypatch):
    monkeypatch.setattr(squares, "KEPT_VERTICES", 12_000)
    tiled = TiledNavigationMap(tiled.tiled)
    for x in np.linspace(-40.0, 90.0, 14):
        tiled.point_check()(Pose.planar(x, 20.0))
        assert 0 < tiled._squares.kept_size <= 12_000
    whole = tiled.around(24.0, 24.0, 100.0)
    assert tiled.around(24.0, 24.0, 100.0) is whole, "the last one is kept, however large"


def test_a_goal_whose_tolerance_is_cut_names_the_limit(tiled, whole_hills):
    start = pose(whole_hills.free_places(1, 3)[0])
    far, near = (PlanRequest(start, Pose.planar(-200.0, 20.0), dist_tolerance=one) for one in (500.0, 5.0))
    cut, whole = planned(HierarchicalPlanner, tiled, far, near)
    assert cut.outcome == whole.outcome == GetPathOutcome.OUT_OF_MAP
    assert "; a goal's tolerance counts up to 61" in cut.message and "tolerance" not in whole.message


# --------------------------------------------------------------------------------------------------- motion
def test_a_robot_off_the_surface_gets_the_answers_of_the_whole_mesh(tiled, whole_hills):
    whole, forward = whole_hills.map, Twist.planar(vx=0.5)
    whole.inscribed_radius = tiled.inscribed_radius
    place = whole_hills.free_places(1, 15)[0]
    for room in (0.0, 0.3):
        query = PlaceQuery(safety_dist=room)
        assert tiled.path_check(query)(pose(place)) == whole.path_check(query)(pose(place))
    for there in (*(pose(place + np.array([0.0, 0.0, up])) for up in (0.8, 5.0)), Pose.planar(-300.0, 0.0)):
        assert tiled.obstacle_ahead(there, forward, 1.0) == whole.obstacle_ahead(there, forward, 1.0)
        assert tiled.obstacle_on_path(there, forward, 1.0) == whole.obstacle_on_path(there, forward, 1.0)
        assert tiled.path_check(AS_CONFIGURED)(there) == whole.path_check(AS_CONFIGURED)(there)
        assert tiled.nearest_obstacle(there, 9.0) == pytest.approx(whole.nearest_obstacle(there, 9.0))


def test_ground_steeper_than_the_configured_slope_is_not_turned_on(tmp_path):
    heights = 0.2 * SPACING * np.arange(33)[None, :] * np.ones((33, 1))
    build_tiles(HeightSource(heights, SPACING, SPACING), tmp_path / "map", settings())
    there, turn = pose((8.1, 8.1, 1.62), 0.0), Twist.planar(wz=0.5)
    whole = WholeMap(heights).map
    for slope in (None, 0.1, 0.3):
        block = "" if slope is None else f"  max_turning_slope: {slope}\n"
        whole.max_turning_slope = slope or MeshMap.max_turning_slope
        with LoopbackSession(there) as session:
            tiled = serve(session, tmp_path, config(tmp_path / "map", block=block)).tiled_map
            answer = tiled.obstacle_ahead(there, turn, 1.0)
        assert answer == whole.obstacle_ahead(there, turn, 1.0)
        assert bool(answer) == (slope == 0.1)


# --------------------------------------------------------------------------------------------------- changes
def close(changing, key):
    """Make all of a tile forbidden."""
    lethal = np.ones(read_tile(tile_file(changing.tiled.folder, key)).core_vertices, dtype=np.bool_)
    changing.change_layer(key, "safe", np.full(len(lethal), np.inf, dtype=np.float32), lethal)


def test_a_layer_that_changes_changes_answers_and_pictures(changing, whole_hills):
    free = next(place for place in whole_hills.free_places(30, 3) if (place[:2] // 12.0 == 1.0).all())
    before = changing.view("safe")
    assert changing.point_check()(pose(free)).state < CellState.LETHAL
    close(changing, (1, 1))
    assert changing.point_check()(pose(free)).state == CellState.LETHAL
    assert np.isposinf(changing.view("safe").costs).sum() > np.isposinf(before.costs).sum()


def test_a_layer_changes_between_two_searches(changing, monkeypatch):
    searching, change_layer = [], TiledMap.change_layer
    monkeypatch.setattr(
        TiledMap, "change_layer", lambda *args: searching.append(changing._searching.locked()) or change_layer(*args)
    )
    close(changing, (1, 1))
    assert searching == [True] and not changing._searching.locked()


def test_a_picture_is_made_once_for_each_layer(tiled, monkeypatch):
    made, overview = [], navigation_map.overview
    monkeypatch.setattr(navigation_map, "overview", lambda *args: made.append(args) or overview(*args))
    pictures = [tiled.view(layer) for layer in ("safe", "steepness", "safe", "steepness")]
    assert len(made) == 2 and pictures[0] is pictures[2] and pictures[1] is pictures[3]
    assert not pictures[0].costs.flags.writeable


def test_a_picture_of_a_map_with_a_tile_of_another_place_is_one_error(changing):
    folder = changing.tiled.folder
    shutil.copy(tile_file(folder, (2, 2)), tile_file(folder, (2, 1)))
    with pytest.raises(MeshError, match=r"tile_2_1\.npz"):
        changing.view("safe")


def test_heights_below_points_are_those_of_the_whole_mesh_however_far_apart_the_points_are(tiled, whole_hills):
    rng = np.random.default_rng(4)
    corners = whole_hills.map.vertices
    points = rng.uniform(corners.min(axis=0) - 2.0, corners.max(axis=0) + 2.0, (60, 3))
    for some in (points, points[:1], points[:0]):
        assert tiled.heights_below(some) == pytest.approx(whole_hills.map.heights_below(some), nan_ok=True)
    assert 0 < np.isnan(tiled.heights_below(points)).sum() < 60
