"""The moving evaluation: a small robot crosses a hall and comes back, among people on routes of their own.

The hall, 16 x 10 m with four pillars, is on the map; the people are not. A seed and a level draw how they walk: from
two people at level 0 to eleven at level 9, every third of them fast. In one part they yield as people do, in the other
one the same people walk the same routes and look at nothing. The robot is a TurtleBot with exact localisation and a
planar lidar. Among people who yield it is kinematic; blind ones push it, which takes physics.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from mbf_abstract.geometry import FloatArray
from mbf_abstract.geometry.arithmetic import norm
from terrain.experiments.evaluation.indoor import always
from terrain.experiments.evaluation.protocol import Protocol, Trial, read_entries
from terrain.physics.actors import closed_route
from terrain.scenarios.actors import Walker, random_route
from terrain.scenarios.limits import Limits
from terrain.scenarios.robots import Sensor
from terrain.scenarios.scenario import PlanarPose, Scenario
from terrain.scenarios.world_types import MapWorld
from terrain.worlds.occupancy import OccupancyGrid, read_occupancy

PARTS = ("yielding", "blind")
LEVELS = 10
FEWEST = 2  # people of level 0; each level has one more
SLOW, FAST = 0.7, 1.1  # m/s
START, FAR = (1.5, 5.0), (14.5, 5.0)  # m
APART = 2.0  # m; nobody begins nearer to the robot
TOLERANCE = 0.2  # m, of the goals, as in the configurations
PUSHING = {"physics": "bullet", "physics_rate": 120.0}  # kinematic people walk through a robot that stands
TIME_LIMIT = 150.0  # s, of the way there and back
STREAM = 7331  # of the routes, so that nothing else draws the same numbers
FOLDER = Path(__file__).parent / "config"
HALL = FOLDER / "hall.yaml"
CONFIGS = {name: FOLDER / f"moving_{name}.yaml" for name in ("mesh", "costmap")}
SUCCESS = "the verdict of mbf run: in truth at both goals, nothing and nobody touched while the robot moved, in time"
ABOUT = {
    "yielding": "people who yield, in ten levels of density",
    "blind": "people who look at nothing and push what is in their way, in ten levels of density",
}


def moving(seeds: Sequence[int], levels: Sequence[int] = range(LEVELS), people: str = PARTS[0]) -> Protocol:
    """Return version 1: these levels with every seed.

    Parameters
    ----------
    people : str
        Which part: people who yield, or blind ones, see ``PARTS``. Each part has a hash and a table of its own.
    """
    grid = read_occupancy(HALL)
    return Protocol(
        "moving",
        "v1",
        f"A TurtleBot with a lidar and a map crosses a hall of 16 x 10 m and comes back, among {ABOUT[people]}.",
        "costmap",
        [Trial(hall(level, seed, people, grid), seed) for seed in seeds for level in levels],
        {"success": SUCCESS, "tolerance": TOLERANCE},
        always,
        read_entries(FOLDER / "moving_entries.yaml"),
        people,
    )


def hall(level: int, seed: int, people: str, grid: OccupancyGrid) -> Scenario:
    """Return the hall with the people of a level from 0 to 9 that a seed draws."""
    (x, y), (far, across) = START, FAR
    is_blind = people == "blind"
    scenario = Scenario(
        name=f"level {level}, {people}",
        proves="A robot touches nobody, and arrives.",
        backend="costmap",
        navigation=CONFIGS,
        world=MapWorld(type="map", file=HALL),
        robot="turtlebot",
        start=PlanarPose(x=x, y=y, yaw=0.0),
        goals=(PlanarPose(x=far, y=across, yaw=0.0), PlanarPose(x=x, y=y, yaw=0.0)),
        sensors=(Sensor(name="lidar", type="planar", rate=10.0, rays=360, max_range=8.0),),
        actors=tuple(draw_walkers(level, seed, is_blind, grid)),
        physics="kinematic",
        time_limit=TIME_LIMIT,
        limits=Limits(goal_distance=TOLERANCE),  # and not the tolerance that an entrant may set
    )
    return scenario.model_copy(update=PUSHING) if is_blind else scenario


def draw_walkers(level: int, seed: int, blind: bool, grid: OccupancyGrid) -> list[Walker]:
    """Return the people of a level; the same routes for the same level and seed, whether they look or not."""
    rng = np.random.default_rng([seed, level, STREAM])
    walkers: list[Walker] = []
    while len(walkers) < FEWEST + level:
        route = np.round(random_route(grid, rng), 3)
        along = round(float(rng.uniform(0.0, 20.0)), 3)
        if norm(place_on(route, along) - np.array(START)) >= APART:
            speed = FAST if len(walkers) % 3 == 2 else SLOW
            corners = tuple((x, y) for x, y in route.tolist())
            walkers.append(Walker(type="walker", route=corners, speed=speed, start=along, blind=blind))
    return walkers


def place_on(route: FloatArray, along: float) -> FloatArray:
    """Return the point (2,) that lies ``along`` [m] a closed route (n, 2), after as many rounds as it takes."""
    corners = closed_route(route)[:, :2]
    ends = np.concatenate([[0.0], np.cumsum(norm(np.diff(corners, axis=0)))])
    return np.array([np.interp(along % ends[-1], ends, corners[:, axis]) for axis in (0, 1)])
