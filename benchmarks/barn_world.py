"""One BARN world driven by the whole stack: the robot among cylinders, its lidar, its contacts, one move_base goal.

The robot is kinematic, 0.42 x 0.33 m, with the accelerations of the published settings (10 m/s^2, 20 rad/s^2). It has
no map: a planar lidar of 720 beams, 10 Hz, 10 m, exact against the circles, is all it knows. It goes from (-2, 3) to
within 1 m of (-2, 13). A collision is the unpadded footprint touching a cylinder; the limit is 100 s, and a goal that
move_base gives up counts as timeout.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path as FilePath

import numpy as np
from numba import njit

from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.goals.goal_types import MoveBaseGoal
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.navigator import Navigator
from mbf_abstract.testing.loopback import LoopbackRobot
from mbf_abstract.time.sim_clock import SimClock

HALF_LENGTH, HALF_WIDTH = 0.21, 0.165
BEAMS, SCAN_RANGE, SCAN_PERIOD = 720, 10.0, 0.1
STEP = 0.02
ACCELERATION = np.array([10.0, 10.0, 20.0])
START, GOAL, REACH, TIME_LIMIT = Pose.planar(-2.0, 3.0, 1.57), Pose.planar(-2.0, 13.0, 1.57), 1.0, 100.0
BEHIND_SURFACE = 0.005
"""A hit is reported this far [m] inside the cylinder, so that the mark falls into a cell of the obstacle."""
FIRST_SCANS = 1.0
"""Simulated time [s] before the goal is sent."""


@dataclass(frozen=True)
class World:
    """One world of the data.

    Attributes
    ----------
    cylinders : (n, 2) float64
        Centres [m].
    radius : float
        Of every cylinder [m].
    reference_length : float
        Length [m] of the published path.
    """

    cylinders: np.ndarray
    radius: float
    reference_length: float


class BarnRobot(LoopbackRobot):
    """The loopback robot with limited accelerations, a lidar, and cylinders around it that it can touch."""

    def __init__(self, clock: SimClock, transforms: TransformBuffer, world: World) -> None:
        self.world = world
        self.collided = False
        self.navigator: Navigator | None = None
        self._twist = np.zeros(3)
        self._steps = 0
        angles = np.arange(BEAMS) * (2.0 * np.pi / BEAMS)
        self._beams = np.column_stack([np.cos(angles), np.sin(angles)])
        super().__init__(clock, transforms, START, period=STEP)

    def _velocity(self) -> Twist:
        command = super()._velocity()
        wanted = np.array([command.vx, command.vy, command.wz])
        change = ACCELERATION * STEP
        self._twist = np.clip(wanted, self._twist - change, self._twist + change)
        return Twist.planar(*self._twist.tolist())

    def _step(self, seconds: float) -> None:
        super()._step(seconds)
        self.collided = self.collided or self._touches()
        self._steps += 1
        if self.navigator is not None and self._steps % round(SCAN_PERIOD / STEP) == 0:
            self.navigator.server.take_scan(self.scan())

    def scan(self) -> RangeScan:
        """All beams against all circles."""
        here = np.array([self._x, self._y])
        ranges = beam_ranges(self.world.cylinders - here, self.world.radius, BEAMS)
        hits = ranges < SCAN_RANGE
        ends = here + self._beams * (np.minimum(ranges, SCAN_RANGE) + BEHIND_SURFACE * hits)[:, None]
        stamp = self._clock.now()
        return RangeScan("scan", "map", np.append(here, 0.0), np.pad(ends, ((0, 0), (0, 1))), hits, stamp)

    def _touches(self) -> bool:
        """Whether the unpadded rectangle touches a circle."""
        c, s = math.cos(self._yaw), math.sin(self._yaw)
        local = (self.world.cylinders - (self._x, self._y)) @ np.array([[c, -s], [s, c]])
        outside = np.maximum(np.abs(local) - (HALF_LENGTH, HALF_WIDTH), 0.0)
        return bool((np.hypot(*outside.T) < self.world.radius).any())


@njit(cache=True)
def beam_ranges(offsets: np.ndarray, radius: float, beams: int) -> np.ndarray:
    """Distance (beams,) [m] to the first circle on each of evenly spread beams from the origin; inf without one.

    Only the beams within the angle a circle is seen under are intersected with it.
    """
    ranges = np.full(beams, np.inf)
    step = 2.0 * math.pi / beams
    for k in range(len(offsets)):
        x, y = offsets[k]
        distance = math.hypot(x, y)
        half = math.asin(min(radius / max(distance, 1e-9), 1.0))
        bearing = math.atan2(y, x)
        for index in range(math.ceil((bearing - half) / step), math.floor((bearing + half) / step) + 1):
            across = distance * math.sin(index * step - bearing)
            along = distance * math.cos(index * step - bearing)
            reach = along - math.sqrt(max(radius * radius - across * across, 0.0))
            ranges[index % beams] = min(ranges[index % beams], reach)
    return ranges


def warm_up(configuration: FilePath) -> None:
    """Compile all kernels beforehand; a first call that compiles could run into the guard for hung plugins."""
    clock, transforms = SimClock(), TransformBuffer()
    robot = BarnRobot(clock, transforms, World(np.array([[0.0, 0.0]]), 0.1, 10.0))
    with Navigator.from_file(configuration, robot, clock, transforms) as navigator:
        navigator.server.take_scan(robot.scan())
        navigator.server.queries.update_map()
        navigator.server.warm_up(START, GOAL)
    robot.close()


def drive(world: World, configuration: FilePath, controller: str, seed: int) -> tuple[str, float, str]:
    """Drive one world.

    Returns
    -------
    outcome : {"success", "collision", "timeout"}
    time : float
        From the goal to the end [s].
    message : str
        What move_base said, where it gave up.
    """
    clock, transforms = SimClock(), TransformBuffer()
    robot = BarnRobot(clock, transforms, world)
    with Navigator.from_file(configuration, robot, clock, transforms, seed=seed) as navigator:
        robot.navigator = navigator
        clock.sleep(FIRST_SCANS)
        begin = clock.now()
        handle = navigator.send(
            MoveBaseGoal(GOAL, controller=controller, dist_tolerance=REACH, angle_tolerance=math.pi)
        )
        outcome = ""
        while not outcome and not handle.done and clock.now() - begin < TIME_LIMIT:
            clock.sleep(STEP)
            if robot.collided:
                outcome = "collision"
            elif robot.pose.distance_to(GOAL) <= REACH:
                outcome = "success"
        time = clock.now() - begin
        message = handle.wait().message if handle.done and not outcome else ""
        handle.cancel()
    robot.close()
    clock.sleep(1.0)
    return outcome or "timeout", time, message
