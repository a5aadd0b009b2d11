"""Things that stand in a scenario's world and are on no map: single ones, and forests of posts drawn from the seed."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from mbf_abstract.geometry import FloatArray, Pose
from mbf_abstract.parameters import ParameterModel, parameter
from terrain.physics.actors import AnyWorld
from terrain.scenarios.places import FULL_TURN, Coordinate, Interval, off_the_ground
from terrain.worlds.surface import Surface, box, cylinder, joined

DRAWS_PER_POST = 100

HeightAt = Callable[[float, float], float]
Length = Annotated[float, Field(gt=0.0, le=10_000.0)]
Size = tuple[Length, Length, Length]


class Obstacle(ParameterModel):
    """Something that stands in the world but on no map."""

    shape: Literal["box", "cylinder"] = parameter("box", "Its form.")
    x: Coordinate = parameter(..., "Position of its middle.", unit="m")
    y: Coordinate = parameter(..., "Position of its middle.", unit="m")
    yaw: float = parameter(0.0, "Heading.", unit="rad", ge=-FULL_TURN, le=FULL_TURN)
    size: Size = parameter((0.5, 0.5, 1.0), "Length, width, height; a cylinder's diameter.", unit="m")

    def holds(self, x: float, y: float) -> bool:
        """Whether a place [m] lies inside it, seen from above."""
        cosine, sine = math.cos(self.yaw), math.sin(self.yaw)
        along, across = (x - self.x) * cosine + (y - self.y) * sine, (y - self.y) * cosine - (x - self.x) * sine
        if self.shape == "cylinder":
            return math.hypot(along, across) < 0.5 * self.size[0]
        return abs(along) < 0.5 * self.size[0] and abs(across) < 0.5 * self.size[1]


class Forest(ParameterModel):
    """Posts at places drawn from the seed, each with room around it to drive through."""

    x_range: Interval = parameter(..., "Where it begins and ends along x.", unit="m")
    y_range: Interval = parameter(..., "Where it begins and ends along y.", unit="m")
    count: int = parameter(30, "Number of posts; fewer if there is no room.", ge=0, le=10_000)
    gap: float = parameter(2.0, "Least distance between the middles of two posts.", unit="m", gt=0.0, le=10_000.0)
    diameter: float = parameter(0.3, "Of a post.", unit="m", gt=0.0, le=10_000.0)
    height: float = parameter(1.5, "Of a post.", unit="m", gt=0.0, le=10_000.0)

    def posts(
        self, rng: np.random.Generator, keep_clear: FloatArray, height_at: HeightAt = lambda x, y: 0.0
    ) -> list[Obstacle]:
        """Draw the posts, none nearer than the gap to the places ``keep_clear`` (n, 2) [m] or to another post.

        Where ``height_at`` is not finite there is no ground to stand on.
        """
        taken = [tuple(place) for place in keep_clear.tolist()]
        posts: list[Obstacle] = []
        for _ in range(DRAWS_PER_POST * self.count):
            x, y = float(rng.uniform(*self.x_range)), float(rng.uniform(*self.y_range))
            if len(posts) == self.count:
                break
            if all(math.hypot(x - a, y - b) >= self.gap for a, b in taken) and math.isfinite(height_at(x, y)):
                taken.append((x, y))
                posts.append(Obstacle(shape="cylinder", x=x, y=y, size=(self.diameter, self.diameter, self.height)))
        return posts


def add_obstacles(world: AnyWorld, obstacles: Iterable[Obstacle], height_at: HeightAt) -> Surface | None:
    """Put the obstacles on the ground and return them as one surface, for pictures; ConfigError where there is none."""
    parts = []
    for number, obstacle in enumerate(obstacles):
        length, _, height = obstacle.size
        ground = height_at(obstacle.x, obstacle.y)
        if not math.isfinite(ground):
            raise off_the_ground(f"obstacles[{number}]", obstacle.x, obstacle.y)
        pose = Pose.planar(obstacle.x, obstacle.y, obstacle.yaw, ground + 0.5 * height)
        if obstacle.shape == "box":
            world.add_box(pose, obstacle.size)
            surface = box(obstacle.size)
        else:
            world.add_cylinder(pose, 0.5 * length, height)
            surface = cylinder(0.5 * length, height)
        parts.append(surface.at(pose))
    return joined(parts) if parts else None
