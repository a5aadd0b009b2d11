"""Plans on tiles against the exact plan on the whole mesh, and what opens, loads and changes tiles."""

import re
import shutil

import networkx
import numpy as np
import pytest
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra
from tiled_terrains import PARAMETERS, SPACING, WholeMap, settings, terrain

from mbf_abstract.outcomes import GetPathOutcome
from mbf_mesh_nav.map.map_parameters import MeshLayerEntry, MeshMapParameters
from mbf_mesh_nav.mesh.mesh_report import MeshError
from mbf_mesh_nav.tiles import corridor_search, pool
from mbf_mesh_nav.tiles.building.build import build_tiles
from mbf_mesh_nav.tiles.building.sources import HeightSource, MeshSource
from mbf_mesh_nav.tiles.building.tile_settings import TileSettings
from mbf_mesh_nav.tiles.index import CostProfile
from mbf_mesh_nav.tiles.planning import plan_on_tiles
from mbf_mesh_nav.tiles.pool import TilePool
from mbf_mesh_nav.tiles.tile import read_tile, tile_file
from mbf_mesh_nav.tiles.tiled_map import KEPT_TILES, TiledMap

ROUNDING = 1e-5
"""Sums of some hundred float32 numbers in another order."""


def open_with_slots(folder, slots):
    """A map whose memory holds so many tiles besides those of start and goal."""
    tiled = TiledMap(folder)
    return TiledMap(folder, memory=tiled.table_bytes + (slots + KEPT_TILES + 0.5) * tiled.pool.slot_bytes)


def assert_near_exact(plan, exact):
    assert (plan.outcome == GetPathOutcome.SUCCESS) == np.isfinite(exact), plan.message
    if np.isfinite(exact):
        assert exact * (1.0 - ROUNDING) <= plan.cost <= exact * 1.03
        assert plan.cost <= (1.0 + plan.gap) * exact * (1.0 + ROUNDING)
        assert plan.least_cost <= exact * (1.0 + ROUNDING)


@pytest.mark.parametrize("seed", range(6))
def test_a_plan_costs_at_most_three_percent_more_than_the_exact_one_and_never_less(tmp_path, seed):
    heights = terrain(65 + 7 * seed, seed, walls=10 + 12 * seed)
    size = (6.0, 8.5, 15.0)[seed % 3]
    build_tiles(HeightSource(heights, SPACING, SPACING), tmp_path / "map", settings(tile_size=size))
    tiled, whole = TiledMap(tmp_path / "map"), WholeMap(heights)
    ends = whole.free_places(24, seed)
    for start, goal in zip(ends[::2], ends[1::2], strict=True):
        assert_near_exact(plan_on_tiles(tiled, start, goal), whole.cost(start, goal))


@pytest.mark.parametrize("margin", [0.0, 0.5])
def test_what_is_opened_at_first_does_not_matter(tiled_hills, whole_hills, monkeypatch, margin):
    monkeypatch.setattr(corridor_search, "FIRST_MARGIN", margin)
    tiled = TiledMap(tiled_hills)
    for start, goal in whole_hills.free_places(16, 3).reshape(-1, 2, 3):
        assert_near_exact(plan_on_tiles(tiled, start, goal), whole_hills.cost(start, goal))


def test_with_a_tolerance_of_nothing_a_plan_is_exact(tiled_hills, whole_hills):
    tiled = TiledMap(tiled_hills)
    for start, goal in whole_hills.free_places(16, 4).reshape(-1, 2, 3):
        plan, exact = plan_on_tiles(tiled, start, goal, tolerance=0.0), whole_hills.cost(start, goal)
        assert plan.cost == pytest.approx(exact, rel=ROUNDING) or plan.cost == exact == np.inf


def test_paths_are_continuous_over_the_borders_of_tiles_and_lie_on_the_surface(tiled_hills, whole_hills):
    tiled, longest = TiledMap(tiled_hills), float(whole_hills.map.neighbour_lengths.max())
    crossed = 0
    for start, goal in whole_hills.free_places(20, 5).reshape(-1, 2, 3):
        plan = plan_on_tiles(tiled, start, goal)
        if plan.outcome != GetPathOutcome.SUCCESS:
            continue
        crossed += len(plan.tiles) > 1
        steps = np.linalg.norm(np.diff(plan.positions, axis=0), axis=1)
        assert 0.0 < steps.min() and steps.max() <= longest * (1.0 + ROUNDING)
        assert np.allclose(plan.positions[[0, -1]], [start, goal], atol=1e-9)
        assert whole_hills.map.locate(plan.positions).distances.max() < 1e-9
        assert np.allclose(np.linalg.norm(plan.normals, axis=1), 1.0, atol=1e-6)
        assert len(plan.positions) == len(plan.normals)
    assert crossed > 5


def test_plans_are_the_same_after_other_plans_and_on_a_map_opened_anew(tiled_hills, whole_hills):
    tiled, pairs = TiledMap(tiled_hills), whole_hills.free_places(12, 6).reshape(-1, 2, 3)
    first = [plan_on_tiles(tiled, *pair) for pair in pairs]
    again = [plan_on_tiles(tiled, *pair) for pair in pairs[::-1]][::-1]
    anew = [plan_on_tiles(TiledMap(tiled_hills), *pair) for pair in pairs]
    for one, two, three in zip(first, again, anew, strict=True):
        assert one.positions.tobytes() == two.positions.tobytes() == three.positions.tobytes()
        assert one.cost == two.cost == three.cost


def test_the_least_recently_used_tiles_go_and_the_result_states_what_is_not_proven(tiled_hills, whole_hills):
    tiled = open_with_slots(tiled_hills, 6)
    assert tiled.pool.slots == 6
    bounded = 0
    for start, goal in whole_hills.free_places(40, 7).reshape(-1, 2, 3):
        plan, exact = plan_on_tiles(tiled, start, goal), whole_hills.cost(start, goal)
        assert len(plan.tiles) <= 6 and len(tiled.pool.loaded) <= 6
        assert not plan.tiles or set(tiled.pool.loaded[-len(plan.tiles) :]) == set(plan.tiles)
        if np.isfinite(plan.cost):
            assert exact * (1.0 - ROUNDING) <= plan.cost <= (1.0 + plan.gap) * exact * (1.0 + ROUNDING)
        if plan.gap > 0.03:
            assert plan.message.endswith("; the memory holds 6 of 16 tiles") or plan.gain <= corridor_search.STEADY
            bounded += 1
        if plan.outcome == GetPathOutcome.NO_PATH_FOUND and np.isfinite(exact):
            assert "the memory holds 6 of 16 tiles" in plan.message
            bounded += 1
    assert bounded > 0


def test_where_bounds_prove_nothing_a_wider_corridor_is_compared_and_costs_are_within_three_percent(tmp_path):
    heights = terrain(129, seed=11, walls=25)
    wide_portals = settings(tile_size=8.0, portal_length=4.0)
    build_tiles(HeightSource(heights, SPACING, SPACING), tmp_path / "map", wide_portals)
    tiled, whole, compared = open_with_slots(tmp_path / "map", 40), WholeMap(heights), 0
    for start, goal in whole.free_places(40, 2).reshape(-1, 2, 3):
        plan, exact = plan_on_tiles(tiled, start, goal), whole.cost(start, goal)
        if plan.gap > 0.03 and plan.gain <= corridor_search.STEADY:
            assert "not proven, but at most 0.5 % cheaper than in a narrower corridor" in plan.message
            assert exact * (1.0 - ROUNDING) <= plan.cost <= 1.03 * exact
            compared += 1
    assert compared > 2


def test_only_a_corridor_with_other_portals_is_compared(tiled_hills, whole_hills, monkeypatch):
    corridors, exact = [], corridor_search.CorridorSearch._exact
    monkeypatch.setattr(corridor_search, "FIRST_MARGIN", 1e-6)
    monkeypatch.setattr(corridor_search, "LEAST_WIDENING", 0.0)
    monkeypatch.setattr(
        corridor_search.CorridorSearch, "_exact", lambda *args: corridors.append(args[1]) or exact(*args)
    )
    tiled, compared = open_with_slots(tiled_hills, 8), 0
    for start, goal in whole_hills.free_places(20, 4).reshape(-1, 2, 3):
        corridors.clear()
        if np.isfinite(plan_on_tiles(tiled, start, goal).gain):
            assert not np.array_equal(corridors[-1].is_open, corridors[-2].is_open)
            compared += 1
    assert compared > 2


def test_a_search_that_goes_on_in_a_wider_corridor_costs_what_one_from_the_start_costs(
    tiled_hills, whole_hills, monkeypatch
):
    monkeypatch.setattr(corridor_search, "FIRST_MARGIN", 1e-6)
    monkeypatch.setattr(corridor_search, "LEAST_WIDENING", 0.0)
    tiled, ends = TiledMap(tiled_hills), whole_hills.free_places(20, 6).reshape(-1, 2, 3)
    going_on = [plan_on_tiles(tiled, *pair, tolerance=0.0) for pair in ends]
    monkeypatch.setattr(corridor_search.CorridorSearch, "_searched", property(lambda _: (), lambda *_: None), False)
    anew = [plan_on_tiles(tiled, *pair, tolerance=0.0) for pair in ends]
    assert sum(np.isfinite(plan.gain) for plan in going_on) > 2
    assert [(plan.cost, plan.tiles) for plan in going_on] == [(plan.cost, plan.tiles) for plan in anew]


def test_a_map_without_memory_for_a_wider_corridor_compares_nothing(tiled_hills, whole_hills):
    tiled = open_with_slots(tiled_hills, 3)
    for start, goal in whole_hills.free_places(20, 4).reshape(-1, 2, 3):
        plan = plan_on_tiles(tiled, start, goal, tolerance=0.0)
        assert ("narrower" in plan.message) == (plan.gain <= corridor_search.STEADY and plan.gap > 0.0), plan.message


def test_a_path_is_not_lost_to_a_wider_corridor_that_has_to_leave_out_its_tiles(tiled_hills, whole_hills, monkeypatch):
    found, exact = [], corridor_search.CorridorSearch._exact

    def only_the_ends(search, corridor, ranks, margin):
        ends = tuple(sorted({place.key for place in search._ends}))
        return corridor_search._Corridor(np.zeros_like(corridor.is_open), ends, True), margin

    monkeypatch.setattr(corridor_search.CorridorSearch, "_exact", lambda *args: found.append(exact(*args)) or found[-1])
    monkeypatch.setattr(corridor_search.CorridorSearch, "_widened", only_the_ends)
    tiled, lost = TiledMap(tiled_hills), 0
    for start, goal in whole_hills.free_places(20, 4).reshape(-1, 2, 3):
        found.clear()
        plan = plan_on_tiles(tiled, start, goal, tolerance=0.0)
        if len(found) == 2 and np.isfinite(found[0].cost) and found[1].cost > found[0].cost:
            assert plan.outcome == GetPathOutcome.SUCCESS and plan.cost == found[0].cost
            assert np.array_equal(plan.positions, found[0].positions) and plan.tiles == found[0].tiles
            assert plan.least_cost == max(one.least_cost for one in found)
            assert "neither proven nor compared with a wider corridor; the memory holds" in plan.message
            lost += 1
    assert lost > 2


def test_bounds_of_portals_are_those_of_networkx(tiled_hills):
    portals = TiledMap(tiled_hills).portals
    key = (2, 1)
    tile = read_tile(tile_file(tiled_hills, key))
    costs = np.full(len(tile.portals), np.inf, dtype=np.float32)
    costs[0] = 2.5
    graph = portals.as_networkx()
    seed = int(portals.portals_of(key)[0])
    expected = networkx.single_source_dijkstra_path_length(graph, seed, weight="weight")
    bounds = portals.least_costs([(key, costs)])
    assert {place for place, bound in enumerate(bounds) if np.isfinite(bound)} == set(expected)
    for place, cost in expected.items():
        assert bounds[place] == pytest.approx(2.5 + cost, rel=ROUNDING)


def test_costs_between_portals_are_the_least_of_all_pairs_of_their_vertices(tiled_hills):
    tiled = TiledMap(tiled_hills)
    tile, seen = tiled.tile((1, 2))
    passable = np.isfinite(seen.graph.weights)
    starts = np.repeat(np.arange(tile.core_vertices), np.diff(tile.offsets))[passable]
    edges = seen.graph.weights[passable].astype(np.float64), (starts, tile.neighbours[passable])
    distances = dijkstra(csr_array(edges, shape=(tile.core_vertices, tile.core_vertices)), indices=tile.shared)
    free = ~seen.graph.blocked[tile.shared]
    for row in range(len(tile.portals)):
        for column in range(len(tile.portals)):
            pairs = distances[np.ix_(free & (tile.portal_of == row), tile.shared[free & (tile.portal_of == column)])]
            expected = pairs.min(initial=np.inf) if row != column else tile.portal_costs[0, row, column]
            assert tile.portal_costs[0, row, column] == pytest.approx(expected, rel=ROUNDING)


def test_a_tile_that_changes_diverts_plans_and_changing_it_back_brings_them_back(tiled_hills, whole_hills, tmp_path):
    folder = shutil.copytree(tiled_hills, tmp_path / "map")
    tiled = TiledMap(folder)
    start, goal = np.array([2.3, 20.2, 0.0]), np.array([46.2, 21.3, 0.0])
    for end in (start, goal):
        end[2] = whole_hills.map.locate([end], 30.0).points[0, 2]
    plain = plan_on_tiles(tiled, start, goal)
    assert plain.outcome == GetPathOutcome.SUCCESS, plain.message
    middle = tuple(int(part // 12.0) for part in plain.positions[len(plain.positions) // 2, :2])
    tile = read_tile(tile_file(folder, middle))
    row = tiled.index.layers.index("safe")
    wall = np.ones(tile.core_vertices, dtype=np.bool_)
    tiled.change_layer(middle, "safe", np.full(len(wall), np.inf, dtype=np.float32), wall)
    diverted = plan_on_tiles(tiled, start, goal)
    inside = (np.floor(diverted.positions[:, :2] / 12.0 - 1e-9) == middle).all(axis=1)
    assert diverted.cost > plain.cost and not inside.any()
    reopened = plan_on_tiles(TiledMap(folder), start, goal)
    assert reopened.positions.tobytes() == diverted.positions.tobytes()
    tiled.change_layer(middle, "safe", tile.costs[row].copy(), tile.lethal[row].copy())
    assert plan_on_tiles(tiled, start, goal).positions.tobytes() == plain.positions.tobytes()
    assert tile_file(folder, middle).read_bytes() == tile_file(tiled_hills, middle).read_bytes()


def test_each_profile_has_plans_of_its_own(hills, whole_hills, tmp_path):
    profiles = {"careful": CostProfile(edge_cost_factor=1.5), "fast": CostProfile(layer="inflation")}
    build_tiles(HeightSource(hills, SPACING, SPACING), tmp_path / "map", settings(profiles=profiles))
    fast = TiledMap(tmp_path / "map", profile="fast")
    careful = TiledMap(tmp_path / "map")
    layers = PARAMETERS.model_copy(update={"default_layer": "inflation", "edge_cost_factor": 0.0})
    whole_fast = WholeMap(hills, layers)
    for start, goal in whole_hills.free_places(12, 8).reshape(-1, 2, 3):
        assert_near_exact(plan_on_tiles(careful, start, goal), whole_hills.cost(start, goal))
        assert_near_exact(plan_on_tiles(fast, start, goal), whole_fast.cost(start, goal))


def storeys():
    """Vertices and faces of two storeys of 40 by 4 m, 3 m above each other."""
    xs = np.arange(41.0)
    grid = np.array([[x, y, z] for z in (0.0, 3.0) for y in np.arange(5.0) for x in xs])
    corner = np.array([floor * 205 + row * 41 + column for floor in (0, 1) for row in range(4) for column in range(40)])
    faces = np.stack([np.column_stack([corner, corner + 1, corner + 41])] * 2, axis=1)
    faces[:, 1] = np.column_stack([corner + 1, corner + 42, corner + 41])
    return grid, faces.reshape(-1, 3).astype(np.int32)


def build_storeys(folder, portal_length):
    """Tiles of 10 m of two storeys."""
    parameters = MeshMapParameters(layers=(MeshLayerEntry(name="slope", type="steepness"),))
    wanted = TileSettings(mesh_map=parameters, tile_size=10.0, portal_length=portal_length)
    build_tiles(MeshSource(*storeys()), folder, wanted)
    return TiledMap(folder)


def test_storeys_are_kept_apart_at_the_borders_of_tiles(tmp_path):
    tiled = build_storeys(tmp_path / "map", portal_length=2.0)
    above = plan_on_tiles(tiled, (1.2, 2.0, 3.0), (38.7, 2.0, 3.0))
    assert above.outcome == GetPathOutcome.SUCCESS and (above.positions[:, 2] == 3.0).all()
    assert above.cost == pytest.approx(37.5, rel=0.02)
    between = plan_on_tiles(tiled, (1.2, 2.0, 0.0), (38.7, 2.0, 3.0))
    assert between.outcome == GetPathOutcome.NO_PATH_FOUND and between.message.startswith("no free path from (1.20")


def test_a_start_and_a_goal_in_one_portal_of_two_storeys_have_no_path(tmp_path, monkeypatch):
    corridors, exact = [], corridor_search.CorridorSearch._exact
    monkeypatch.setattr(
        corridor_search.CorridorSearch, "_exact", lambda *args: corridors.append(args[1]) or exact(*args)
    )
    tiled = build_storeys(tmp_path / "map", portal_length=10.0)
    plan = plan_on_tiles(tiled, (10.0, 2.0, 0.0), (10.0, 2.0, 3.0))
    assert plan.outcome == GetPathOutcome.NO_PATH_FOUND and len(plan.tiles) == 4
    assert len(corridors) < 5, "the least estimate is next to 0, so a share of it would widen nothing"
    above = plan_on_tiles(tiled, (1.2, 2.0, 3.0), (38.7, 2.0, 3.0))
    assert (above.positions[:, 2] == 3.0).all() and above.cost == pytest.approx(37.5, rel=0.02)


def test_the_tables_of_portals_are_part_of_the_memory(tiled_hills):
    tiled = TiledMap(tiled_hills)
    pairs = sum(len(tiled.portals.portals_of(key)) ** 2 for key in tiled.index.entries)
    assert tiled.table_bytes == 24 * pairs
    least = tiled.table_bytes + (KEPT_TILES + 2.1) * tiled.pool.slot_bytes
    assert TiledMap(tiled_hills, memory=least).pool.slots == 2
    with pytest.raises(MeshError, match=r"its tiles need .* MB of memory"):
        TiledMap(tiled_hills, memory=least - tiled.table_bytes)


def test_no_more_tiles_are_held_than_int32_can_number(tiled_hills, monkeypatch):
    entries = list(TiledMap(tiled_hills).index.entries.values())
    edges = max(entry.neighbours + entry.shared for entry in entries)
    monkeypatch.setattr(pool, "MOST_PLACES", 3 * edges + 1)
    assert TilePool(entries, 1e9).slots == 3


def test_starts_and_goals_on_borders_and_corners_of_tiles_are_found(tiled_hills, whole_hills):
    tiled, whole = TiledMap(tiled_hills), whole_hills.map
    for x, y in ((12.0, 12.0), (24.0, 18.25), (30.25, 36.0), (36.0, 24.0), (12.0, 7.0)):
        point = whole.locate([(x, y, 0.0)], 30.0).points[0]
        place = tiled.find_place(point, 0.4)
        assert place is not None and place.distance < 1e-9, (x, y)


@pytest.mark.parametrize(
    ("start", "goal", "outcome", "text"),
    [
        ((np.nan, 3.0, 0.0), None, GetPathOutcome.OUT_OF_MAP, "the start .* is not within 0.4 m of the surface"),
        (None, (20.0, np.inf, 9.0), GetPathOutcome.OUT_OF_MAP, "the goal .* is not within 0.4 m of the surface"),
        ((-5.0, 3.0, 0.0), None, GetPathOutcome.OUT_OF_MAP, "the start .* is not within 0.4 m of the surface"),
        (None, (20.0, 20.0, 90.0), GetPathOutcome.OUT_OF_MAP, "the goal .* is not within 0.4 m of the surface"),
        ((0.0, 20.0), None, GetPathOutcome.BLOCKED_START, r"the start .* is blocked: cost inf \(lethal\)"),
        (None, (25.0, 48.0), GetPathOutcome.BLOCKED_GOAL, r"the goal .* is blocked: cost inf \(lethal\)"),
    ],
)
def test_what_cannot_be_planned_is_an_outcome(tiled_hills, whole_hills, start, goal, outcome, text):
    ends = []
    for end, free in zip((start, goal), whole_hills.free_places(2, 1), strict=True):
        place = free if end is None else np.array(end)
        if len(place) == 2:
            column, row = (place / SPACING).astype(int)
            place = whole_hills.map.vertices[whole_hills.map.input_to_internal[row * 97 + column]]
        ends.append(place)
    plan = plan_on_tiles(TiledMap(tiled_hills), *ends)
    assert plan.outcome == outcome and len(plan.positions) == 0
    assert re.match(text, plan.message), plan.message


def test_a_cancelled_search_says_so(tiled_hills, whole_hills):
    start, goal = whole_hills.free_places(2, 9)
    plan = plan_on_tiles(TiledMap(tiled_hills), start, goal, cancel_flag=np.ones(1, dtype=np.uint8))
    assert plan.outcome == GetPathOutcome.CANCELED


def test_within_one_face_the_plan_is_the_line(tiled_hills, whole_hills):
    face = int(np.flatnonzero(~whole_hills.blocked[whole_hills.map.faces].any(axis=1))[50])
    corners = whole_hills.map.vertices[whole_hills.map.faces[face]]
    start, goal = np.array([[0.6, 0.2, 0.2], [0.2, 0.2, 0.6]]) @ corners
    plan = plan_on_tiles(TiledMap(tiled_hills), start, goal)
    assert np.allclose(plan.positions, [start, goal]) and plan.gap == 0.0
    assert plan.cost == pytest.approx(whole_hills.cost(start, goal), rel=ROUNDING)
