"""Speed of simulated worlds: how much faster than real time a run is, and our rays against Bullet's and Embree's.

    python benchmarks/simulation_speed.py [--quick] [--json]

A Husky-sized robot drives straight over the Jacksboro hills with a 16-ring lidar at 10 Hz (the kinematic one: without
lidar, as in sweeps); figures are seconds of
simulated time per second of CPU time of this process, so they are of one core. The peer of the lidar is Bullet's own
``rayTestBatch`` in the same world in the same run. ``--json`` prints the figures as last line.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from collections.abc import Callable

import numpy as np

from mbf_abstract.geometry import Twist
from mbf_abstract.time.program_end import interruptible
from terrain.physics.kinematic_robot import KinematicRobot
from terrain.physics.kinematic_world import KinematicWorld
from terrain.physics.protocols import SimulatedRobot, SimulatedWorld
from terrain.physics.robot_models import HUSKY
from terrain.physics.robots import WheeledRobot
from terrain.physics.simulation import Simulation
from terrain.physics.world import STATIC, BulletWorld
from terrain.sensors.lidar import Lidar, LidarModel, ring_directions
from terrain.sensors.rays import StaticRays
from terrain.worlds.elevation_files import jacksboro
from terrain.worlds.heightfield import Heightfield

LIMITS = {"outdoor_realtime_factor": 10.0, "rays_over_bullet": 2.0}
RANGE = 20.0


def cpu_seconds(work: Callable[[], object]) -> float:
    started = time.process_time()
    work()
    return time.process_time() - started


def ring_lidar(robot: SimulatedRobot, rays: StaticRays) -> Lidar:
    model = LidarModel(HUSKY.lidar_position, ring_directions(), 10.0, RANGE)
    return Lidar(robot, "lidar", [rays], model, np.random.default_rng(0))


def realtime_factor(world: SimulatedWorld, robot: SimulatedRobot, sensors: dict[str, Lidar], seconds: float) -> float:
    """Simulated seconds per CPU second of a straight drive."""
    simulation = Simulation(world, robot, sensors)
    robot.send_command(Twist.planar(0.8))
    return seconds / cpu_seconds(lambda: simulation.advance_to(seconds))


def embree_distances(terrain: Heightfield, origins: np.ndarray, directions: np.ndarray) -> Callable[[], object]:
    """Embree's answer to the same rays (float32, and other last digits on other CPUs)."""
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene

    vertices, faces = terrain.surface()
    scene, middle = EmbreeScene(), vertices.mean(axis=0)
    TriangleMesh(scene, (vertices - middle).astype(np.float32), faces.astype(np.int32))
    starts, aims = (origins - middle).astype(np.float32), directions.astype(np.float32)
    return lambda: scene.run(starts, aims, query="DISTANCE")


def ray_ratios(terrain: Heightfield, rays: StaticRays, scans: int) -> tuple[float, float, float]:
    """Our thousand rays per CPU second, how many times Bullet's they are, and which share of Embree's."""
    directions = ring_directions()
    x, y = (0.5 * (low + high) for low, high in ((terrain.x0, terrain.x_max), (terrain.y0, terrain.y_max)))
    origins = np.tile([x, y, float(terrain.height_at(x, y)) + 1.0], (len(directions), 1))
    with BulletWorld() as world:
        world.add_mesh(*terrain.surface())
        bullet = cpu_seconds(
            lambda: [world.cast_rays(origins, origins + RANGE * directions, STATIC) for _ in range(scans)]
        )
    cast_by_embree = embree_distances(terrain, origins, directions)
    cast_by_embree()  # its tree built
    embree = cpu_seconds(lambda: [cast_by_embree() for _ in range(scans)])
    rays.distances(origins, directions, RANGE)  # compiled
    ours = cpu_seconds(lambda: [rays.distances(origins, directions, RANGE) for _ in range(scans)])
    return scans * len(directions) / ours / 1e3, bullet / ours, embree / ours


def measure(seconds: float, scans: int) -> dict[str, float]:
    terrain = jacksboro(100.0, spacing=0.3, roughness=0.015, rng=np.random.default_rng(0))
    rays = StaticRays(*terrain.surface())
    start = terrain.pose_at(20.0, 20.0, 0.8)
    with BulletWorld() as world:
        world.add_heightfield(terrain)
        wheels = WheeledRobot(world, HUSKY, start, command_timeout=math.inf)
        wheels.settle()
        outdoor = realtime_factor(world, wheels, {"lidar": ring_lidar(wheels, rays)}, seconds)
    plain = KinematicWorld(terrain)
    kinematic = realtime_factor(plain, KinematicRobot(plain, HUSKY, start, command_timeout=math.inf), {}, seconds)
    kilo_rays, over_bullet, over_embree = ray_ratios(terrain, rays, scans)
    return {
        "outdoor_realtime_factor": round(outdoor, 2),
        "kinematic_realtime_factor": round(kinematic, 2),
        "kilorays_per_second": round(kilo_rays, 1),
        "rays_over_bullet": round(over_bullet, 2),
        "rays_over_embree": round(over_embree, 2),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="10 s of driving instead of 60")
    parser.add_argument("--json", action="store_true", help="print the figures as last line")
    options = parser.parse_args()
    figures = measure(10.0 if options.quick else 60.0, 10 if options.quick else 50)
    for name, value in figures.items():
        limit = LIMITS.get(name)
        verdict = "" if limit is None else f"  (at least {limit:g}: {'met' if value >= limit else 'MISSED'})"
        print(f"{name:28s} {value:10.2f}{verdict}")
    if options.json:
        print(json.dumps({"benchmark": "simulation_speed", **figures, "limits": LIMITS}))


if __name__ == "__main__":
    with interruptible():
        main()
