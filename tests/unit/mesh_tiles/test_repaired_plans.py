"""Plans on tiles by repair: distances to the goal are kept, and what sensors change is computed again, nothing else."""

import shutil
from dataclasses import replace

import numpy as np
import pytest
from sensing_tiles import SensingWhole, drive, sensing_map
from test_tile_server import pose

from mbf_abstract.maps.map_plugin import MapContext
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import PlanRequest
from mbf_abstract.testing.contract.rig import rig
from mbf_mesh_nav.mesh.mesh_report import MeshError
from mbf_mesh_nav.planners.hierarchical import HierarchicalParameters, HierarchicalPlanner
from mbf_mesh_nav.tiles.planning import place_on_tiles, plan_between
from mbf_mesh_nav.tiles.portals import NOT_CANCELLED
from mbf_mesh_nav.tiles.sensed import NOTHING_SENSED, SensedCosts
from mbf_mesh_nav.tiles.serving.corridor_field import CorridorField
from mbf_mesh_nav.tiles.tiled_map import KEPT_TILES, TiledMap


def places(tiled, *positions):
    return [place_on_tiles(tiled, name, at) for name, at in zip(("start", "goal"), positions, strict=True)]


def seen_around(tiled, place, reach=0.8):
    """Lethal vertices around a place on whatever tiles, as a window would find them."""
    box = (*(place - reach).tolist(), *(place + reach).tolist())
    cores = [tiled.tile(key)[0] for key in tiled.index.tiles_in(box)]
    numbers = np.concatenate([core.numbers[: core.core_vertices] for core in cores])
    vertices = np.concatenate([core.vertices[: core.core_vertices] for core in cores])
    near = np.flatnonzero(((vertices - place) ** 2).sum(axis=1) < reach**2)
    near = near[np.unique(numbers[near], return_index=True)[1]]
    values = np.full(len(near), np.inf, dtype=np.float32), np.ones(len(near), dtype=np.bool_)
    return SensedCosts.at(numbers[near], *values, vertices[near])


def assert_as_computed_anew(kept):
    """The field is, to the bit, that of the same tiles without a memory."""
    field = kept._field
    fresh = kept._new(field.path, field.goal, field.tolerance, NOT_CANCELLED)
    assert np.array_equal(field.distances, fresh.distances)


def test_repaired_plans_cost_what_they_cost_on_the_whole_mesh_with_all_that_was_seen(tiled_hills, hills, way):
    tiled, whole, goal = sensing_map(tiled_hills, side=100.0), SensingWhole(hills), way[-1]
    notes, make = [], lambda base: MapContext(**vars(base), navigation_map=tiled)
    with rig(HierarchicalPlanner, make, HierarchicalParameters(repair=True), pose(way[0])) as made:
        for robot in drive(tiled, whole, way[:24], seed=2):
            whole.look()
            exact, ours = whole.cost(robot, goal), made.plugin.make_plan(PlanRequest(pose(robot), pose(goal)))
            notes.append(ours.message)
            if ours.outcome == GetPathOutcome.SUCCESS:
                assert exact * (1.0 - 1e-5) <= ours.cost <= 1.03 * exact
            else:
                assert np.isinf(exact) or ours.outcome != GetPathOutcome.NO_PATH_FOUND
    assert sum("repaired" in note for note in notes) >= 3


def test_a_repaired_field_is_the_one_that_is_computed_anew(tiled_hills, whole_hills):
    """Obstacles come, move and go on the path, over borders of tiles and where several tiles meet."""
    tiled, rng = TiledMap(tiled_hills), np.random.default_rng(3)
    free = whole_hills.map.vertices[~whole_hills.blocked]
    ends = (free[np.argmin(((free[:, :2] - at) ** 2).sum(axis=1))] for at in ((42.0, 40.0), (6.0, 8.0)))
    start, goal = places(tiled, *ends)
    kept, corners = CorridorField(tiled), free[(np.abs(free[:, :2] % 12.0 - 6.0) > 5.4).all(axis=1)]
    path, repaired = kept.plan(start, goal, 0.03, NOT_CANCELLED).positions, 0
    for step in range(12):
        seen = corners if step % 3 == 0 else path[8:-8]
        tiled.lay_over(NOTHING_SENSED if step % 5 == 4 else seen_around(tiled, seen[rng.integers(len(seen))]))
        plan, exact = kept.plan(start, goal, 0.03, NOT_CANCELLED), plan_between(tiled, start, goal)
        assert exact.cost * (1.0 - 1e-6) <= plan.cost <= 1.03 * exact.cost
        assert_as_computed_anew(kept)
        repaired += "repaired" in plan.message
    assert 3 <= repaired < 12


def test_what_the_search_has_not_shown_is_searched_anew(tiled_hills, way, tmp_path):
    tiled = TiledMap(shutil.copytree(tiled_hills, tmp_path / "map"))
    kept, (start, goal) = CorridorField(tiled), places(tiled, way[4], way[16])

    def is_repaired(first=start, last=goal):
        return "repaired" in kept.plan(first, last, 0.03, NOT_CANCELLED).message

    assert not is_repaired() and is_repaired()
    assert not is_repaired(last=places(tiled, way[4], way[15])[1]), "another goal"
    assert not is_repaired() and is_repaired()
    far = max(way, key=lambda place: ((kept._field.path.positions - place) ** 2).sum(axis=1).min())
    assert not is_repaired(first=places(tiled, far, way[16])[0]), "far from the path"
    assert not is_repaired() and is_repaired()
    key = (0, 0)
    tile = tiled.tile(key)[0]
    tiled.change_layer(key, "border", tile.costs[0].copy(), tile.lethal[0].copy())
    assert not is_repaired() and is_repaired(), "a tile has changed"
    kept._field.path = replace(kept._field.path, tiles=kept._field.path.tiles[:2])
    tiled.lay_over(seen_around(tiled, way[30]))
    assert not is_repaired(), "something was seen outside of the corridor"


def test_all_copies_of_a_vertex_begin_a_repair_that_one_of_them_needs(tiled_hills, way):
    """Where three tiles and more meet, links lead round in a circle: the copy that knows may be no neighbour."""
    tiled = TiledMap(tiled_hills)
    kept, (start, goal) = CorridorField(tiled), places(tiled, way[4], way[30])
    tiles = kept.plan(start, goal, 0.03, NOT_CANCELLED).tiles
    numbers, vertices = tiled.pool.shared(tiles)
    known, counts = np.unique(numbers[np.isfinite(kept._field.distances[vertices])], return_counts=True)
    copies = vertices[numbers == known[counts >= 3][0]]
    assert len(kept._beside_reset_copies(kept._field, tiles)) == 0
    kept._field.distances[copies[0]] = np.inf
    assert sorted(kept._beside_reset_copies(kept._field, tiles).tolist()) == sorted(copies[1:].tolist())


def test_a_cancelled_repair_is_forgotten(tiled_hills, way):
    tiled = TiledMap(tiled_hills)
    kept, (start, goal) = CorridorField(tiled), places(tiled, way[4], way[16])
    kept.plan(start, goal, 0.03, NOT_CANCELLED)
    tiled.lay_over(seen_around(tiled, kept._field.path.positions[10]))
    plan = kept.plan(start, goal, 0.03, np.ones(1, dtype=np.uint8))
    assert plan.outcome == GetPathOutcome.CANCELED and kept._field is None
    assert "repaired" not in kept.plan(start, goal, 0.03, NOT_CANCELLED).message


def test_a_plan_that_may_cost_less_above_the_cheapest_is_searched_anew(tiled_hills, way):
    tiled = TiledMap(tiled_hills)
    kept, (start, goal) = CorridorField(tiled), places(tiled, way[4], way[16])

    def is_repaired(tolerance):
        return "repaired" in kept.plan(start, goal, tolerance, NOT_CANCELLED).message

    assert not is_repaired(0.03) and is_repaired(0.05) and is_repaired(0.03)
    assert not is_repaired(0.0) and is_repaired(0.0) and is_repaired(0.03)


def test_an_exact_plan_is_searched_anew_once_its_way_has_become_longer(tiled_hills, way):
    """Without a tolerance there is no room for another corridor, however little is left to win there."""
    tiled = TiledMap(tiled_hills)
    kept, (start, goal) = CorridorField(tiled), places(tiled, way[0], way[-1])
    first = kept.plan(start, goal, 0.0, NOT_CANCELLED)
    tiled.lay_over(seen_around(tiled, first.positions[10], reach=0.3))
    plan = kept.plan(start, goal, 0.0, NOT_CANCELLED)
    assert first.cost < plan.cost < 1.004 * first.cost and "repaired" not in plan.message


def room_for(tiled, slots):
    """Memory [B] that holds some tiles without a field."""
    return tiled.table_bytes + (KEPT_TILES + slots + 0.5) * tiled.pool.slot_bytes


def test_the_memory_holds_fewer_tiles_beside_a_field(tiled_hills):
    probe = TiledMap(tiled_hills)
    memory = room_for(probe, 9)
    tiled = TiledMap(tiled_hills, memory=memory)
    CorridorField(tiled)
    kept_and_tables = tiled.table_bytes + KEPT_TILES * probe.pool.slot_bytes
    assert tiled.pool.slots == int((memory - kept_and_tables) // tiled.pool.slot_bytes) < 9
    assert tiled.pool.slot_bytes > probe.pool.slot_bytes
    tight = TiledMap(tiled_hills, memory=room_for(probe, 2) - 0.4 * probe.pool.slot_bytes)
    pool = tight.pool
    with pytest.raises(MeshError, match=r"its tiles need .* MB of memory, allowed are"):
        CorridorField(tight)
    assert tight.pool is pool


def test_a_field_over_more_tiles_than_fit_beside_another_one_is_searched_anew(tiled_hills, way):
    probe = TiledMap(tiled_hills)
    for slots in range(4, 12):
        tiled = TiledMap(tiled_hills, memory=room_for(probe, slots))
        kept, (start, goal) = CorridorField(tiled), places(tiled, way[0], way[-1])
        tiles = kept.plan(start, goal, 0.03, NOT_CANCELLED).tiles
        CorridorField(tiled)
        if len(tiles) > tiled.pool.slots:
            break
    plan = kept.plan(start, goal, 0.03, NOT_CANCELLED)
    assert len(tiles) > tiled.pool.slots >= len(plan.tiles) and "repaired" not in plan.message


def test_a_planner_without_repair_keeps_no_distances(tiled_hills, way):
    navigation_map = sensing_map(tiled_hills, side=100.0)
    tiled, request = navigation_map.tiled, PlanRequest(pose(way[4]), pose(way[16]))
    slot_bytes, make = tiled.pool.slot_bytes, lambda base: MapContext(**vars(base), navigation_map=navigation_map)
    with rig(HierarchicalPlanner, make, HierarchicalParameters(), pose(way[4])) as made:
        planner = made.plugin
        planner.make_plan(request)
        assert tiled.pool.slot_bytes == slot_bytes
        planner.parameters = HierarchicalParameters(repair=True)
        notes = [planner.make_plan(request).message for _ in range(2)]
        assert ["repaired" in note for note in notes] == [False, True] and tiled.pool.slot_bytes > slot_bytes
        planner.parameters = HierarchicalParameters()
        planner.parameters_changed()
        planner.parameters = HierarchicalParameters(repair=True)
        assert "repaired" not in planner.make_plan(request).message
