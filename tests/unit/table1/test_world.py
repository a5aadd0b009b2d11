"""The world that ships is what the protocol asks for."""

import math
from itertools import pairwise

import numpy as np
from scipy import ndimage

from terrain.experiments.table1.environments.traffic import CARRIER, HALF_WIDTH, make_traffic
from terrain.experiments.table1.environments.world import load_world


def test_the_warehouse_is_thirty_metres_square_with_cells_of_five_centimetres():
    grid = load_world().grid()
    assert grid.resolution == 0.05
    assert grid.occupied.shape == (600, 600)


def test_six_waypoints_and_the_start_are_free_for_a_robot_that_turns():
    world = load_world()
    grid = world.grid()
    clearance = ndimage.distance_transform_edt(~grid.occupied) * grid.resolution
    assert len(world.waypoints) == 6
    for x, y, _ in (world.start, *world.waypoints):
        assert clearance[int(y / 0.05), int(x / 0.05)] > CARRIER.circumscribed_radius + 0.1


def test_the_waypoint_sequence_is_closed():
    world = load_world()
    assert math.dist(world.start[:2], world.waypoints[-1][:2]) < 0.1


def test_no_route_leads_through_a_rack():
    world = load_world()
    grid = world.grid()
    free = ndimage.distance_transform_edt(~grid.occupied) * grid.resolution > HALF_WIDTH
    for route in world.routes:
        for a, b in pairwise([*route, route[0]]):
            points = np.linspace(a, b, 200)
            assert free[(points[:, 1] / 0.05).astype(int), (points[:, 0] / 0.05).astype(int)].all()


def test_ten_robots_start_clear_of_each_other_whatever_the_seed():
    world = load_world()
    for seed in range(20):
        boxes = [shuttle.box for shuttle in make_traffic(world.routes, 10, True, np.random.default_rng(seed))]
        assert not any(a.overlaps(b) for i, a in enumerate(boxes) for b in boxes[:i])
