"""Things that move by themselves: people and other robots on routes, doors that close. No map shows them.

Their positions are functions of the world's time and of their parameters; only those with ``gives_way`` depend on the
robot too, and people who yield (``terrain.physics.people``). Seeds go into the routes. They are as heavy as walls: an
actor that does not give way pushes a robot aside.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mbf_abstract.geometry import FloatArray, Pose
from mbf_abstract.geometry.arithmetic import norm, rotated
from terrain.physics.kinematic_world import KinematicWorld
from terrain.physics.motion_sample import Thing
from terrain.physics.protocols import PlacedRobot, SimulatedRobot
from terrain.physics.robot_models import RobotSpec
from terrain.physics.world import BulletWorld
from terrain.recording.recorded_robot import RobotShape
from terrain.worlds.surface import Surface, box, cylinder, joined
from terrain.worlds.upright_solids import UprightSolid

AnyWorld = BulletWorld | KinematicWorld

PERSON_RADIUS: float = 0.25  # m
PERSON_HEIGHT: float = 1.7  # m
ROUND = 0.05  # an outline that reaches so much farther than half its width, at most, is a circle
COURTESY = 0.3  # m; actors that yield keep so far from the robot


@dataclass(frozen=True)
class Body:
    """What moves on a route.

    Attributes
    ----------
    size : (2,) or (3,) float
        Radius and height of an upright cylinder, or length, width and height of a box [m].
    looks : Surface, optional
        In the frame of its middle; those of the cylinder or box where absent.
    """

    size: Sequence[float] = (PERSON_RADIUS, PERSON_HEIGHT)
    thing: Thing = Thing.PERSON
    looks: Surface | None = None

    @property
    def reach(self) -> float:
        """Radius [m] of a circle around it."""
        return self.size[0] if len(self.size) == 2 else 0.5 * math.hypot(self.size[0], self.size[1])

    def put_into(self, world: AnyWorld, pose: Pose) -> tuple[int, Surface]:
        """Put it into a world with its middle at a pose; return its number there and what it looks like."""
        if len(self.size) == 2:
            radius, height = self.size
            number, looks = world.add_cylinder(pose, radius, height, moving=True), cylinder(radius, height)
        else:
            number, looks = world.add_box(pose, self.size, moving=True), box(self.size)
        world.things[number] = self.thing
        return number, self.looks or looks


PERSON = Body()


def closed_route(route: ArrayLike) -> FloatArray:
    """Corners (n + 1, 3) [m] of a route (n, 2) or (n, 3) that ends where it begins; the ground is at 0 without z."""
    corners = np.asarray(route, dtype=float)
    if corners.shape[1] == 2:
        corners = np.column_stack([corners, np.zeros(len(corners))])
    return np.vstack([corners, corners[:1]])


class RouteWalker:
    """A thing that follows a closed route of straight lines at constant speed, or a person who does not look.

    Parameters
    ----------
    route : (n, 2) or (n, 3) float
        Corners [m]; after the last it goes back to the first. With three columns the third is the ground's height.
    speed : float
        [m/s]
    start : float
        How far along the route [m] it is at time 0.
    gives_way : bool
        Wait as long as a robot it has met is just ahead, instead of pushing it.

    Attributes
    ----------
    reach : float
        Radius of a circle around it [m].
    """

    def __init__(
        self,
        world: AnyWorld,
        route: FloatArray,
        speed: float,
        start: float = 0.0,
        body: Body = PERSON,
        gives_way: bool = False,
    ) -> None:
        self._corners = closed_route(route)
        self._travelled = np.concatenate([[0.0], np.cumsum(norm(np.diff(self._corners, axis=0)))])
        self._world = world
        self._speed = speed
        self._start = start
        self._lift = 0.5 * body.size[-1]
        self.thing, self.size, self.reach = body.thing, body.size, body.reach
        self._waited, self._waits = 0.0, False
        self._gives_way = gives_way
        self._robots: Sequence[SimulatedRobot] = ()
        self.body, self.looks = body.put_into(world, self.pose())
        world.before_step(self._move)

    def pose(self) -> Pose:
        """Pose of its middle now."""
        length = float(self._travelled[-1])
        along = (self._start + self._speed * (self._world.time - self._waited)) % length if length > 0.0 else 0.0
        x, y, z = (float(np.interp(along, self._travelled, self._corners[:, k])) for k in range(3))
        leg = min(int(np.searchsorted(self._travelled, along, side="right")), len(self._corners) - 1)
        ahead = self._corners[leg] - self._corners[leg - 1]
        return Pose.planar(x, y, math.atan2(ahead[1], ahead[0]), z + self._lift)

    def velocity(self) -> tuple[float, float]:
        """Velocity in the map [m/s]."""
        yaw, speed = self.pose().yaw, 0.0 if self._waits else self._speed
        return speed * math.cos(yaw), speed * math.sin(yaw)

    def meet(self, robots: Sequence[SimulatedRobot]) -> None:
        """Give way to these robots from now on."""
        self._robots = robots if self._gives_way else ()

    def _move(self) -> None:
        self._waits = any(map(self._is_ahead, self._robots))
        if self._waits:
            self._waited += self._world.time_step
        self._world.place_body(self.body, self.pose())

    def _is_ahead(self, robot: SimulatedRobot) -> bool:
        """Whether the robot is near, and on the side this one walks to."""
        here, there = self.pose(), robot.pose()
        dx, dy = there.x - here.x, there.y - here.y
        near = math.hypot(dx, dy) < self.reach + robot.spec.circumscribed_radius + COURTESY
        return near and dx * math.cos(here.yaw) + dy * math.sin(here.yaw) > 0.0


class SlidingDoor:
    """A leaf that slides from its open into its closed place at a given time.

    Parameters
    ----------
    opened, closed : Pose
        Middle of the leaf in both places.
    size : (3,) float
        Of the leaf [m].
    closes_at, duration : float
        When it starts to close and how long that takes [s].
    """

    def __init__(
        self,
        world: AnyWorld,
        opened: Pose,
        closed: Pose,
        size: Sequence[float],
        closes_at: float,
        duration: float = 2.0,
    ) -> None:
        self._world = world
        self._opened, self._closed = np.array(opened.position), np.array(closed.position)
        self._orientation = closed.orientation
        self._closes_at = closes_at
        self._duration = duration
        self.thing, self.looks, self.size = Thing.DOOR, box(size), size
        self.body = world.add_box(opened, size, moving=True)
        world.things[self.body] = self.thing
        world.before_step(self._move)

    def pose(self) -> Pose:
        """Pose of the leaf's middle now."""
        share = min(1.0, max(0.0, (self._world.time - self._closes_at) / self._duration))
        x, y, z = (self._opened + share * (self._closed - self._opened)).tolist()
        return Pose((x, y, z), self._orientation)

    def _move(self) -> None:
        self._world.place_body(self.body, self.pose())


def other_robot(
    world: AnyWorld, spec: RobotSpec, route: FloatArray, speed: float, start: float = 0.0, gives_way: bool = False
) -> RouteWalker:
    """Put in another robot that follows a route: a box as large as the model, drawn with its body and wheels."""
    length, width = np.ptp(spec.footprint_array(), axis=0).tolist()
    size = (length, width, spec.height)
    body = Body(size, Thing.ROBOT, robot_looks(spec, size))
    return RouteWalker(world, route, speed, start, body, gives_way)


class Fellow:
    """A robot that navigates by itself, as the sensors, monitors and recordings of the other robots have it.

    It is an upright cylinder if its outline is round, else a box.
    """

    thing = Thing.ROBOT

    def __init__(self, robot: PlacedRobot) -> None:
        self._robot = robot
        spec, outline = robot.spec, robot.spec.footprint_array()
        length, width = np.ptp(outline, axis=0).tolist()
        is_round = 2.0 * spec.circumscribed_radius < (1.0 + ROUND) * min(length, width)
        self.size: Sequence[float] = (0.5 * length, spec.height) if is_round else (length, width, spec.height)
        self._middle = np.array([*(0.5 * (outline.min(axis=0) + outline.max(axis=0))), 0.5 * spec.height])
        self.looks = robot_looks(spec, (length, width, spec.height))

    def pose(self) -> Pose:
        """Pose of its middle now."""
        pose = self._robot.pose()
        x, y, z = (np.asarray(pose.position) + rotated(pose.rotation, self._middle)).tolist()
        return Pose((x, y, z), pose.orientation, pose.frame_id, pose.stamp)

    def solid(self) -> UprightSolid:
        """Return the cylinder or box where it is now."""
        return UprightSolid(self.pose(), self.size, moving=True)


def robot_looks(spec: RobotSpec, size: tuple[float, float, float]) -> Surface:
    """A narrower body above the axles, and the wheels, in the frame of the middle of the box of ``size``."""
    length, width, height = size
    radius = spec.wheel_radius
    body, body_faces = box((length, 0.7 * width, height - radius))
    drum, drum_faces = cylinder(radius, 0.64 * radius)
    drum = drum[:, [0, 2, 1]] * (1.0, -1.0, 1.0)  # a quarter turn about x lays its axis along y
    middle = 0.5 * (spec.footprint_array().min(axis=0) + spec.footprint_array().max(axis=0))  # base_link may be off it
    wheels = RobotShape.of(spec).wheels - np.array([*middle, 0.5 * height])
    raised = Surface(body + np.array([0.0, 0.0, 0.5 * radius]), body_faces)
    return joined([raised, *(Surface(drum + wheel, drum_faces) for wheel in wheels)])
