"""People who walk a route and yield: they step aside, slow down and stop, and never walk into what stands.

The rule is that of Moussaïd, Helbing and Theraulaz (How simple rules determine pedestrian behavior and crowd disasters,
PNAS 108, 2011). A person knows how far it can walk in each direction before it meets something, if everything else
keeps its velocity. It takes the direction in which it comes nearest to where it wants to be, and walks no faster than
it can stop. Of two directions that are equally good it takes the one to the right.

A person sees the robot, other people, other robots, and the walls of a 2D map. It does not see what is behind it,
doors, nor things that are on no map.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol

import numpy as np

from mbf_abstract.geometry import FloatArray, Pose
from mbf_abstract.geometry.arithmetic import norm
from terrain.physics.actors import COURTESY, PERSON, AnyWorld, Body, closed_route
from terrain.physics.protocols import SimulatedRobot
from terrain.worlds.wall_clearance import Walls

HORIZON = 4.0  # m; how far a person looks
AHEAD = 1.5  # m; where on its route it wants to be, from where it is
CORNER = 0.3  # m; nearer than this to a corner it goes for the next one
REACTION = 0.5  # s; it could stop within this time
ACCELERATION = 1.5  # m/s^2
ELBOW_ROOM = 0.1  # m; the distance it keeps to other people and robots; to ours, that of ``COURTESY``
WALL_MARGIN = 0.05  # m; the distance it keeps to walls
PERIOD = 0.1  # s between two decisions
RIGHT_FIRST = [sign * angle for angle in range(0, 81, 10) for sign in (-1, 1)][1:]  # degrees
TURNS = [(math.cos(math.radians(angle)), math.sin(math.radians(angle))) for angle in RIGHT_FIRST]


Vector = tuple[float, float]
Circle = tuple[Vector, Vector, float]  # offset [m], velocity [m/s] and reach [m] of somebody


class Walking(Protocol):
    """What a person knows of another person or robot on its way."""

    @property
    def reach(self) -> float:
        """Radius [m] of a circle around it."""

    def pose(self) -> Pose:
        """Pose of its middle."""

    def velocity(self) -> Vector:
        """Velocity in the map [m/s]."""


def distance_to_meeting(offset: Vector, velocity: Vector, direction: Vector, speed: float, reach: float) -> float:
    """How far [m] somebody can walk before it meets a circle that keeps its velocity.

    Parameters
    ----------
    offset : (2,) float
        From the walker to the middle of the circle [m].
    velocity : (2,) float
        Of the circle [m/s].
    direction : (2,) float
        Of the walker, a unit vector.
    speed : float
        Of the walker [m/s].
    reach : float
        Distance of the middles at which they meet [m].

    Returns
    -------
    float
        0 where they are as near already and the circle is ahead, inf where they never meet or the circle is behind.
    """
    px, py = offset
    if px * direction[0] + py * direction[1] <= 0.0:
        return math.inf
    outside = px * px + py * py - reach * reach
    if outside <= 0.0:
        return 0.0
    wx, wy = speed * direction[0] - velocity[0], speed * direction[1] - velocity[1]
    closing, squared = px * wx + py * wy, wx * wx + wy * wy
    under_root = closing * closing - squared * outside
    if closing <= 0.0 or under_root < 0.0:
        return math.inf
    return speed * outside / (closing + math.sqrt(under_root))  # the nearer root, without cancellation


class Person:
    """A person who walks a closed route of straight lines and yields.

    It stands until it has met the robots, at which the run begins.

    Parameters
    ----------
    route : (n, 2) or (n, 3) float
        Corners [m]; after the last it goes back to the first. With three columns the third is the ground's height.
    speed : float
        That it likes to walk at [m/s].
    start : float
        How far along the route [m] it is at time 0.
    body : Body
        A cylinder.
    """

    def __init__(
        self,
        world: AnyWorld,
        route: FloatArray,
        speed: float,
        start: float = 0.0,
        body: Body = PERSON,
        walls: Walls | None = None,
    ) -> None:
        self._corners = closed_route(route)
        self._lengths = norm(np.diff(self._corners, axis=0))
        self._world, self._speed, self._walls, self._start = world, speed, walls, start
        self.thing, self.size, self.reach = body.thing, body.size, body.reach
        self._lift = 0.5 * body.size[-1]
        self._robots: Sequence[SimulatedRobot] = ()
        self._others: Sequence[Walking] = ()
        self._go_to_start()
        self.body, self.looks = body.put_into(world, self.pose())
        world.before_step(self._move)

    def pose(self) -> Pose:
        """Pose of its middle now; it looks where it walks."""
        along = self._along / max(float(self._lengths[self._leg]), CORNER)
        z = float(self._corners[self._leg, 2] + along * (self._corners[self._leg + 1, 2] - self._corners[self._leg, 2]))
        return Pose.planar(self._x, self._y, math.atan2(self._heading[1], self._heading[0]), z + self._lift)

    def velocity(self) -> Vector:
        """Velocity in the map [m/s]."""
        return self._pace * self._heading[0], self._pace * self._heading[1]

    def meet(self, robots: Sequence[SimulatedRobot], others: Sequence[Walking] = ()) -> None:
        """Go to the start of the route, and walk and yield from now on."""
        self._robots, self._others = robots, [other for other in others if other is not self]
        self._go_to_start()
        self._world.place_body(self.body, self.pose())

    def _go_to_start(self) -> None:
        left, self._leg = self._start % max(float(self._lengths.sum()), CORNER), 0
        while self._leg < len(self._lengths) - 1 and left >= self._lengths[self._leg]:
            left -= float(self._lengths[self._leg])
            self._leg += 1
        self._along, self._pace, self._steps = left, 0.0, 0
        self._heading = self._leg_direction()
        self._x = float(self._corners[self._leg, 0]) + left * self._heading[0]
        self._y = float(self._corners[self._leg, 1]) + left * self._heading[1]

    def _leg_direction(self) -> Vector:
        dx, dy = (self._corners[self._leg + 1, :2] - self._corners[self._leg, :2]).tolist()
        length = math.hypot(dx, dy)
        return (dx / length, dy / length) if length > 0.0 else (1.0, 0.0)

    def _move(self) -> None:
        """Decide now and then, and take a step."""
        if not self._robots or self._speed == 0.0 or not self._lengths.any():
            return
        if self._steps % max(1, round(PERIOD / self._world.time_step)) == 0:
            self._decide()
        self._steps += 1
        step = self._pace * self._world.time_step
        self._x, self._y = self._x + step * self._heading[0], self._y + step * self._heading[1]
        self._world.place_body(self.body, self.pose())

    def _decide(self) -> None:
        """Choose direction and speed: what comes nearest to the place on the route where it wants to be."""
        wx, wy = self._wish()
        circles = self._circles()
        best = (HORIZON * HORIZON, 0.0, self._heading)
        for cosine, sine in TURNS:
            direction = (wx * cosine - wy * sine, wx * sine + wy * cosine)
            free = self._free_distance(direction, circles)
            walked = min(free, HORIZON * cosine)
            left = HORIZON * HORIZON + walked * walked - 2.0 * HORIZON * walked * cosine
            if left < best[0] - 1e-9:
                best = (left, free, direction)
        _, free, self._heading = best
        self._pace = min(self._speed, free / REACTION, self._pace + ACCELERATION * PERIOD)

    def _wish(self) -> Vector:
        """Direction to the place on the route ahead of it; notes how far along the route it is."""
        for _ in self._lengths:
            ux, uy = self._leg_direction()
            x, y = self._corners[self._leg, :2].tolist()
            self._along = min(max(0.0, (self._x - x) * ux + (self._y - y) * uy), float(self._lengths[self._leg]))
            if self._along < self._lengths[self._leg] - CORNER:
                break
            self._leg, self._along = (self._leg + 1) % len(self._lengths), 0.0
        target = min(self._along + AHEAD, float(self._lengths[self._leg]))
        ux, uy = self._leg_direction()
        dx, dy = (
            self._corners[self._leg, 0] + target * ux - self._x,
            self._corners[self._leg, 1] + target * uy - self._y,
        )
        length = math.hypot(dx, dy)
        return (dx / length, dy / length) if length > 0.0 else (ux, uy)

    def _circles(self) -> list[Circle]:
        """Offset, velocity and reach of everybody who is not far away."""
        seen = []
        for robot in self._robots:
            pose, twist = robot.pose(), robot.velocity()
            c, s = math.cos(pose.yaw), math.sin(pose.yaw)
            velocity = (c * twist.vx - s * twist.vy, s * twist.vx + c * twist.vy)
            seen.append((pose, velocity, robot.spec.circumscribed_radius + COURTESY))
        seen += [(other.pose(), other.velocity(), other.reach + ELBOW_ROOM) for other in self._others]
        circles = []
        for where, its_velocity, reach in seen:
            offset, together = (where.x - self._x, where.y - self._y), reach + self.reach
            if math.hypot(*offset) < 2.0 * HORIZON + together:
                circles.append((offset, its_velocity, together))
        return circles

    def _free_distance(self, direction: Vector, circles: list[Circle]) -> float:
        free = HORIZON
        for offset, velocity, reach in circles:
            free = min(free, distance_to_meeting(offset, velocity, direction, self._speed, reach))
        if self._walls is not None and free > 0.0:
            free = self._walls.free_distance(self._x, self._y, *direction, self.reach + WALL_MARGIN, free)
        return free
