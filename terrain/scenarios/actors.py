"""What moves by itself in a scenario: walkers and other robots on routes, a crowd on drawn routes, sliding doors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from mbf_abstract.geometry import FloatArray, Pose
from mbf_abstract.parameters import ParameterModel, parameter
from terrain.physics.actors import (
    PERSON_HEIGHT,
    PERSON_RADIUS,
    Body,
    RouteWalker,
    SlidingDoor,
    other_robot,
    random_route,
)
from terrain.physics.robot_models import ROBOTS
from terrain.scenarios.places import PlanarPose
from terrain.scenarios.world import ScenarioWorld
from terrain.worlds.occupancy import OccupancyGrid


class Walker(ParameterModel):
    """A person who walks a closed route without end."""

    type: Literal["walker"]
    route: tuple[tuple[float, float], ...] = parameter(..., "Corners; the last leg leads back to the first.", unit="m")
    speed: float = parameter(0.8, "Walking speed.", unit="m/s", ge=0.0, le=5.0)
    start: float = parameter(0.0, "How far along the route it starts.", unit="m", ge=0.0)
    radius: float = parameter(PERSON_RADIUS, "Of the upright cylinder it is.", unit="m", gt=0.0)
    height: float = parameter(PERSON_HEIGHT, "Of the upright cylinder it is.", unit="m", gt=0.0)
    gives_way: bool = parameter(False, "Wait while the robot is just ahead, instead of pushing it.")


class OtherRobot(ParameterModel):
    """Another robot that drives a closed route without end."""

    type: Literal["robot"]
    model: Literal["husky", "turtlebot", "car"] = parameter("turtlebot", "Its size and looks.")
    route: tuple[tuple[float, float], ...] = parameter(..., "Corners; the last leg leads back to the first.", unit="m")
    speed: float = parameter(0.5, "Speed.", unit="m/s", ge=0.0, le=5.0)
    start: float = parameter(0.0, "How far along the route it starts.", unit="m", ge=0.0)
    gives_way: bool = parameter(False, "Wait while the robot is just ahead, instead of pushing it.")


class Crowd(ParameterModel):
    """Several people on routes of their own, drawn from the seed between the walls of a building."""

    type: Literal["crowd"]
    count: int = parameter(4, "Number of people.", ge=0, le=200)
    speed: float = parameter(0.6, "Walking speed.", unit="m/s", ge=0.0, le=5.0)
    x_range: tuple[float, float] | None = parameter(None, "Part of the building where they walk.", unit="m")
    y_range: tuple[float, float] | None = parameter(None, "Part of the building where they walk.", unit="m")
    gives_way: bool = parameter(False, "Wait while the robot is just ahead, instead of pushing it.")


class Door(ParameterModel):
    """A leaf that slides shut at a given time."""

    type: Literal["door"]
    opened: PlanarPose = parameter(..., "Middle of the leaf while it is open.")
    closed: PlanarPose = parameter(..., "Middle of the leaf when it is closed.")
    size: tuple[float, float, float] = parameter((1.0, 0.1, 2.0), "Length, thickness, height.", unit="m")
    closes_at: float = parameter(..., "When it starts to close.", unit="s", ge=0.0)
    duration: float = parameter(2.0, "How long it takes to close.", unit="s", gt=0.0)


Actor = Annotated[Walker | OtherRobot | Crowd | Door, Field(discriminator="type")]


def add_actors(
    world: ScenarioWorld, actors: Sequence[Walker | OtherRobot | Crowd | Door], rng: np.random.Generator
) -> None:
    """Put the actors of a scenario into its world and its list; routes of crowds come from ``rng``."""
    for actor in actors:
        if isinstance(actor, Crowd):
            world.actors.extend(_crowd(world, actor, rng))
        elif isinstance(actor, Door):
            opened, closed = (_leaf_pose(world, place, actor.size[2]) for place in (actor.opened, actor.closed))
            world.actors.append(SlidingDoor(world.physics, opened, closed, actor.size, actor.closes_at, actor.duration))
        else:
            route = np.array([(x, y, world.height_at(x, y)) for x, y in actor.route])
            world.actors.append(_on_route(world, actor, route))


def _on_route(world: ScenarioWorld, actor: Walker | OtherRobot, route: FloatArray) -> RouteWalker:
    if isinstance(actor, OtherRobot):
        return other_robot(world.physics, ROBOTS[actor.model], route, actor.speed, actor.start, actor.gives_way)
    body = Body((actor.radius, actor.height))
    return RouteWalker(world.physics, route, actor.speed, actor.start, body, actor.gives_way)


def _crowd(world: ScenarioWorld, crowd: Crowd, rng: np.random.Generator) -> list[RouteWalker]:
    if world.grid is None:
        raise ValueError("a crowd needs a world with a 2D map to draw its routes on")
    grid = _part_of(world.grid, crowd)
    return [
        RouteWalker(
            world.physics,
            random_route(grid, rng),
            crowd.speed,
            float(rng.uniform(0.0, 20.0)),
            gives_way=crowd.gives_way,
        )
        for _ in range(crowd.count)
    ]


def _part_of(grid: OccupancyGrid, crowd: Crowd) -> OccupancyGrid:
    """The same map with everything outside the crowd's part not free."""
    ny, nx = grid.free.shape
    x = grid.origin_x + (np.arange(nx) + 0.5) * grid.resolution
    y = grid.origin_y + (np.arange(ny) + 0.5) * grid.resolution
    x_min, x_max = crowd.x_range or (-np.inf, np.inf)
    y_min, y_max = crowd.y_range or (-np.inf, np.inf)
    inside = ((y >= y_min) & (y <= y_max))[:, None] & ((x >= x_min) & (x <= x_max))[None, :]
    return OccupancyGrid(grid.occupied, grid.free & inside, grid.resolution, grid.origin_x, grid.origin_y)


def _leaf_pose(world: ScenarioWorld, place: PlanarPose, height: float) -> Pose:
    return Pose.planar(place.x, place.y, place.yaw, world.height_at(place.x, place.y) + 0.5 * height)
