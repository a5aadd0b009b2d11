"""The sensors of a scenario: lidars and cameras, proprioceptive sensors, and the localisation."""

from __future__ import annotations

import math
import zlib
from collections.abc import Sequence
from typing import Any

import numpy as np

from terrain.physics.kinematic_robot import KinematicRobot
from terrain.physics.robots import WheeledRobot
from terrain.physics.world import BulletWorld
from terrain.scenarios import scenario as model
from terrain.scenarios.faults import IMU, LOCALIZATION, ODOMETRY
from terrain.scenarios.noise import LocalizationNoise
from terrain.scenarios.world import ScenarioWorld
from terrain.sensors.lidar import Lidar, LidarModel, camera_directions, planar_directions, ring_directions
from terrain.sensors.proprioception import Imu, Localization, PoseNoise, WheelOdometry
from terrain.sensors.rays import MovingRays, RayCaster, StaticRays
from terrain.sensors.sensor import Sensor
from terrain.worlds.upright_solids import SolidRays

AnyRobot = WheeledRobot | KinematicRobot


def ray_casters(world: ScenarioWorld) -> list[RayCaster]:
    """Return what the lidars of all robots can hit in a world."""
    physics = world.physics
    casters: list[RayCaster] = [StaticRays(*physics.static_surface())]
    if physics.has_moving_bodies:
        casters.append(MovingRays(physics) if isinstance(physics, BulletWorld) else SolidRays(physics.solids))
    return casters


def make_sensors(
    sensors: tuple[model.Sensor, ...], robot: AnyRobot, casters: Sequence[RayCaster], seed: int
) -> dict[str, Lidar]:
    """Make the lidars of a robot, by name; each draws its noise from a generator of its own."""
    return {sensor.name: _lidar(sensor, robot, list(casters), seed) for sensor in sensors}


def make_proprioceptive_sensors(scenario: model.Scenario, robot: AnyRobot, seed: int) -> dict[str, Sensor[Any]]:
    """Make the proprioceptive sensors of a scenario, by name."""
    makers = {ODOMETRY: WheelOdometry, IMU: Imu}
    return {name: makers[name](robot, _generator(seed, name)) for name in model.proprioceptive_sensors(scenario)}


def make_localization(noise: LocalizationNoise, robot: AnyRobot, seed: int) -> Localization:
    """Make the localisation of a robot with the scenario's noise."""
    angles = math.radians(noise.yaw_noise), math.radians(noise.tilt_noise)
    return Localization(
        robot, _generator(seed, LOCALIZATION), PoseNoise(noise.position_noise, noise.height_noise, *angles)
    )


def _generator(seed: int, name: str) -> np.random.Generator:
    """A generator for one sensor, so that sensors do not shift each other's noise."""
    return np.random.default_rng([seed, zlib.crc32(name.encode())])


def _lidar(sensor: model.Sensor, robot: AnyRobot, casters: list[RayCaster], seed: int) -> Lidar:
    if sensor.type == "depth":
        directions = camera_directions(sensor.rays, 3 * sensor.rays // 4)
    else:
        directions = planar_directions(sensor.rays) if sensor.type == "planar" else ring_directions(rays=sensor.rays)
    scanner = LidarModel(
        robot.spec.lidar_position, directions, sensor.rate, sensor.max_range, sensor.noise, sensor.drop_out
    )
    return Lidar(robot, sensor.name, casters, scanner, _generator(seed, sensor.name))
