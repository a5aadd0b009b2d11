"""What moves by itself in a scenario: walkers and other robots on routes, a crowd on drawn routes, sliding doors."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from scipy import ndimage

from mbf_abstract.config.findings import ConfigError, Finding
from mbf_abstract.geometry import FloatArray, Pose
from mbf_abstract.geometry.arithmetic import norm
from mbf_abstract.parameters import ParameterModel, parameter
from terrain.physics.actors import PERSON, PERSON_HEIGHT, PERSON_RADIUS, Body, RouteWalker, SlidingDoor, other_robot
from terrain.physics.people import Person
from terrain.physics.robot_models import ROBOTS
from terrain.scenarios.obstacles import Size
from terrain.scenarios.perturbation import DrawnError
from terrain.scenarios.places import Coordinate, Interval, PlanarPose, off_the_ground
from terrain.scenarios.world import ScenarioWorld
from terrain.worlds.occupancy import OccupancyGrid
from terrain.worlds.wall_clearance import Walls

Route = Annotated[tuple[tuple[Coordinate, Coordinate], ...], Field(min_length=1)]

MAX_ROUTE_DRAWS = 10_000
LONGEST_LEG = 12.0  # m; short legs of a drawn route are found sooner


class Walker(ParameterModel):
    """A person who walks a closed route without end."""

    type: Literal["walker"]
    route: Route = parameter(..., "Corners; the last leg leads back to the first.", unit="m")
    speed: float = parameter(0.8, "Walking speed.", unit="m/s", ge=0.0, le=5.0)
    start: float = parameter(0.0, "How far along the route it starts.", unit="m", ge=0.0)
    radius: float = parameter(PERSON_RADIUS, "Of the upright cylinder it is.", unit="m", gt=0.0, le=10_000.0)
    height: float = parameter(PERSON_HEIGHT, "Of the upright cylinder it is.", unit="m", gt=0.0, le=10_000.0)
    blind: bool = parameter(
        False, "Follow the route at constant speed and push what is in the way, instead of yielding as people do."
    )


class OtherRobot(ParameterModel):
    """Another robot that drives a closed route without end."""

    type: Literal["robot"]
    model: Literal["husky", "turtlebot", "car"] = parameter("turtlebot", "Its size and looks.")
    route: Route = parameter(..., "Corners; the last leg leads back to the first.", unit="m")
    speed: float = parameter(0.5, "Speed.", unit="m/s", ge=0.0, le=5.0)
    start: float = parameter(0.0, "How far along the route it starts.", unit="m", ge=0.0)
    blind: bool = parameter(False, "Push the robot that is in its way, instead of waiting while it is just ahead.")


class Crowd(ParameterModel):
    """Several people on routes of their own, drawn from the seed between the walls of a building."""

    type: Literal["crowd"]
    count: int = parameter(4, "Number of people.", ge=0, le=200)
    speed: float = parameter(0.6, "Walking speed.", unit="m/s", ge=0.0, le=5.0)
    x_range: Interval | None = parameter(None, "Part of the building where they walk.", unit="m")
    y_range: Interval | None = parameter(None, "Part of the building where they walk.", unit="m")
    blind: bool = parameter(
        False, "Follow the route at constant speed and push what is in the way, instead of yielding as people do."
    )


class Door(ParameterModel):
    """A leaf that slides shut at a given time."""

    type: Literal["door"]
    opened: PlanarPose = parameter(..., "Middle of the leaf while it is open.")
    closed: PlanarPose = parameter(..., "Middle of the leaf when it is closed.")
    size: Size = parameter((1.0, 0.1, 2.0), "Length, thickness, height.", unit="m")
    closes_at: float = parameter(..., "When it starts to close.", unit="s", ge=0.0)
    duration: float = parameter(2.0, "How long it takes to close.", unit="s", gt=0.0)


Actor = Annotated[Walker | OtherRobot | Crowd | Door, Field(discriminator="type")]


def add_actors(
    world: ScenarioWorld, actors: Sequence[Walker | OtherRobot | Crowd | Door], rng: np.random.Generator
) -> None:
    """Put the actors of a scenario into its world and its list; routes of crowds come from ``rng``.

    Raises ConfigError where an actor is off the ground or has no map to walk on, DrawnError for a route that was not
    found.
    """
    walls = None if world.grid is None else Walls(world.grid)
    for number, actor in enumerate(actors):
        key = f"actors[{number}]"
        if isinstance(actor, Crowd):
            world.actors.extend(_crowd(world, actor, walls, rng, key))
        elif isinstance(actor, Door):
            ends = {"opened": actor.opened, "closed": actor.closed}
            opened, closed = (
                Pose.planar(end.x, end.y, end.yaw, _ground(world, end.x, end.y, f"{key}.{name}") + 0.5 * actor.size[2])
                for name, end in ends.items()
            )
            world.actors.append(SlidingDoor(world.physics, opened, closed, actor.size, actor.closes_at, actor.duration))
        else:
            corners = enumerate(actor.route)
            route = np.array([(x, y, _ground(world, x, y, f"{key}.route[{corner}]")) for corner, (x, y) in corners])
            world.actors.append(_on_route(world, actor, route, walls))


def _ground(world: ScenarioWorld, x: float, y: float, key: str) -> float:
    height = world.ground_at(x, y)
    if not math.isfinite(height):
        raise off_the_ground(key, x, y)
    return height


def _on_route(
    world: ScenarioWorld, actor: Walker | OtherRobot, route: FloatArray, walls: Walls | None
) -> RouteWalker | Person:
    if isinstance(actor, OtherRobot):
        return other_robot(world.physics, ROBOTS[actor.model], route, actor.speed, actor.start, not actor.blind)
    body = Body((actor.radius, actor.height))
    return _person(world, route, actor, actor.start, walls, body)


def _person(
    world: ScenarioWorld,
    route: FloatArray,
    actor: Walker | Crowd,
    start: float,
    walls: Walls | None,
    body: Body = PERSON,
) -> RouteWalker | Person:
    if actor.blind:
        return RouteWalker(world.physics, route, actor.speed, start, body)
    return Person(world.physics, route, actor.speed, start, body, walls)


def _crowd(
    world: ScenarioWorld, crowd: Crowd, walls: Walls | None, rng: np.random.Generator, key: str
) -> list[RouteWalker | Person]:
    if world.grid is None:
        expected = "no crowd in a world without a 2D map to draw its routes on"
        raise ConfigError([Finding("scenario", 1, key, expected, f"{crowd.count} people")])
    grid = _part_of(world.grid, crowd)
    try:
        routes = [(random_route(grid, rng), float(rng.uniform(0.0, 20.0))) for _ in range(crowd.count)]
    except ValueError as error:
        raise DrawnError([Finding("scenario", 1, key, "room to walk between the walls", str(error))]) from error
    return [_person(world, route, crowd, start, walls) for route, start in routes]


def _part_of(grid: OccupancyGrid, crowd: Crowd) -> OccupancyGrid:
    """The same map with everything outside the crowd's part not free."""
    ny, nx = grid.free.shape
    x = grid.origin_x + (np.arange(nx) + 0.5) * grid.resolution
    y = grid.origin_y + (np.arange(ny) + 0.5) * grid.resolution
    x_min, x_max = crowd.x_range or (-np.inf, np.inf)
    y_min, y_max = crowd.y_range or (-np.inf, np.inf)
    inside = ((y >= y_min) & (y <= y_max))[:, None] & ((x >= x_min) & (x <= x_max))[None, :]
    return OccupancyGrid(grid.occupied, grid.free & inside, grid.resolution, grid.origin_x, grid.origin_y)


def random_route(grid: OccupancyGrid, rng: np.random.Generator, corners: int = 4, clearance: float = 0.4) -> FloatArray:
    """Draw a closed route (corners, 2) [m] through free cells, each leg straight and clear of walls.

    Parameters
    ----------
    clearance : float
        Distance kept to walls [m].

    Raises
    ------
    ValueError
        No such route was found: the map is too narrow for the clearance.
    """
    open_cells = grid.free & (ndimage.distance_transform_edt(~grid.occupied) * grid.resolution > clearance)
    cells = np.argwhere(open_cells)
    route: list[NDArray[np.intp]] = []
    for _ in range(MAX_ROUTE_DRAWS if len(cells) else 0):
        cell = cells[rng.integers(len(cells))]
        ends = [*route[-1:], cell]
        if len(route) == corners - 1:
            ends.append(route[0])
        if all(_leg_is_open(open_cells, a, b, LONGEST_LEG / grid.resolution) for a, b in pairwise(ends)):
            route.append(cell)
        if len(route) == corners:
            centres = (np.array(route, dtype=float)[:, ::-1] + 0.5) * grid.resolution
            return np.asarray(centres + np.array([grid.origin_x, grid.origin_y]))
    raise ValueError(f"no route of {corners} corners with {clearance} m to the walls")


def _leg_is_open(open_cells: NDArray[np.bool_], a: NDArray[np.intp], b: NDArray[np.intp], longest: float) -> bool:
    length = float(norm(b - a))
    if length > longest:
        return False
    points = np.rint(a + np.linspace(0.0, 1.0, 2 * math.ceil(length) + 2)[:, None] * (b - a)).astype(np.intp)
    return bool(open_cells[points[:, 0], points[:, 1]].all())
