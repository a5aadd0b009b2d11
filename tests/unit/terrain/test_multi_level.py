"""The garage and the bridge: one connected clean surface, several heights at one place, and a robot that climbs."""

import math

import numpy as np
import pytest
import trimesh

from mbf_abstract.geometry import Twist, normalize_angle
from terrain.physics.robot_models import HUSKY
from terrain.physics.robots import WheeledRobot
from terrain.physics.simulation import Simulation
from terrain.physics.world import BulletWorld
from terrain.worlds.multi_level import MultiLevelWorld, bridge_over_road, parking_garage

MULTI_LEVEL_WORLDS = {"garage": parking_garage, "bridge": bridge_over_road}


def ground_of(world: MultiLevelWorld) -> trimesh.Trimesh:
    return trimesh.Trimesh(world.ground.vertices, world.ground.faces, process=False)


@pytest.mark.parametrize("name", sorted(MULTI_LEVEL_WORLDS))
def test_the_ground_is_one_manifold_piece_that_looks_up(name: str) -> None:
    ground = ground_of(MULTI_LEVEL_WORLDS[name]())
    edges = np.sort(ground.edges, axis=1)
    _, uses = np.unique(edges, axis=0, return_counts=True)
    assert uses.max() == 2
    assert len(trimesh.graph.connected_components(ground.face_adjacency, nodes=np.arange(len(ground.faces)))) == 1
    assert (ground.face_normals[:, 2] > 0.0).all() and len(np.unique(ground.faces)) == len(ground.vertices)


@pytest.mark.parametrize("name", sorted(MULTI_LEVEL_WORLDS))
def test_named_places_lie_on_the_ground_away_from_walls(name: str) -> None:
    world = MULTI_LEVEL_WORLDS[name]()
    for place in world.places.values():
        assert trimesh.proximity.closest_point(ground_of(world), [place.position])[1][0] < 1e-9
    walls = trimesh.Trimesh(world.walls.vertices, world.walls.faces, process=False)
    _, distances, _ = trimesh.proximity.closest_point(walls, [place.position for place in world.places.values()])
    assert distances.min() > 0.9 * HUSKY.circumscribed_radius


def test_bridge_and_road_are_two_heights_at_one_place() -> None:
    world = MULTI_LEVEL_WORLDS["bridge"]()
    deck, road = world.places["deck"], world.places["road"]
    assert (deck.x, deck.y) == (road.x, road.y) and deck.z - road.z == pytest.approx(2.5)


def test_the_garage_has_a_floor_per_level_and_refuses_less_than_two() -> None:
    garage = parking_garage(4)
    assert [garage.places[name].z for name in ("entrance", "level_1", "level_2", "roof")] == pytest.approx(
        [0.0, 2.8, 5.6, 8.4]
    )
    with pytest.raises(ValueError, match="at least 2"):
        parking_garage(1)


def test_the_husky_drives_up_the_first_ramp_of_the_garage() -> None:
    garage, route = parking_garage(), [(6.0, 4.0), (7.5, 2.5), (29.5, 2.5), (31.0, 6.0)]
    with BulletWorld(time_step=1.0 / 120.0) as world:
        garage.add_to(world)
        robot = WheeledRobot(world, HUSKY, garage.places["entrance"])
        robot.settle()
        simulation = Simulation(world, robot)
        while route and simulation.time < 90.0:
            pose = robot.pose()
            x, y = route[0]
            if math.hypot(x - pose.x, y - pose.y) < 0.5:
                route.pop(0)
                continue
            error = normalize_angle(math.atan2(y - pose.y, x - pose.x) - pose.yaw)
            robot.send_command(Twist.planar(1.0 if abs(error) < 0.5 else 0.1, 0.0, max(-1.0, min(1.0, 2.0 * error))))
            simulation.advance_to(simulation.time + 0.05)
        assert not route and robot.pose().z == pytest.approx(2.8, abs=0.02)
        assert simulation.incidents == [] and simulation.monitor.max_pitch == pytest.approx(math.radians(8.0), abs=0.03)
