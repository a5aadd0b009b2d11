"""Refiners for meshes on a map of tiles: piece by piece along the path, as on the whole mesh."""

import shutil

import numpy as np
import pytest
from sensing_tiles import scan, sensing_map
from test_tile_server import config, planned, pose, serve

from mbf_abstract.geometry import Path
from mbf_abstract.goals.goal_types import GetPathGoal, RefinePathGoal
from mbf_abstract.maps.map_plugin import MapContext
from mbf_abstract.outcomes import RefinePathOutcome
from mbf_abstract.plugins import PlanRequest
from mbf_abstract.testing.contract import check_refiner
from mbf_abstract.testing.contract.rig import rig
from mbf_abstract.testing.loopback import LoopbackSession
from mbf_abstract.time.cancel import CancelToken
from mbf_mesh_nav.planners.hierarchical import HierarchicalPlanner
from mbf_mesh_nav.plugins import MeshContext
from mbf_mesh_nav.refiners.string_pulling import StringPullingRefiner
from mbf_mesh_nav.search.path_cost import cost_along
from mbf_mesh_nav.tiles.serving import path_refiner
from mbf_mesh_nav.tiles.serving.navigation_map import TiledNavigationMap
from mbf_mesh_nav.tiles.serving.path_refiner import PathRefiner
from mbf_mesh_nav.tiles.tile import tile_file
from mbf_mesh_nav.tiles.tiled_map import TiledMap


@pytest.fixture
def tiled(tiled_hills):
    return TiledNavigationMap(TiledMap(tiled_hills))


def pulling(context):
    return PathRefiner(StringPullingRefiner, context)


def refined(navigation_map, path, token=None):
    """Result of string pulling on tiles, or on the whole mesh."""
    on_tiles = isinstance(navigation_map, TiledNavigationMap)
    context = MapContext if on_tiles else MeshContext
    make = lambda base: context(**vars(base), navigation_map=navigation_map)  # noqa: E731
    pulling.Parameters = StringPullingRefiner.Parameters
    with rig(pulling if on_tiles else StringPullingRefiner, make, None, path[0]) as made:
        return made.plugin.apply_refinement(path, token or CancelToken())


def cost_on(whole, positions):
    """Of a path over the surface [m], looked at every 0.05 m."""
    steps = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    counts = np.maximum(np.ceil(steps / 0.05), 1).astype(int)
    dense = [
        a + (b - a) * (np.arange(n) / n)[:, None] for a, b, n in zip(positions, positions[1:], counts, strict=False)
    ]
    points = np.concatenate([*dense, positions[-1:]])
    faces = whole.map.locate(0.5 * (points[1:] + points[:-1])).faces
    return cost_along(whole.map, whole.map.snapshot(), points, np.concatenate([faces[:1], faces]))


def long_plans(tiled, whole, seed, count=6):
    places = map(pose, whole.free_places(2 * count, seed))
    requests = [PlanRequest(start, goal) for start, goal in zip(places, places, strict=False)]
    paths = [one.path for one in planned(HierarchicalPlanner, tiled, *requests) if one.path is not None]
    return [path for path in paths if path.length > 20.0]


@pytest.mark.parametrize(("piece", "median", "worst"), [(16.0, 1.02, 1.1), (64.0, 1.005, 1.1), (1024.0, 1.002, 1.005)])
def test_refined_paths_cost_less_than_the_plans_and_about_what_they_cost_on_the_whole_mesh(
    tiled, whole_hills, monkeypatch, piece, median, worst
):
    """Over several tiles of 12 m and pieces of 8, 32 m, and one of 512 m."""
    monkeypatch.setattr(path_refiner, "PIECE", piece)
    ratios = []
    for path in long_plans(tiled, whole_hills, 3):
        ours, exact = refined(tiled, path), refined(whole_hills.map, path)
        assert ours.outcome == exact.outcome == RefinePathOutcome.SUCCESS
        for end in (0, -1):
            assert ours.path[end].distance_to(path[end]) == 0.0
        assert ours.path[-1].orientation == path[-1].orientation
        spots = whole_hills.map.locate(ours.path.positions)
        assert spots.distances.max() < 1e-6
        assert (ours.path.positions[1:] != ours.path.positions[:-1]).any(axis=1).all()
        raw, pulled, whole = (cost_on(whole_hills, one.positions) for one in (path, ours.path, exact.path))
        assert pulled < raw
        ratios.append(pulled / whole)
    assert len(ratios) > 3 and max(ratios) < worst and np.median(ratios) < median


def test_a_refined_path_keeps_away_from_what_sensors_have_seen(tiled_hills, whole_hills, way):
    tiled = sensing_map(tiled_hills)
    tiled.update(pose(way[10]), 0.0)
    (free,) = planned(HierarchicalPlanner, tiled, PlanRequest(pose(way[10]), pose(way[36])))
    tiled.insert_scan(scan(way[10], free.path.positions[8][None] + (0.0, 0.0, 0.4), 0.1))
    tiled.update(pose(way[10]), 0.1)
    (around,) = planned(HierarchicalPlanner, tiled, PlanRequest(pose(way[10]), pose(way[36])))
    pulled = refined(tiled, around.path).path
    check = tiled.point_check()
    lethal = max(check(pose(place)).state for place in pulled.positions)
    assert lethal < check(pose(free.path.positions[8])).state


def test_a_path_that_reverses_somewhere_is_left_as_a_whole_as_on_one_mesh(tiled, whole_hills, monkeypatch):
    """Not only the pieces that reverse: those that drive forward are long enough to be pieces of their own."""
    monkeypatch.setattr(path_refiner, "PIECE", 16.0)
    path = long_plans(tiled, whole_hills, 3)[0]
    back = path[-2:-20:-1]  # the end is driven once more, backward
    positions = np.concatenate([path.positions, back.positions])
    reversing = Path(positions, np.concatenate([path.orientations, back.orientations]), path.frame_id)
    ours, exact = refined(tiled, reversing), refined(whole_hills.map, reversing)
    assert ours.message == exact.message == "the path drives backward somewhere and is left as it is"
    assert ours.outcome == exact.outcome == RefinePathOutcome.SUCCESS
    assert ours.path is reversing and exact.path is reversing


def test_the_contract_of_refiners_is_kept(tiled, whole_hills):
    pulling.Parameters = StringPullingRefiner.Parameters
    path = long_plans(tiled, whole_hills, 3)[0]
    make = lambda base: MapContext(**vars(base), navigation_map=tiled)  # noqa: E731
    check_refiner(pulling, path, make_context=make)


def test_a_cancel_between_two_pieces_ends_it_with_the_path_as_it_was(tiled, whole_hills, monkeypatch):
    monkeypatch.setattr(path_refiner, "PIECE", 16.0)
    path, token, made = long_plans(tiled, whole_hills, 3)[0], CancelToken(), []

    def cancelling(*args):
        made.append(path_refiner.on_part)
        token.cancel("enough")
        return on_part(*args)

    on_part = path_refiner.on_part
    monkeypatch.setattr(path_refiner, "on_part", cancelling)
    result = refined(tiled, path, token)
    assert (result.outcome, result.message, result.path) == (RefinePathOutcome.CANCELED, "enough", path)
    assert len(made) == 1


def test_what_cannot_be_refined_is_a_map_error_that_names_the_place(tiled_hills, whole_hills, tmp_path):
    folder = shutil.copytree(tiled_hills, tmp_path / "map")
    tiled = TiledNavigationMap(TiledMap(folder))
    off = Path.from_points([(-90.0, 5.0, 0.0), (-80.0, 5.0, 0.0)])
    apart = Path.from_points([(5.0, 5.0, 0.0), (900.0, 5.0, 0.0)])
    for path, text in (
        (off, "there is no surface around it"),
        (apart, "902.7 m of the map lie around two of them, the limit"),
    ):
        result = refined(tiled, path)
        assert result.outcome == RefinePathOutcome.MAP_ERROR and result.path is path
        assert text in result.message
    path = long_plans(tiled, whole_hills, 3)[0]
    key = tuple((path.positions[-1][:2] // 12.0).astype(int))
    tiled._squares.clear()
    tile_file(folder, key).write_bytes(b"none")
    result = refined(tiled, path)
    assert result.outcome == RefinePathOutcome.MAP_ERROR and f"tile_{key[0]}_{key[1]}.npz" in result.message


def test_the_action_refines_paths_on_tiles(tiled_hills, whole_hills, tmp_path):
    start, goal = map(pose, whole_hills.free_places(2, 15))
    with LoopbackSession(start) as session:
        serve(session, tmp_path, config(tiled_hills, "refiners: [{name: pull, type: string_pulling}]\n"))
        path = session.navigator.send(GetPathGoal(goal)).wait().path
        result = session.navigator.send(RefinePathGoal(path, "pull")).wait()
    assert result.outcome == RefinePathOutcome.SUCCESS and result.refined_path.length < path.length
