"""A family of floor plans drawn from a seed: rows of racks, two cross aisles, bays; with or without detours.

All members have a ring, of the first and the last aisle and the two cross aisles, on which the others drive. Outside
of the ring the aisles are bays with one mouth. Inside of it they can be driven through, or are bays as well where a
rack closes their middle: then nothing but the ring leads anywhere. Even seeds have detours, odd ones do not.

All numbers of a plan are drawn whether they are used or not, so both kinds look alike.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mbf_abstract.geometry import FloatArray, Pose
from terrain.worlds.floor_plan import FloorPlan, Rectangle
from terrain.worlds.occupancy import OccupancyGrid

FAMILY_STREAM = 4  # beside the streams of warehouse_environment
WALL = 0.2  # m
ROWS = (4, 6)  # of racks; the second number is one too many
BLOCK_LENGTH = (5.0, 8.0)  # m; of the racks along x, west, in the middle, east
RACK_DEPTH = (1.4, 1.9)  # m
AISLE_WIDTH = (2.0, 2.4)  # m
CLOSING_RACK = 1.2  # m
FROM_MOUTH = 1.4  # m; how far waypoints are from both ends of their bays, at least
ROBOTS = 5

PlanarPoint = tuple[float, float]
PlanarPose = tuple[float, float, float]


@dataclass(frozen=True)
class DrawnWorld:
    """A floor plan with start and waypoints (x, y, yaw) and the closed routes of the others [m]."""

    name: str
    plan: FloorPlan
    start: PlanarPose
    waypoints: tuple[PlanarPose, ...]
    routes: tuple[tuple[PlanarPoint, ...], ...]

    def grid(self) -> OccupancyGrid:
        """Return the floor."""
        return self.plan.draw()

    def goals(self) -> list[Pose]:
        """Return the waypoints as poses."""
        return [Pose.planar(*waypoint) for waypoint in self.waypoints]


@dataclass(frozen=True)
class Measures:
    """What is drawn, from wall to wall.

    Attributes
    ----------
    xs : tuple of float
        Begin and end [m] of the racks along x: west, in the middle, east; the cross aisles are between them.
    ys : tuple of float
        Begin of the first aisle along y [m], begin and end of each row of racks, end of the last aisle.
    """

    xs: tuple[float, ...]
    ys: tuple[float, ...]

    @property
    def racks(self) -> list[tuple[float, float]]:
        """Begin and end of each row of racks along y [m]."""
        return list(zip(self.ys[1:-1:2], self.ys[2:-1:2], strict=True))

    def aisle(self, number: int) -> float:
        """Middle of an aisle along y [m], 0 = the first one of the ring, negative numbers count from the last."""
        return 0.5 * (self.ys[::2][number] + self.ys[1::2][number])


def has_detours(seed: int) -> bool:
    """Whether the plan of a seed has detours."""
    return seed % 2 == 0


def draw_world(seed: int) -> DrawnWorld:
    """Draw the plan, the waypoints and the routes of a seed."""
    rng = np.random.default_rng([seed, FAMILY_STREAM])
    measures = _measures(rng)
    waypoints = _waypoints(measures, rng)
    mirrored = bool(rng.random() < 0.5)
    racks = _racks(measures, has_detours(seed))
    width, height = measures.xs[-1] + WALL, measures.ys[-1] + WALL
    routes = _routes(measures)
    if mirrored:
        racks = [Rectangle(width - r.x_max, r.y_min, width - r.x_min, r.y_max) for r in racks]
        waypoints = [(width - x, y, math.pi - yaw) for x, y, yaw in waypoints]
        routes = [tuple((width - x, y) for x, y in route) for route in routes]
    walls = (
        Rectangle(0.0, 0.0, width, WALL),
        Rectangle(0.0, height - WALL, width, height),
        Rectangle(0.0, 0.0, WALL, height),
        Rectangle(width - WALL, 0.0, width, height),
    )
    plan = FloorPlan((width, height), walls, (), tuple(racks), (), {})
    x, y, yaw = waypoints[-1]
    return DrawnWorld(f"plan {seed}", plan, (x, y, yaw + math.pi), tuple(waypoints), tuple(routes))


def _measures(rng: np.random.Generator) -> Measures:
    """Draw the edges, in whole cells of 5 cm."""
    rows = int(rng.integers(*ROWS))
    west, middle, east = rng.uniform(*BLOCK_LENGTH, size=3)
    first, second = rng.uniform(*AISLE_WIDTH, size=2)
    depths = rng.uniform(*RACK_DEPTH, size=rows)
    aisles = rng.uniform(*AISLE_WIDTH, size=rows + 1)
    along_y = np.empty(2 * rows + 1)
    along_y[::2], along_y[1::2] = aisles, depths
    return Measures(_edges([west, first, middle, second, east]), _edges(along_y))


def _edges(lengths: FloatArray | list[float]) -> tuple[float, ...]:
    cells = np.rint(np.asarray(lengths) / 0.05).astype(int)
    return tuple((WALL + 0.05 * np.concatenate([[0], np.cumsum(cells)])).round(2).tolist())


def _racks(measures: Measures, detours: bool) -> list[Rectangle]:
    xs, ys = measures.xs, measures.ys
    blocks = list(zip(xs[::2], xs[1::2], strict=True))
    racks = [Rectangle(begin, y0, end, y1) for begin, end in blocks for y0, y1 in measures.racks]
    if not detours:
        middle = 0.5 * (xs[2] + xs[3])
        racks.append(Rectangle(middle - 0.5 * CLOSING_RACK, ys[1], middle + 0.5 * CLOSING_RACK, ys[-2]))
    return racks


def _waypoints(measures: Measures, rng: np.random.Generator) -> list[PlanarPose]:
    """Six bays in the direction of the traffic: three in the east, then three in the west on the way back."""
    bays = range(1, len(measures.racks))  # aisles that are no part of the ring
    chosen = [bays[0], int(rng.choice(bays[1:-1])), bays[-1]]
    back = [bays[-1], int(rng.choice(bays[1:-1])), bays[0]]
    x0, x1, _, _, x4, x5 = measures.xs
    east = [(float(rng.uniform(x4 + FROM_MOUTH, x5 - FROM_MOUTH)), measures.aisle(bay), 0.0) for bay in chosen]
    west = [(float(rng.uniform(x0 + FROM_MOUTH, x1 - FROM_MOUTH)), measures.aisle(bay), math.pi) for bay in back]
    return east + west


def _routes(measures: Measures) -> list[tuple[PlanarPoint, ...]]:
    """The ring, counter-clockwise, from places at equal distances."""
    x0, x1 = (0.5 * (measures.xs[i] + measures.xs[i + 1]) for i in (1, 3))
    y0, y1 = measures.aisle(0), measures.aisle(-1)
    corners = [(x1, y0), (x1, y1), (x0, y1), (x0, y0)]
    sides = [math.dist(a, b) for a, b in zip(corners, corners[1:] + corners[:1], strict=True)]
    routes = []
    for number in range(ROBOTS):
        along, side = number / ROBOTS * sum(sides), 0
        while along >= sides[side]:
            along, side = along - sides[side], side + 1
        (ax, ay), (bx, by) = corners[side], corners[(side + 1) % 4]
        share = along / sides[side]
        begin = (ax + share * (bx - ax), ay + share * (by - ay))
        others = [corners[(side + 1 + k) % 4] for k in range(4)]
        routes.append((begin, *others[: 3 if share == 0.0 else 4]))
    return routes
