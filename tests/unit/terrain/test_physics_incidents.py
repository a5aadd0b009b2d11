"""What the monitor counts really happens in the physics: tipping over, high-centring, getting stuck."""

import math

import numpy as np

from mbf_abstract.geometry import Twist
from terrain.physics.incidents import IncidentKind
from terrain.physics.robot_models import HUSKY
from terrain.physics.robots import WheeledRobot
from terrain.physics.simulation import Simulation
from terrain.physics.world import BulletWorld
from terrain.worlds.generate import flat_terrain
from terrain.worlds.heightfield import Heightfield


def drive_along_x(terrain: Heightfield, command: Twist, seconds: float) -> Simulation:
    with BulletWorld(time_step=1.0 / 120.0) as world:
        world.add_heightfield(terrain)
        robot = WheeledRobot(world, HUSKY, terrain.pose_at(1.5, 3.0), command_timeout=math.inf)
        robot.settle()
        simulation = Simulation(world, robot)
        robot.send_command(command)
        simulation.advance_to(seconds)
    return simulation


def ground() -> tuple[Heightfield, np.ndarray, np.ndarray]:
    flat = flat_terrain(8.0, 6.0, 0.1)
    x, y = np.meshgrid(np.arange(flat.nx) * flat.dx, np.arange(flat.ny) * flat.dy)
    return flat, x, y


def test_a_ramp_under_the_left_wheels_tips_the_robot_over() -> None:
    flat, x, y = ground()
    simulation = drive_along_x(
        flat.with_heights(np.where(y > 3.1, np.clip(0.7 * (x - 3.0), 0.0, 1.0), 0.0)), Twist.planar(0.8), 5.0
    )
    assert simulation.monitor.counts[IncidentKind.TIPPED_OVER] == 1 and simulation.monitor.max_roll > math.radians(60.0)


def test_a_rail_under_the_belly_lifts_the_wheels_and_the_robot_is_stuck() -> None:
    flat, x, y = ground()
    rail = np.where(np.abs(y - 3.0) < 0.12, np.clip(0.1 * (x - 3.0), 0.0, 0.3), 0.0)
    simulation = drive_along_x(flat.with_heights(rail), Twist.planar(0.5), 12.0)
    kinds = [incident.kind for incident in simulation.incidents]
    assert kinds[-2:] == [IncidentKind.HIGH_CENTRED, IncidentKind.STUCK]
    assert IncidentKind.TIPPED_OVER not in kinds and IncidentKind.COLLISION not in kinds


def test_level_ground_is_free_of_incidents() -> None:
    flat, _, _ = ground()
    assert drive_along_x(flat, Twist.planar(0.8), 4.0).incidents == []
