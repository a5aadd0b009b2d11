"""Plans on a map of tiles on which sensors have marked obstacles."""

import contextlib
import shutil

import numpy as np
from sensing_tiles import SensingWhole, drive, scan, sensing_map
from test_tile_server import planned, pose

from mbf_abstract.maps.queries import CellState
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import PlanRequest
from mbf_mesh_nav.mesh.mesh_report import MeshError
from mbf_mesh_nav.planners.hierarchical import HierarchicalPlanner
from mbf_mesh_nav.tiles.planning import plan_between, plan_on_tiles
from mbf_mesh_nav.tiles.sensed import SensedCosts
from mbf_mesh_nav.tiles.tile import tile_file
from mbf_mesh_nav.tiles.tiled_map import TiledMap


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


def test_all_legs_of_a_plan_see_the_map_of_one_moment(tiled_hills, way, monkeypatch):
    """An obstacle appears on the second leg while the first one is searched."""
    tiled = sensing_map(tiled_hills)
    tiled.update(pose(way[10]), 0.0)
    request = PlanRequest(pose(way[10]), pose(way[13]), via=(pose(way[11]),))
    (before,) = planned(HierarchicalPlanner, tiled, request)
    legs = []

    def see_something_meanwhile(*args, **more):
        legs.append(plan_between(*args, **more))
        tiled.insert_scan(scan(way[10], np.add(way[12:14], (0.0, 0.0, 0.4)), 0.1))
        tiled.update(pose(way[10]), 0.1)
        return legs[-1]

    monkeypatch.setattr("mbf_mesh_nav.planners.hierarchical.plan_between", see_something_meanwhile)
    (during, after) = planned(HierarchicalPlanner, tiled, request, request)
    assert during.cost == before.cost and np.array_equal(during.path.positions, before.path.positions)
    assert after.outcome == GetPathOutcome.BLOCKED_GOAL
    assert len(legs) == 4, "two of the second plan ask whether the goal is blocked without what sensors see, too"


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
    assert "is blocked: lethal in layer obstacles" in still.message
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


def test_a_goal_that_is_blocked_on_the_stored_map_fails_for_good_and_one_blocked_by_a_sensor_does_not(
    tiled_hills, whole_hills, way
):
    tiled = sensing_map(tiled_hills)
    tiled.update(pose(way[10]), 0.0)
    tiled.insert_scan(scan(way[10], way[12][None] + (0.0, 0.0, 0.4), 0.1))
    tiled.update(pose(way[10]), 0.1)
    lethal = whole_hills.map.vertices[whole_hills.blocked & (whole_hills.map.vertices[:, 0] > 3.0)]
    closed = min(lethal, key=lambda place: abs(np.linalg.norm(place - way[10]) - 6.0))
    stored, sensed = PlanRequest(pose(way[10]), pose(closed)), PlanRequest(pose(way[10]), pose(way[12]))
    for _ in range(2):  # the search without sensors leaves what they have seen as it is
        first, second = planned(HierarchicalPlanner, tiled, stored, sensed)
        assert first.outcome == second.outcome == GetPathOutcome.BLOCKED_GOAL
        assert first.permanent and "so it is without what sensors see" in first.message
        assert not second.permanent and "is blocked: lethal in layer obstacles" in second.message
