"""The robot model of Table I, and the other robots: shuttles on fixed routes that never replan.

A shuttle stops for whatever is near ahead of it.

A shuttle's motion is a function of its route, its speed and its phase; the executive that is measured acts on it only
by standing on its route. ``polite=False`` removes even this influence.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mbf_abstract.geometry import FloatArray, normalize_angle
from mbf_abstract.geometry.arithmetic import arctan2, plane_rotation, rotated_back
from terrain.physics.robot_models import Drive, RobotSpec, rectangle

HALF_LENGTH, HALF_WIDTH = 0.35, 0.25  # m

CARRIER = RobotSpec(
    name="carrier",
    drive=Drive.DIFFERENTIAL,
    footprint=rectangle(-HALF_LENGTH, HALF_LENGTH, HALF_WIDTH),
    height=0.4,
    mass=60.0,
    wheel_radius=0.1,
    track=0.44,
    wheelbase=0.0,
    left_wheels=("left",),
    right_wheels=("right",),
    max_speed=0.6,
    max_yaw_rate=1.0,
    max_acceleration=0.5,
    max_yaw_acceleration=2.0,
    motor_torque=10.0,
    lidar_position=(0.0, 0.0, 0.3),
)
"""Model of all robots of Table I; it has no body file, because only ``KinematicRobot`` drives it."""

STOP_DISTANCE = 0.6  # m ahead of its front: nearer than this a polite robot stops
SIDE_MARGIN = 0.05  # m; what is this far beside its route is not ahead of it
DWELL = 5.0  # s; how long it stands at each corner, to load
SPEED_RANGE = (0.25, 0.5)  # m/s
PHASE_RANGE = (0.0, 0.08)
CORNER_REACHED = 1e-6  # m
AHEAD_STEP = 0.05  # s; of the time before a run


@dataclass(frozen=True)
class Box:
    """An outline on the floor: middle [m], heading [rad], half length and half width [m]."""

    x: float
    y: float
    yaw: float
    half_length: float = HALF_LENGTH
    half_width: float = HALF_WIDTH

    def overlaps(self, other: Box) -> bool:
        """Whether the two rectangles share a point (separating axes)."""
        dx, dy = other.x - self.x, other.y - self.y
        reach = math.hypot(self.half_length, self.half_width) + math.hypot(other.half_length, other.half_width)
        if dx * dx + dy * dy > reach * reach:
            return False
        c, s = abs(math.cos(other.yaw - self.yaw)), abs(math.sin(other.yaw - self.yaw))
        for box, first, second in ((self, self, other), (other, other, self)):
            along = abs(dx * math.cos(box.yaw) + dy * math.sin(box.yaw))
            across = abs(dy * math.cos(box.yaw) - dx * math.sin(box.yaw))
            if along > first.half_length + c * second.half_length + s * second.half_width:
                return False
            if across > first.half_width + s * second.half_length + c * second.half_width:
                return False
        return True

    def ahead(self, distance: float, margin: float) -> Box:
        """Return the rectangle of this length in front, a little wider than the robot."""
        middle = self.half_length + 0.5 * distance
        x, y = self.x + middle * math.cos(self.yaw), self.y + middle * math.sin(self.yaw)
        return Box(x, y, self.yaw, 0.5 * distance, self.half_width + margin)


class Shuttle:
    """One moving robot on a closed route of straight legs; it turns on the spot at each corner.

    Parameters
    ----------
    route : (n, 2) float
        Corners [m]; the last leg leads back to the first.
    speed : float
        On a free leg [m/s].
    phase : float
        Share of the route, 0..1, at which it starts.
    polite : bool
        Whether it stops for what is ahead.
    """

    def __init__(self, route: Sequence[tuple[float, float]], speed: float, phase: float, polite: bool = True) -> None:
        self.corners = np.asarray(route, dtype=float)
        self.speed = speed
        self.polite = polite
        legs = np.roll(self.corners, -1, axis=0) - self.corners
        self._lengths = np.hypot(*legs.T)
        self._headings = arctan2(legs[:, 1], legs[:, 0])
        travelled = phase % 1.0 * float(self._lengths.sum())
        ends = np.cumsum(self._lengths)
        self._leg = min(int(np.searchsorted(ends, travelled, side="right")), len(ends) - 1)
        self._along = travelled - float(ends[self._leg] - self._lengths[self._leg])
        self._yaw = float(self._headings[self._leg])
        self._velocity = 0.0
        self._dwell = 0.0
        self._box = self._box_at(self._place)

    @property
    def _place(self) -> tuple[int, float, float]:
        return self._leg, self._along, self._yaw

    @property
    def box(self) -> Box:
        """Where it stands now; kept until it moves, as all others ask for it in every step."""
        if self._place != self._box_place:
            self._box = self._box_at(self._place)
        return self._box

    def _box_at(self, place: tuple[int, float, float]) -> Box:
        self._box_place = leg, along, yaw = place
        x, y = self.corners[leg].tolist()
        heading = float(self._headings[leg])
        return Box(x + along * math.cos(heading), y + along * math.sin(heading), yaw)

    @property
    def state(self) -> tuple[int, float, float, float]:
        """Leg, length along it [m], heading [rad] and speed [m/s]; can be set, to take a step back."""
        return self._leg, self._along, self._yaw, self._velocity

    @state.setter
    def state(self, value: tuple[int, float, float, float]) -> None:
        self._leg, self._along, self._yaw, self._velocity = value

    def halt(self) -> None:
        """Stand at once."""
        self._velocity = 0.0

    def advance(self, seconds: float, others: Sequence[Box]) -> None:
        """Move on by one small time step; ``others`` are all other robots."""
        if self._dwell > 0.0:
            self._dwell -= seconds
            return
        turn = normalize_angle(float(self._headings[self._leg]) - self._yaw)
        if abs(turn) > 1e-9:
            if self._is_blocked(others, self._turning_circle()):
                return
            step = CARRIER.max_yaw_rate * seconds
            self._yaw = normalize_angle(self._yaw + max(-step, min(step, turn)))
            return
        left = float(self._lengths[self._leg]) - self._along
        change = CARRIER.max_acceleration * seconds
        wanted = min(self.speed, math.sqrt(2.0 * CARRIER.max_acceleration * left))
        if self._is_blocked(others, self.box.ahead(STOP_DISTANCE, SIDE_MARGIN)):
            wanted = 0.0
        self._velocity = max(min(self._velocity + change, wanted), self._velocity - change, 0.0)
        self._along += min(self._velocity * seconds, left)
        if left - self._velocity * seconds <= CORNER_REACHED:
            self._leg, self._along = (self._leg + 1) % len(self.corners), 0.0
            self._dwell = DWELL
            self.halt()

    def _is_blocked(self, others: Sequence[Box], needed: Box) -> bool:
        return self.polite and any(needed.overlaps(other) for other in others)

    def _turning_circle(self) -> Box:
        """Return the square around the circle that its corners sweep."""
        box, radius = self.box, CARRIER.circumscribed_radius
        return Box(box.x, box.y, 0.0, radius, radius)


def make_traffic(
    routes: Sequence[Sequence[tuple[float, float]]], count: int, polite: bool, rng: np.random.Generator
) -> list[Shuttle]:
    """Make one robot for each of the first ``count`` routes, speed and phase drawn from ``rng``.

    The draws of a robot do not depend on how many others there are.

    Raises
    ------
    ValueError
        There are fewer routes.
    """
    if count > len(routes):
        raise ValueError(f"{count} robots need as many routes, the world has {len(routes)}")
    draws = rng.uniform(size=(len(routes), 2))
    low, high = np.transpose([SPEED_RANGE, PHASE_RANGE])
    draws = low + (high - low) * draws
    return [
        Shuttle(route, float(speed), float(phase), polite)
        for route, (speed, phase) in zip(routes[:count], draws, strict=False)
    ]


def run_ahead(shuttles: Sequence[Shuttle], seconds: float, standing: Box) -> None:
    """Let the robots drive for a while before a run, around one that stands; routes and phases alone begin alike."""
    for _ in range(round(seconds / AHEAD_STEP)):
        for shuttle in shuttles:
            shuttle.advance(AHEAD_STEP, [standing, *(other.box for other in shuttles if other is not shuttle)])


class TrafficRays:
    """What a lidar sees of the other robots: rays at their outlines, at any height."""

    def __init__(self, shuttles: Sequence[Shuttle]) -> None:
        self._shuttles = shuttles

    def distances(self, origins: FloatArray, directions: FloatArray, max_range: float) -> FloatArray:
        """Cast the rays (the slab method in each robot's own frame); see ``terrain.sensors.rays.RayCaster``."""
        nearest = np.full(len(origins), np.inf)
        for shuttle in self._shuttles:
            box = shuttle.box
            offset = origins[:, :2] - (box.x, box.y)
            if float(np.hypot(*offset[0])) > max_range + 1.0:
                continue
            turn = plane_rotation(box.yaw)
            start, ray = rotated_back(turn, offset), rotated_back(turn, directions[:, :2])
            half = np.array([box.half_length, box.half_width])
            with np.errstate(divide="ignore", invalid="ignore"):
                first, second = (-half - start) / ray, (half - start) / ray
            enter = np.minimum(first, second).max(axis=1)
            leave = np.maximum(first, second).min(axis=1)
            hit = (enter <= leave) & (enter >= 0.0) & (enter <= max_range)
            nearest = np.where(hit, np.minimum(nearest, enter), nearest)
        return nearest
