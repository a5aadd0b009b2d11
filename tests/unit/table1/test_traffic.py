"""The other robots: their routes, their manners, and what a lidar sees of them."""

import math

import numpy as np
import pytest

from terrain.experiments.table1.environments.traffic import (
    DWELL,
    HALF_LENGTH,
    STOP_DISTANCE,
    Box,
    Shuttle,
    TrafficRays,
    make_traffic,
)
from terrain.experiments.table1.environments.world import load_world

STEP = 1.0 / 60.0
LINE = [(0.0, 0.0), (10.0, 0.0)]


def drive(shuttle, seconds, others=()):
    for _ in range(round(seconds / STEP)):
        shuttle.advance(STEP, others)
    return shuttle.box


def test_the_same_seed_gives_the_same_motion_and_another_seed_another():
    def places(seed):
        traffic = make_traffic(load_world().routes, 5, True, np.random.default_rng(seed))
        return [drive(shuttle, 20.0) for shuttle in traffic]

    assert places(1) == places(1)
    assert places(1) != places(2)


def test_a_robot_is_drawn_alike_however_many_others_there_are():
    routes = load_world().routes
    two, ten = (make_traffic(routes, count, True, np.random.default_rng(4)) for count in (2, 10))
    assert [s.box for s in two] == [s.box for s in ten[:2]]


def test_more_robots_than_routes_are_refused():
    with pytest.raises(ValueError, match="3 robots need as many routes"):
        make_traffic([LINE, LINE], 3, True, np.random.default_rng(0))


def test_a_shuttle_comes_back_to_where_it_started():
    shuttle = Shuttle(LINE, 0.5, 0.0)
    assert drive(shuttle, 21.0 + DWELL).x == pytest.approx(10.0, abs=0.2)
    there = drive(shuttle, 1.0 + math.pi)  # the rest of the pause, and the turn on the spot
    assert there.y == pytest.approx(0.0) and abs(there.yaw) == pytest.approx(math.pi, abs=0.1)
    assert drive(shuttle, 21.0).x == pytest.approx(0.0, abs=0.3)


def test_a_polite_robot_stops_short_of_what_is_ahead_and_goes_on_when_that_is_gone():
    shuttle, ahead = Shuttle(LINE, 0.5, 0.0), Box(5.0, 0.0, 0.0)
    gap = 5.0 - HALF_LENGTH - (drive(shuttle, 30.0, [ahead]).x + HALF_LENGTH)
    assert 0.0 < gap <= STOP_DISTANCE
    stopped = shuttle.box
    assert drive(shuttle, 10.0, [ahead]) == stopped
    assert drive(shuttle, 5.0).x > stopped.x + 1.0


def test_a_blind_robot_does_not_care():
    assert drive(Shuttle(LINE, 0.5, 0.0, polite=False), 15.0, [Box(5.0, 0.0, 0.0)]).x > 6.0


def test_what_stands_beside_the_way_does_not_stop_a_robot():
    assert drive(Shuttle(LINE, 0.5, 0.0), 15.0, [Box(5.0, 0.7, 0.0)]).x > 6.0


def test_boxes_overlap_as_points_sampled_inside_them_say():
    rng, grid = np.random.default_rng(0), np.linspace(-1.0, 1.0, 41)
    inside = np.stack(np.meshgrid(grid, grid), axis=-1).reshape(-1, 2) * (0.35, 0.25)
    for _ in range(300):
        first, second = (Box(*rng.uniform(-0.6, 0.6, 2).tolist(), float(rng.uniform(-3.1, 3.1))) for _ in range(2))
        points = inside @ rotation(first.yaw).T + (first.x - second.x, first.y - second.y)
        local = np.abs(points @ rotation(second.yaw))
        sampled = bool(((local[:, 0] <= 0.35) & (local[:, 1] <= 0.25)).any())
        assert first.overlaps(second) == second.overlaps(first)
        if sampled:
            assert first.overlaps(second)
        elif first.overlaps(second):  # a corner that slipped between two samples: a little smaller, they do not touch
            smaller = Box(second.x, second.y, second.yaw, 0.32, 0.22)
            assert not first.overlaps(smaller)


def rotation(angle):
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s], [s, c]])


def test_rays_meet_the_nearest_side_of_a_robot():
    shuttle = Shuttle([(3.0, 0.0), (3.0, 5.0)], 0.5, 0.0)  # looks along y: 0.25 m to each side in x
    origins = np.tile([0.0, 0.0, 0.3], (3, 1))
    directions = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    found = TrafficRays([shuttle]).distances(origins, directions, 8.0)
    assert found == pytest.approx([2.75, math.inf, math.inf])
    assert TrafficRays([shuttle]).distances(origins, directions, 2.0)[0] == math.inf
