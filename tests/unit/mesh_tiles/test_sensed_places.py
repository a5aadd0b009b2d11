"""Questions about places on a map of tiles on which sensors have marked obstacles."""

import numpy as np
import pytest
from sensing_tiles import NEAR, RADIUS, SIDE, SensingWhole, above_ground, drive, scan, sensing_map
from test_tile_server import pose
from tiled_terrains import SPACING

from mbf_abstract.geometry import Path
from mbf_abstract.maps.map_queries import check_path
from mbf_abstract.maps.queries import CellState, PlaceQuery


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
