"""The sensors of a scenario: lidars that see the world and what stands or moves in it."""

from __future__ import annotations

import zlib

import numpy as np

from terrain import scenario as model
from terrain.ego_sensors import Localization
from terrain.rays import MovingRays, StaticRays
from terrain.robots import WheeledRobot
from terrain.scenario_faults import LOCALIZATION
from terrain.scenario_world import ScenarioWorld
from terrain.sensors import Lidar, planar_directions, ring_directions


def make_sensors(
    sensors: tuple[model.Sensor, ...], robot: WheeledRobot, world: ScenarioWorld, seed: int
) -> dict[str, Lidar]:
    """Make the lidars of a scenario, by name; each draws its noise from a generator of its own."""
    casters: list[StaticRays | MovingRays] = [StaticRays(*world.bullet.static_triangles())]
    if world.bullet.has_moving_bodies:
        casters.append(MovingRays(world.bullet))
    return {sensor.name: _lidar(sensor, robot, casters, seed) for sensor in sensors}


def make_localization(robot: WheeledRobot, seed: int) -> Localization:
    """Make the localisation of a robot: exact until a fault of the scenario says otherwise."""
    return Localization(robot, np.random.default_rng([seed, zlib.crc32(LOCALIZATION.encode())]))


def _lidar(sensor: model.Sensor, robot: WheeledRobot, casters: list[StaticRays | MovingRays], seed: int) -> Lidar:
    directions = planar_directions(sensor.rays) if sensor.type == "planar" else ring_directions(rays=sensor.rays)
    return Lidar(
        robot,
        sensor.name,
        casters,
        robot.spec.lidar_position,
        directions,
        sensor.rate,
        np.random.default_rng([seed, zlib.crc32(sensor.name.encode())]),
        max_range=sensor.max_range,
        noise=sensor.noise,
        drop_out=sensor.drop_out,
    )
