"""The indoor evaluation: a small robot crosses rooms full of posts that it sees by its lidar alone, in ten levels.

In the spirit of the BARN challenge (Perille et al., Benchmarking Metric Ground Navigation, 2020), with worlds of our
own: cells of a grid are filled at random, smoothed by one step of a cellular automaton, and become posts. A room is
drawn again until a disc with ``CLEARANCE`` to spare gets through, so every one has a route. The robot is a kinematic
TurtleBot with exact localisation and no map.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import cKDTree

from mbf_abstract.geometry import FloatArray
from terrain.experiments.evaluation.protocol import Protocol, Trial, read_entries
from terrain.scenarios.limits import Limits
from terrain.scenarios.obstacles import Obstacle
from terrain.scenarios.robots import Sensor
from terrain.scenarios.scenario import PlanarPose, Scenario
from terrain.scenarios.world_types import GeneratedWorld

CELL = 0.3  # m; a post fills a cell
COLUMNS, ROWS = 26, 16
LENGTH, WIDTH = CELL * COLUMNS, CELL * ROWS  # m, of the part with posts
BEFORE = 1.5  # m of free floor before and behind it
WALL = 0.2  # m
MARGIN = 1.0  # m of floor outside of the walls
POST_HEIGHT = 1.0  # m
LEVELS = 10
SPARSE, DENSE = 0.06, 0.24  # share of filled cells of the first and of the last level
ROBOT_RADIUS, CLEARANCE = 0.18, 0.1  # m
RESOLUTION = 0.05  # m, of the search for a route
TOLERANCE = 0.3  # m, of the goal, as in the configurations
TIME_LIMIT = 100.0  # s
STREAM = 4019  # of the posts, so that nothing else draws the same numbers
FOLDER = Path(__file__).parent / "config"
CONFIGS = {name: FOLDER / f"indoor_{name}.yaml" for name in ("mesh", "costmap")}
SUCCESS = "the verdict of mbf run: in truth at the goal, nothing touched while the robot moved, in time"

Cells = NDArray[np.bool_]


def indoor(seeds: Sequence[int], levels: Sequence[int] = range(LEVELS)) -> Protocol:
    """Return version 1: these levels with every seed."""
    return Protocol(
        "indoor",
        "v1",
        "A TurtleBot with a lidar and no map crosses rooms of 10.8 x 4.8 m full of posts, in ten levels of density.",
        "costmap",
        [Trial(room(level, seed), seed) for seed in seeds for level in levels],
        {"success": SUCCESS, "radius": ROBOT_RADIUS, "clearance": CLEARANCE},
        always,
        read_entries(FOLDER / "indoor_entries.yaml"),
    )


def always(scenario: Scenario, seed: int) -> bool:
    """The judge: rooms without a route are not drawn."""
    return True


def room(level: int, seed: int) -> Scenario:
    """Return the room of a level from 0 to 9 that a seed draws; its posts begin at x = y = 0."""
    posts = draw_posts(level, seed)
    middle, far = 0.5 * WIDTH, LENGTH + BEFORE
    return Scenario(
        name=f"level {level}",
        proves="A robot finds its way among posts that are on no map.",
        backend="costmap",
        navigation=CONFIGS,
        world=GeneratedWorld(type="generated", size=floor_size(), spacing=0.1),
        robot="turtlebot",
        start=_at(-0.5 * BEFORE, middle),
        goals=(_at(far - 0.5 * BEFORE, middle),),
        sensors=(Sensor(name="lidar", type="planar", rate=10.0, rays=360, max_range=8.0),),
        obstacles=tuple([*walls(), *(_post(x, y) for x, y in posts.tolist())]),
        physics="kinematic",
        time_limit=TIME_LIMIT,
        limits=Limits(goal_distance=TOLERANCE),  # and not the tolerance that an entrant may set
    )


def floor_size() -> tuple[float, float]:
    """Length and width [m] of the floor with its margins."""
    return LENGTH + 2.0 * (BEFORE + MARGIN), WIDTH + 2.0 * MARGIN


def _at(x: float, y: float) -> PlanarPose:
    """A pose along x; worlds begin at 0, the posts of a room after margin and free floor."""
    return PlanarPose(x=round(x + BEFORE + MARGIN, 3), y=round(y + MARGIN, 3), yaw=0.0)


def _post(x: float, y: float) -> Obstacle:
    at = _at(x, y)
    return Obstacle(shape="cylinder", x=at.x, y=at.y, size=(CELL, CELL, POST_HEIGHT))


def walls() -> list[Obstacle]:
    """Return the four walls around a room, on no map either."""
    length, centre = LENGTH + 2.0 * (BEFORE + WALL), 0.5 * LENGTH
    places = [(centre, -0.5 * WALL, length, WALL), (centre, WIDTH + 0.5 * WALL, length, WALL)]
    places += [(x, 0.5 * WIDTH, WALL, WIDTH) for x in (-BEFORE - 0.5 * WALL, LENGTH + BEFORE + 0.5 * WALL)]
    found = []
    for x, y, along, across in places:
        at = _at(x, y)
        found.append(Obstacle(shape="box", x=at.x, y=at.y, size=(along, across, POST_HEIGHT)))
    return found


def draw_posts(level: int, seed: int) -> FloatArray:
    """Return the centres (n, 2) [m] of a room's posts; the same for the same level and seed."""
    rng = np.random.default_rng([seed, level, STREAM])
    share = SPARSE + (DENSE - SPARSE) * level / (LEVELS - 1)
    while True:
        rows, columns = np.nonzero(_smoothed(rng.random((ROWS, COLUMNS)) < share))
        posts = np.column_stack([columns + 0.5, rows + 0.5]) * CELL
        if has_passage(posts, ROBOT_RADIUS + CLEARANCE):
            return posts


def _smoothed(filled: Cells) -> Cells:
    """Single cells become free, and those that five or more of eight neighbours surround are filled."""
    around = ndimage.convolve(filled.astype(np.int64), np.ones((3, 3), np.int64), mode="constant") - filled
    return np.asarray((filled & (around >= 1)) | (around >= 5))


def has_passage(posts: FloatArray, radius: float) -> bool:
    """Whether a disc of this radius [m] gets from start to goal between posts (n, 2) and walls."""
    x = np.arange(-BEFORE, LENGTH + BEFORE, RESOLUTION) + 0.5 * RESOLUTION
    y = np.arange(0.0, WIDTH, RESOLUTION) + 0.5 * RESOLUTION
    places = np.stack(np.meshgrid(x, y), axis=-1)
    free = (places[..., 1] >= radius) & (places[..., 1] <= WIDTH - radius)
    if len(posts):
        distances, _ = cKDTree(posts).query(places)
        free &= distances >= radius + 0.5 * CELL
    parts, _ = ndimage.label(free, np.ones((3, 3)))
    row, ends = len(y) // 2, [round(0.5 * BEFORE / RESOLUTION), len(x) - 1 - round(0.5 * BEFORE / RESOLUTION)]
    start, goal = parts[row, ends].tolist()
    return bool(start == goal != 0)
