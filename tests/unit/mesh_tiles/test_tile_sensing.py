"""What sensors see on a map of tiles: marked in a window that follows the robot, as on the whole mesh."""

import contextlib
import shutil

import numpy as np
import pytest
from sensing_tiles import (
    ENTRIES,
    SENSING,
    SIDE,
    SensingWhole,
    above_ground,
    assert_same_costs,
    drive,
    scan,
    sensing_map,
)
from test_tile_server import pose
from tiled_terrains import SPACING

from mbf_abstract.geometry import Pose
from mbf_abstract.maps.layers.layer_list import LayerListError
from mbf_abstract.maps.queries import CellState
from mbf_mesh_nav.layers.obstacle import ObstacleLayer
from mbf_mesh_nav.map.map_parameters import MeshLayerEntry
from mbf_mesh_nav.mesh.mesh_report import MeshError
from mbf_mesh_nav.tiles.serving.windows.window_settings import MOVES_AT
from mbf_mesh_nav.tiles.tile import tile_file


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


def test_a_layer_that_raises_while_a_window_is_made_is_named(tiled_hills, way, monkeypatch):
    tiled = sensing_map(tiled_hills)
    tiled.update(pose(way[0]), 0.0)

    def broken(layer):
        raise ArithmeticError("broken")

    monkeypatch.setattr(ObstacleLayer, "recompute", broken)
    with pytest.raises(LayerListError, match="layer 'obstacles' raised ArithmeticError: broken"):
        tiled.update(pose(way[-1]), 1.0)
    assert "layer 'obstacles' raised ArithmeticError: broken" in tiled.stale_reason(1.0)
    monkeypatch.undo()
    tiled.update(pose(way[-1]), 2.0)


@pytest.mark.parametrize("senses", [True, False])
def test_a_window_of_tiles_that_have_changed_holds_the_robot_until_it_is_cut_out_again(
    tiled_hills, way, tmp_path, senses
):
    """A neighbour of the changed tile cannot be read; it is there again before the next update."""
    folder = shutil.copytree(tiled_hills, tmp_path / "map")
    tiled = sensing_map(folder, entries=ENTRIES if senses else ())
    tiled.update(pose(way[10]), 0.0)
    if senses:
        tiled.insert_scan(scan(way[10], way[12][None] + (0.0, 0.0, 0.4), 0.0))
        tiled.update(pose(way[10]), 0.0)
    key, beside = (1, 1), (1, 2)
    tile = tiled.tiled.tile(key)[0]
    lethal = np.ones(tile.core_vertices, dtype=np.bool_)
    closed = np.full(len(lethal), np.inf, dtype=np.float32)
    assert not tiled.stale_reason(0.0) and tiled.window_map.snapshot().lethal.mean() < 0.5
    sound = tile_file(folder, beside).read_bytes()
    tile_file(folder, beside).write_bytes(b"none")
    with pytest.raises(MeshError):
        tiled.change_layer(key, "safe", closed, lethal)
    for robot in (None, pose(way[10])):
        with contextlib.suppress(MeshError):
            tiled.update(robot, 0.1)
        assert tiled.stale_reason(0.1)
    assert "tile_1_2.npz" in tiled.stale_reason(0.1)
    tile_file(folder, beside).write_bytes(sound)
    tiled.update(pose(way[10]), 0.2)
    assert not tiled.stale_reason(0.2)
    known = {tuple(position) for position in tile.vertices[: tile.core_vertices].tolist()}
    window = tiled.window_map
    changed = [tuple(position) in known for position in window.vertices.tolist()]
    assert any(changed) and window.snapshot().lethal[changed].all()


def test_a_window_that_is_held_stays_until_it_is_released_and_is_stale_when_the_robot_has_left_it(tiled_hills, way):
    tiled = sensing_map(tiled_hills)
    tiled.update(pose(way[0]), 0.0)
    tiled.insert_scan(scan(way[0], way[2][None] + (0.0, 0.0, 0.4), 0.0))
    tiled.update(pose(way[0]), 0.0)
    held = tiled.window_map
    with tiled.held_window():
        for robot, is_in in ((way[6], True), (way[20], False), (way[6], True)):
            tiled.update(pose(robot), 0.1)
            assert tiled.window_map is held and bool(tiled.stale_reason(0.1)) is not is_in
    tiled.update(pose(way[6]), 0.2)
    assert tiled.window_map is not held and not tiled.stale_reason(0.2)


def test_the_picture_of_the_profile_shows_what_is_seen_and_those_of_other_layers_what_is_stored(tiled_hills, way):
    tiled = sensing_map(tiled_hills)
    tiled.update(pose(way[10]), 0.0)
    stored, steepness = tiled.view("safe"), tiled.view("steepness")
    left, right, bottom, _ = stored.extent
    side = (right - left) / stored.costs.shape[1]
    pixels = np.floor((way[8:15, :2] - (left, bottom)) / side).astype(int)
    seen = 8 + int(np.argmax(np.isfinite(stored.costs[pixels[:, 1], pixels[:, 0]])))
    column, row = pixels[seen - 8]
    tiled.insert_scan(scan(way[10], way[seen][None] + (0.0, 0.0, 0.4), 0.1))
    tiled.update(pose(way[10]), 0.1)
    shown = tiled.view("safe")
    assert shown is tiled.view("safe") and tiled.view("steepness") is steepness
    assert np.isinf(shown.costs[row, column]) and np.isfinite(stored.costs[row, column])
    raised = np.argwhere(np.isfinite(stored.costs) & (shown.costs != stored.costs))
    assert np.abs((raised[:, ::-1] + 0.5) * side + (left, bottom) - way[seen][:2]).max() < 1.2 + side
    tiled.clear()
    assert np.array_equal(tiled.view("safe").costs, stored.costs, equal_nan=True)
