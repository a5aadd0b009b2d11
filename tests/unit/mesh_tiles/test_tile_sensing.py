"""What sensors see on a map of tiles: marked in a window that follows the robot, as on the whole mesh."""

import contextlib
import shutil

import numpy as np
import pytest
from test_tile_server import config, planned, pose, serve
from tiled_terrains import BLOCKS, PARAMETERS, SPACING, WholeMap

from mbf_abstract.geometry import Path, Pose
from mbf_abstract.maps.layers.layer_list import LayerListError
from mbf_abstract.maps.map_queries import check_path
from mbf_abstract.maps.queries import CellState, PlaceQuery
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import PlanRequest
from mbf_abstract.testing.loopback import LoopbackSession
from mbf_mesh_nav.layers.obstacle import ObstacleLayer, ObstacleParameters
from mbf_mesh_nav.map.layer import MeshLayer
from mbf_mesh_nav.map.map_builder import MeshLayerEntry
from mbf_mesh_nav.mesh.mesh_report import MeshError
from mbf_mesh_nav.planners.hierarchical import HierarchicalPlanner
from mbf_mesh_nav.tiles.planning import plan_on_tiles
from mbf_mesh_nav.tiles.sensed import SensedCosts
from mbf_mesh_nav.tiles.serving.navigation_map import TiledNavigationMap
from mbf_mesh_nav.tiles.serving.window_settings import MOVES_AT, SHOWN, window_settings
from mbf_mesh_nav.tiles.tile import tile_file
from mbf_mesh_nav.tiles.tiled_map import TiledMap

SIDE = 16.0
RADIUS = BLOCKS["inflation"]["inflation_radius"]
ENTRIES = (
    MeshLayerEntry(name="obstacles", type="obstacle"),
    MeshLayerEntry(name="around", type="inflation", inputs=("obstacles",)),
)
SENSING = {
    "obstacles": {"sources": ("lidar",), "decay_time": np.inf, "clearing": False},
    "around": {"inscribed_radius": 0.3, "inflation_radius": RADIUS, "lethal_value": np.inf},
}
OBSTACLES = """  window: 16.0
  layers: [{name: obstacles, type: obstacle}, {name: around, type: inflation, inputs: [obstacles]}]
  obstacles: {sources: [lidar]}
  around: {inscribed_radius: 0.3, inflation_radius: 0.8, lethal_value: .inf}
"""
NEAR = PlaceQuery(safety_dist=1.0)
SENSING_OFF = ObstacleParameters(sources=("lidar",), enabled=False)


def sensing_map(folder, blocks=SENSING, side=SIDE, entries=ENTRIES, **more):
    tiled = TiledMap(folder, **more)
    return TiledNavigationMap(tiled, window=window_settings(tiled, side, entries, blocks))


class SensingWhole(WholeMap):
    """The naive twin: the whole mesh with the same layers, and the same combination of stored and sensed ones."""

    def __init__(self, heights, blocks=SENSING, entries=ENTRIES):
        entries = (*entries, MeshLayerEntry(name=SHOWN, type="max_combination", inputs=("safe", "around")))
        parameters = PARAMETERS.model_copy(update={"layers": (*PARAMETERS.layers, *entries)})
        super().__init__(heights, parameters, {**BLOCKS, **blocks})
        self.place = {tuple(position): number for number, position in enumerate(self.map.vertices.tolist())}

    def look(self):
        """Plan and answer on the map as it is now."""
        self.snapshot = self.map.snapshot()
        self.blocked = self.snapshot.blocked(1.0)


@pytest.fixture(scope="module")
def way(whole_hills):
    """Free vertices (n, 3) along a line from one corner of the hills towards the other, about every metre."""
    free = whole_hills.map.vertices[~whole_hills.blocked]
    line = np.column_stack([np.linspace(6.0, 42.0, 37), np.linspace(8.0, 40.0, 37)])
    return np.array([free[np.argmin(((free[:, :2] - place) ** 2).sum(axis=1))] for place in line])


def scan(robot, points, stamp):
    return RangeScan.of_points("lidar", points, np.add(robot, (0.0, 0.0, 0.5)), stamp, "map")


def boxes_around(robot, rng, whole, count=3, reach=3.5):
    """Points above the surface around a robot, as of small boxes: as far as any window reaches."""
    middles = robot[:2] + rng.uniform(-reach, reach, (count, 2))
    xy = (middles[:, None] + rng.uniform(-0.3, 0.3, (count, 6, 2))).reshape(-1, 2)
    return above_ground(whole, xy, 0.6)


def above_ground(whole, xy, height):
    """Points (n, 3) so high above the surface, but none over a hole."""
    sky = np.column_stack([xy, np.full(len(xy), 50.0)])
    faces, depths = whole.map.locator.cast_rays(sky, (0.0, 0.0, -1.0))
    return (sky - np.column_stack([0.0 * xy, depths - height]))[faces >= 0]


def drive(tiled, whole, way, seed=0):
    """Show both maps the same along a way; yields after each step."""
    rng = np.random.default_rng(seed)
    for step, robot in enumerate(way):
        seen = scan(robot, boxes_around(robot, rng, whole), float(step))
        for one in (tiled, whole.map):
            one.insert_scan(seen)
            one.update(pose(robot), float(step))
        yield robot


def assert_same_costs(tiled, whole, margin=RADIUS + SPACING):
    """In the window, but for what lies within the layers' reach of its edge, costs are those of the whole mesh."""
    window = tiled.window_map
    inner = np.abs(window.vertices[:, :2] - tiled._window.now.middle).max(axis=1) < 0.5 * SIDE - margin
    order = np.array([whole.place[tuple(position)] for position in window.vertices.tolist()])[inner]
    ours, exact = window.snapshot(), whole.map.snapshot()
    assert np.array_equal(ours.lethal[inner], exact.lethal[order])
    assert np.allclose(ours.costs[inner], exact.costs[order], rtol=1e-6)
    return int((window.layers["around"].costs[inner] > 0.0).sum())


# --------------------------------------------------------------------------------------------------- intake
def test_along_a_drive_the_window_has_the_costs_of_the_whole_mesh_with_all_that_was_seen(tiled_hills, hills, way):
    tiled, whole = sensing_map(tiled_hills), SensingWhole(hills)
    windows, raised = set(), 0
    for robot in drive(tiled, whole, way):
        middle = np.array(tiled._window.now.middle)
        windows.add(tuple(middle))
        assert np.abs(robot[:2] - middle).max() <= MOVES_AT * SIDE
        raised += assert_same_costs(tiled, whole)
    assert len(windows) > 6 and raised > 1000


def test_moving_obstacles_and_their_trails_are_followed_from_window_to_window(tiled_hills, hills):
    """A box drives beside the robot, seen five times a second; another one stands where nobody drives."""
    blocks = {**SENSING, "moving": {"sources": ("lidar",), "inscribed_radius": 0.3}}
    inflated = MeshLayerEntry(name="around", type="inflation", inputs=("moving",))
    entries = (ENTRIES[0], MeshLayerEntry(name="moving", type="moving_obstacles", inputs=("obstacles",)), inflated)
    tiled, whole = sensing_map(tiled_hills, blocks, entries=entries), SensingWhole(hills, blocks, entries)
    box, windows, trails = np.random.default_rng(3).uniform(-0.2, 0.2, (8, 2)), set(), 0
    for step, along in enumerate(np.linspace((14.0, 26.0), (30.0, 26.0), 50)):
        robot = np.array([*along, whole.map.locate_one((*along, 0.0), 9.0).point[2]])
        seen = np.concatenate(
            [above_ground(whole, box + np.add(along, (0.5, dy)), 0.6) for dy in (1.5, -2.5)[: 1 + step % 2]]
        )
        for one in (tiled, whole.map):
            one.insert_scan(scan(robot, seen, 0.2 * step))
            one.update(pose(robot), 0.2 * step)
        windows.add(tuple(tiled._window.now.middle))
        assert_same_costs(tiled, whole)
        ours, exact = (one.tracked_objects(0.2 * step) for one in (tiled, whole.map))
        assert [(known.number, known.x, known.vx) for known in ours] == [(it.number, it.x, it.vx) for it in exact]
        trails += int(tiled.layers["moving"]._trail.sum())
    assert len(windows) > 3 and trails > 100


def test_what_was_seen_is_forgotten_when_the_window_has_left_it(tiled_hills, hills, way):
    tiled, whole = sensing_map(tiled_hills), SensingWhole(hills)
    most = (SIDE / SPACING + 6.0) ** 2
    for _ in drive(tiled, whole, way):
        assert len(tiled.window_map.vertices) < most
    behind = [*drive(tiled, whole, way[:2])]
    hits = tiled.layers["obstacles"]._hits.points
    assert len(hits) < len(whole.map.layers["obstacles"]._hits.points)
    assert np.abs(hits[:, :2] - behind[0][:2]).max() <= 0.5 * SIDE + 3.0 * SPACING


def test_a_scan_that_comes_while_the_window_moves_is_not_lost(tiled_hills, whole_hills, way):
    tiled = sensing_map(tiled_hills)
    tiled.update(pose(way[0]), 0.0)
    old = tiled.layers["obstacles"]
    tiled.update(pose(way[15]), 1.0)
    assert tiled.layers["obstacles"] is not old
    old.insert_scan(scan(way[15], way[17][None] + (0.0, 0.0, 0.4), 1.1))  # another thread had found the old layer
    tiled.update(pose(way[15]), 1.2)
    assert tiled.point_check()(pose(way[17])).state == CellState.LETHAL and not tiled.stale_reason(1.3)


def test_silence_and_clearing_make_the_map_stale_also_after_the_window_has_moved(tiled_hills, way):
    tiled = sensing_map(tiled_hills)
    tiled.update(pose(way[0]), 0.0)
    assert "'lidar' has not sent anything yet" in tiled.stale_reason(0.0)
    tiled.insert_scan(scan(way[0], way[2][None] + (0.0, 0.0, 0.4), 0.1))
    for robot, now in ((way[0], 0.2), (way[6], 0.4)):
        tiled.update(pose(robot), now)
        assert not tiled.stale_reason(now)
    assert "silent for 1.20 s" in tiled.stale_reason(1.3)
    assert tiled.clear() == ["obstacles"]
    assert "since it was cleared" in tiled.stale_reason(0.5)
    tiled.update(pose(way[24]), 0.6)
    assert "since it was cleared" in tiled.stale_reason(0.6)
    assert tiled.listens_to("lidar") and tiled.source_names == ("lidar",)
    with pytest.raises(ValueError, match="no layer listens to the source 'radar'"):
        tiled.insert_points("radar", way[:1], way[0], 0.7)


def test_a_window_that_cannot_be_cut_out_holds_the_robot_until_it_can(tiled_hills, way, tmp_path):
    folder = shutil.copytree(tiled_hills, tmp_path / "map")
    tiled = sensing_map(folder)
    tiled.update(pose(way[0]), 0.0)
    tiled.insert_scan(scan(way[0], way[2][None] + (0.0, 0.0, 0.4), 0.0))
    key = tuple((way[20][:2] // 12.0).astype(int))
    sound = tile_file(folder, key).read_bytes()
    tile_file(folder, key).write_bytes(b"none")
    with pytest.raises(MeshError):
        tiled.update(pose(way[20]), 0.1)
    assert f"tile_{key[0]}_{key[1]}.npz" in tiled.stale_reason(0.1)
    tile_file(folder, key).write_bytes(sound)
    tiled.update(pose(way[20]), 0.2)
    tiled.insert_scan(scan(way[20], way[22][None] + (0.0, 0.0, 0.4), 0.3))
    tiled.update(pose(way[20]), 0.3)
    assert not tiled.stale_reason(0.3)


def test_scans_wait_for_a_window_around_the_robot_and_the_map_is_stale_without_one(tiled_hills, way):
    tiled = sensing_map(tiled_hills)
    tiled.insert_scan(scan(way[12], way[14][None] + (0.0, 0.0, 0.4), 0.0))
    tiled.update(None, 0.1)
    assert "the pose of the robot is unknown" in tiled.stale_reason(0.1)
    tiled.update(pose(way[12]), 0.2)
    assert not tiled.stale_reason(0.2) and tiled.point_check()(pose(way[14])).state == CellState.LETHAL
    tiled.update(None, 0.3)
    assert "the pose of the robot is unknown" in tiled.stale_reason(0.3)
    tiled.update(Pose.planar(200.0, 200.0), 0.4)
    assert "no surface around the robot at (200.00, 200.00)" in tiled.stale_reason(0.4)
    tiled.update(pose(way[12]), 0.5)
    assert not tiled.stale_reason(0.5)


def test_a_window_that_the_robot_has_jumped_to_is_stale_until_it_is_seen(tiled_hills, way):
    tiled = sensing_map(tiled_hills)
    for robot, now in ((way[0], 0.0), (way[20], 0.2)):
        tiled.update(pose(robot), now)
        assert tiled.stale_reason(now)
        tiled.insert_scan(scan(robot, robot[None] + (1.0, 0.0, 0.4), now + 0.1))
        tiled.update(pose(robot), now + 0.1)
        assert not tiled.stale_reason(now + 0.1)


def test_on_tiles_that_have_changed_predictions_stay_and_a_layer_that_raises_is_reported(
    tiled_hills, whole_hills, way, tmp_path, monkeypatch
):
    entries = (ENTRIES[0], MeshLayerEntry(name="moving", type="moving_obstacles", inputs=("obstacles",)))
    blocks = {"obstacles": SENSING["obstacles"], "moving": {"sources": ("lidar",)}}
    tiled = sensing_map(shutil.copytree(tiled_hills, tmp_path / "map"), blocks, entries=entries)
    key = tuple((way[10][:2] // 12.0).astype(int))
    tile = tiled.tiled.tile(key)[0]
    row = tiled.tiled.index.layers.index("safe")
    same = key, "safe", tile.costs[row].copy(), tile.lethal[row].copy()
    box = np.random.default_rng(3).uniform(-0.2, 0.2, (8, 2))
    for step in range(10):
        seen = above_ground(whole_hills, box + way[10][:2] + (0.15 * step, 1.0), 0.6)
        tiled.insert_scan(scan(way[10], seen, 0.1 * step))
        tiled.update(pose(way[10]), 0.1 * step)
    before = tiled.layers["moving"].costs.copy()
    assert ((before > 0.0) & (before < 1.0)).any()
    tiled.change_layer(*same)
    assert np.array_equal(tiled.layers["moving"].costs, before)

    def broken(layer, now):
        raise ArithmeticError("broken")

    monkeypatch.setattr(ObstacleLayer, "update", broken)
    for change in (lambda: tiled.update(pose(way[10]), 1.0), lambda: tiled.change_layer(*same)):
        with pytest.raises(ArithmeticError):
            change()
        assert "broken" in tiled.stale_reason(1.0)


# --------------------------------------------------------------------------------------------------- questions
def test_questions_in_the_window_have_the_answers_of_the_whole_mesh(tiled_hills, hills, way):
    tiled, whole = sensing_map(tiled_hills), SensingWhole(hills)
    for _ in drive(tiled, whole, way[:20]):
        pass
    whole.map.inscribed_radius = tiled.inscribed_radius
    near = np.abs(whole.map.vertices[:, :2] - tiled._window.now.middle).max(axis=1)
    rng, asked = np.random.default_rng(5), 0
    places = whole.map.vertices[rng.permutation(np.flatnonzero(near < 0.5 * SIDE - RADIUS - 3.0 * SPACING))[:60]]
    for place in places:
        there = pose(place)
        for query in (PlaceQuery(), PlaceQuery(safety_dist=0.4)):
            ours, exact = tiled.pose_check(query)(there), whole.map.pose_check(query)(there)
            assert ours.state == exact.state and ours.cost == pytest.approx(exact.cost, rel=1e-5, nan_ok=True)
        ours, exact = tiled.point_check()(there), whole.map.point_check()(there)
        assert ours.state == exact.state
        asked += exact.state == CellState.LETHAL
    assert asked > 5
    for above in (np.add(places, (0.01, 0.02, 3.0)), np.add(way[-1:], (0.0, 0.0, 3.0))):  # and far out of the window
        assert tiled.heights_below(above) == pytest.approx(whole.map.heights_below(above), nan_ok=True)


def pairs_over_the_edge(tiled, whole, way):
    """For windows along the way: where the robot is, and places (3,) just within and just beyond its right edge."""
    for robot in way:
        tiled.update(pose(robot), 0.0)
        x, y = tiled._window.now.middle
        x += 0.5 * SIDE
        for offset in np.arange(-6.0, 6.0, 0.5):
            pair = above_ground(whole, np.array([(x - 0.3, y + offset), (x + 0.4, y + offset)]), 0.0)
            if len(pair) == 2 and tiled.pose_check(NEAR)(pose(pair[1])).state == CellState.FREE:
                yield robot, *pair


def test_a_place_beyond_the_edge_sees_what_was_sensed_within_it(tiled_hills, whole_hills, way):
    tiled = sensing_map(tiled_hills)
    robot, ground, place = next(pairs_over_the_edge(tiled, whole_hills, way))
    beyond = pose(place)
    before = tiled.pose_check(NEAR)(beyond)
    tiled.insert_scan(scan(robot, ground[None] + (0.0, 0.0, 0.4), 0.1))
    tiled.update(pose(robot), 0.1)
    after = tiled.pose_check(NEAR)(beyond)
    assert (before.state, after.state) == (CellState.FREE, CellState.LETHAL)
    path = Path.from_points(np.array([beyond.position, ground]))
    assert check_path(tiled.pose_check(PlaceQuery()), path).state == CellState.LETHAL
    assert tiled.nearest_obstacle(beyond, 3.0) is not None
    tiled.clear()
    assert tiled.pose_check(NEAR)(beyond) == before


def test_a_check_of_many_places_is_that_of_one_map(tiled_hills, whole_hills, way):
    """Places within the window and beyond its edge; another search asks about what has been seen since."""
    tiled = sensing_map(tiled_hills)
    robot, ground, place = next(pairs_over_the_edge(tiled, whole_hills, way))
    within, beyond = pose(ground), pose(place)
    before, points = tiled.pose_check(NEAR), tiled.point_check()
    expected = before(within), before(beyond), points(within)
    around = tiled.around(beyond.x, beyond.y, 2.0)
    costs = around.snapshot().costs.copy()
    tiled.insert_scan(scan(robot, ground[None] + (0.0, 0.0, 0.4), 0.1))
    tiled.update(pose(robot), 0.1)
    after = tiled.pose_check(NEAR)
    assert after(within).state == after(beyond).state == CellState.LETHAL != expected[1].state
    assert (before(within), before(beyond), points(within)) == expected
    assert after(beyond).state == CellState.LETHAL
    assert np.array_equal(around.snapshot().costs, costs)


# --------------------------------------------------------------------------------------------------- plans
def test_plans_cost_what_they_cost_on_the_whole_mesh_with_all_that_was_seen(tiled_hills, hills, whole_hills, way):
    """The way leads over borders of tiles; a small memory makes tiles go and come back with their sensed costs."""
    probe = TiledMap(tiled_hills)
    memory = probe.table_bytes + (4 + 9.5) * probe.pool.slot_bytes
    tiled, whole = sensing_map(tiled_hills, side=100.0, memory=memory), SensingWhole(hills)
    compared = 0
    for step, robot in enumerate(drive(tiled, whole, way, seed=2)):
        if step % 4:
            continue
        whole.look()
        goal = way[min(step + 9, len(way) - 1)]
        exact = whole.cost(robot, goal)
        (ours,) = planned(HierarchicalPlanner, tiled, PlanRequest(pose(robot), pose(goal)))
        assert not ours.permanent
        if ours.outcome == GetPathOutcome.SUCCESS:
            assert exact * (1.0 - 1e-5) <= ours.cost <= 1.03 * exact
            corners = [whole.map.locate_one(point) for point in ours.path.positions[1:-1]]
            assert not any(whole.blocked[whole.map.faces[one.face][np.argmax(one.barycentric)]] for one in corners)
            compared += exact > 1.001 * whole_hills.cost(robot, goal)
        else:
            assert np.isinf(exact) or ours.outcome != GetPathOutcome.NO_PATH_FOUND
    assert compared >= 3, "obstacles have to matter"


def test_a_plan_after_clearing_is_the_one_from_before(tiled_hills, whole_hills, way):
    tiled = sensing_map(tiled_hills)
    request = PlanRequest(pose(way[10]), pose(whole_hills.free_places(1, 4)[0]))
    tiled.update(pose(way[10]), 0.0)
    (before,) = planned(HierarchicalPlanner, tiled, request)
    middle = before.path.positions[len(before.path) // 8]
    tiled.insert_scan(scan(way[10], middle[None] + (0.0, 0.0, 0.4), 0.1))
    tiled.update(pose(way[10]), 0.1)
    (around,) = planned(HierarchicalPlanner, tiled, request)
    tiled.clear()
    (after,) = planned(HierarchicalPlanner, tiled, request)
    assert around.cost > before.cost and after.cost == before.cost
    assert np.array_equal(after.path.positions, before.path.positions)


def test_a_tile_that_changes_keeps_what_was_sensed_on_it(tiled_hills, way, tmp_path):
    tiled = sensing_map(shutil.copytree(tiled_hills, tmp_path / "map"))
    tiled.update(pose(way[10]), 0.0)
    tiled.insert_scan(scan(way[10], way[12][None] + (0.0, 0.0, 0.4), 0.1))
    tiled.update(pose(way[10]), 0.1)
    request = PlanRequest(pose(way[10]), pose(way[12]))
    (blocked,) = planned(HierarchicalPlanner, tiled, request)
    key = tuple((way[12][:2] // 12.0).astype(int))
    tile = tiled.tiled.tile(key)[0]
    row = tiled.tiled.index.layers.index("safe")
    for _ in range(2):
        tiled.change_layer(key, "safe", tile.costs[row].copy(), tile.lethal[row].copy())
    (still,) = planned(HierarchicalPlanner, tiled, request)
    assert blocked.outcome == still.outcome == GetPathOutcome.BLOCKED_GOAL
    assert "lethal in layer obstacles, around, shown" in still.message
    assert tiled.point_check()(pose(way[12])).state == CellState.LETHAL


def test_a_tile_that_cannot_be_read_again_takes_no_obstacle_out_of_the_plan(tiled_hills, whole_hills, tmp_path):
    """What was seen on one tile is forgotten while its file is damaged, and something is seen on another one."""
    folder = shutil.copytree(tiled_hills, tmp_path / "map")
    tiled, fresh = TiledMap(folder), TiledMap(folder)
    places = whole_hills.map.vertices[~whole_hills.blocked]
    start, goal = (places[np.argmin(((places[:, :2] - xy) ** 2).sum(axis=1))] for xy in ((6.0, 8.0), (30.0, 30.0)))
    before = plan_on_tiles(tiled, start, goal)
    first, second = (seen_on_tiles(tiled, before.positions[len(before.positions) // share]) for share in (8, 2))
    tiled.lay_over(first)
    plan_on_tiles(tiled, start, goal)
    ((key, _),) = tiled._raised.items()
    tiled._kept.clear()
    sound = tile_file(folder, key).read_bytes()
    tile_file(folder, key).write_bytes(b"none")
    with contextlib.suppress(MeshError):
        tiled.lay_over(second)
    tile_file(folder, key).write_bytes(sound)
    for one in (tiled, fresh):
        one.lay_over(second)
    ours, exact = (plan_on_tiles(one, start, goal) for one in (tiled, fresh))
    assert ours.cost == exact.cost != before.cost and np.array_equal(ours.positions, exact.positions)


def seen_on_tiles(tiled, place):
    """Lethal vertices within 0.8 m of a place, as a window would find them."""
    reach = 0.8
    box = (*(place - reach).tolist(), *(place + reach).tolist())
    (core,) = (
        (tile.numbers[: tile.core_vertices], tile.vertices[: tile.core_vertices])
        for tile in (tiled.tile(key)[0] for key in tiled.index.tiles_in(box))
        if (tile.vertices[: tile.core_vertices] == place).all(axis=1).any()
    )
    numbers, vertices = core
    near = np.flatnonzero(((vertices - place) ** 2).sum(axis=1) < reach**2)
    values = np.full(len(near), np.inf, dtype=np.float32), np.ones(len(near), dtype=np.bool_)
    return SensedCosts.at(numbers[near], *values, vertices[near])


# --------------------------------------------------------------------------------------------------- settings
def test_a_layer_takes_the_place_of_the_stored_one_of_its_name_and_adds_to_it(tiled_hills, whole_hills):
    entries = (*ENTRIES, MeshLayerEntry(name="safe", type="max_combination", inputs=("around",)))
    tiled = TiledMap(tiled_hills)
    over = TiledNavigationMap(tiled, window=window_settings(tiled, SIDE, entries, SENSING))
    assert {"safe", "safe as built", SHOWN} <= set(over.layers)
    stored, shown = over.layers["safe as built"], over.window_map.snapshot()
    assert stored.lethal.any() and np.array_equal(stored.lethal, shown.lethal)
    assert np.array_equal(stored.costs, shown.costs) and not over.layers["safe"].lethal.any()


@pytest.mark.parametrize(
    ("text", "finding"),
    [
        ("layers: [{name: rim, type: border}]", "layer 'rim' takes no scans and reads no layer that does"),
        ("layers: [{name: a, type: inflation, inputs: [safe]}]", "layer 'a' takes no scans and reads no layer that"),
        (
            "layers: [{name: o, type: obstacle}]\n  default_layer: safe",
            "default_layer 'safe': expected one of the list",
        ),
        ("layers: [{name: o, type: obstacle}]\n  default_layer: x", "default_layer 'x' is no layer"),
        ("layers: [{name: shown, type: obstacle}]", "layer name 'shown' is used twice"),
        ("layers: [{name: o, type: obstacle}, {name: i, type: inflation, inputs: [p]}]", "i reads unknown layer 'p'"),
        (
            "layers: [{name: o, type: obstacle}, {name: i, type: inflation, inputs: [o]}]\n"
            "  window: 4.0\n  i: {inflation_radius: 1.5}",
            "the layers look 1.5 m around a vertex, a window of 4 m leaves 1 m around the robot: expected a window of "
            "more than 6 m",
        ),
    ],
)
def test_layers_that_do_not_belong_in_a_window_are_refused_at_the_start(tiled_hills, tmp_path, text, finding):
    with LoopbackSession(Pose.planar(0.0, 0.0)) as session, pytest.raises(LayerListError) as caught:
        serve(session, tmp_path, config(tiled_hills, block=f"  {text}\n"))
    assert finding in str(caught.value) and "robot.yaml: tiled_map: " in str(caught.value)


def test_a_layer_that_would_lose_its_obstacles_when_the_window_moves_is_refused(tiled_hills):
    class Forgetful(ObstacleLayer):
        take_over = MeshLayer.take_over

    tiled, entry = TiledMap(tiled_hills), MeshLayerEntry(name="mine", type="forgetful")
    with pytest.raises(LayerListError, match="layer 'mine' takes scans and does not override 'take_over'"):
        window_settings(tiled, SIDE, (entry,), {}, load_layer=lambda name: Forgetful)


def test_parameters_of_sensing_layers_change_and_last_those_of_the_tiles_do_not(tiled_hills, way, tmp_path):
    with LoopbackSession(pose(way[0])) as session:
        server = serve(session, tmp_path, config(tiled_hills, block=OBSTACLES))
        server.set_layer_parameters("around", inflation_radius=1.0)
        server.tiled_map.set_layer_parameters("obstacles", SENSING_OFF, until=5.0)
        server.tiled_map.update(pose(way[14]), 1.0)
        assert server.tiled_map.layers["around"].parameters.inflation_radius == 1.0
        assert not server.tiled_map.layers["obstacles"].parameters.enabled
        server.tiled_map.update(pose(way[14]), 5.0)
        assert server.tiled_map.layers["obstacles"].parameters.enabled
        with pytest.raises(ValueError, match="'steepness' has the values of the tiles"):
            server.set_layer_parameters("steepness", enabled=False)


def test_a_map_without_layers_of_its_own_has_nothing_to_clear_and_is_never_stale(tiled_hills, way, tmp_path):
    with LoopbackSession(pose(way[0])) as session:
        server = serve(session, tmp_path, config(tiled_hills))
        assert server.tiled_map.clear() == [] and not server.map_problem() and not server.tiled_map.senses
        assert tuple(server.tiled_map.layers) == server.tiled_map.tiled.index.layers
