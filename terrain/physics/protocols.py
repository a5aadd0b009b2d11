"""What sensors, actors and sessions need of a world and of a robot, with physics and without; how a world steps."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import Protocol, TypeVar

from mbf_abstract.drive.robot import Odometry
from mbf_abstract.geometry import Command, Pose, Twist
from terrain.physics.motion_sample import MotionSample, Thing
from terrain.physics.robot_models import RobotSpec
from terrain.worlds.surface import Surface

W = TypeVar("W", bound="SimulatedWorld")


class SimulatedWorld(ABC):
    """A world that moves in fixed steps: ``BulletWorld`` or ``KinematicWorld``; a context manager that closes it.

    Parameters
    ----------
    time_step : float
        Length of a step [s].

    Attributes
    ----------
    step_count : int
        Steps since the clock was started; ``time`` is derived from it and thus exact.
    things : dict of int to Thing
        Kinds of bodies that are not fixed, to distinguish collisions.
    """

    def __init__(self, time_step: float) -> None:
        self.time_step = time_step
        self.step_count = 0
        self.things: dict[int, Thing] = {}
        self._before_step: list[Callable[[], None]] = []
        self._after_step: list[Callable[[], None]] = []

    def __enter__(self: W) -> W:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()

    @abstractmethod
    def close(self) -> None:
        """Free the world; idempotent."""

    @property
    def time(self) -> float:
        """Simulated time [s] since the clock was started."""
        return self.step_count * self.time_step

    def before_step(self, callback: Callable[[], None]) -> None:
        """Call ``callback`` before each step: moving actors, faults, motor watchdogs."""
        self._before_step.append(callback)

    def after_step(self, callback: Callable[[], None]) -> None:
        """Call ``callback`` after each step: monitors and sensors."""
        self._after_step.append(callback)

    def step(self) -> None:
        """Advance by one time step."""
        for callback in self._before_step:
            callback()
        self._move_on()
        for callback in self._after_step:
            callback()

    @abstractmethod
    def _move_on(self) -> None:
        """Count a step, and move everything by it."""


class PlacedRobot(Protocol):
    """A robot that stands somewhere, in a world or where it is going to start."""

    @property
    def spec(self) -> RobotSpec:
        """Its model."""

    def pose(self) -> Pose:
        """Ground truth of base_link in map."""


class SimulatedRobot(PlacedRobot, Protocol):
    """A robot in such a world: ``WheeledRobot`` or ``KinematicRobot``."""

    def velocity(self) -> Twist:
        """Ground truth of the velocity, in base_link."""

    def rolling_velocity(self) -> Twist:
        """Motion of the base if the wheels did not slip."""

    def send_command(self, command: Command) -> None:
        """Hold a command until the next one or the time-out."""

    def odometry(self) -> Odometry:
        """Ground truth of the velocity, stamped with the world's time."""

    def motion_sample(self) -> MotionSample:
        """Return the sample that ``IncidentMonitor`` takes."""


class Actor(Protocol):
    """A thing that moves by itself: a person, a door, another robot.

    Attributes
    ----------
    looks : Surface
        In the actor's own frame.
    size : (2,) or (3,) float
        Radius and height of an upright cylinder, or length, width and height of a box [m].
    """

    thing: Thing
    looks: Surface
    size: Sequence[float]

    def pose(self) -> Pose:
        """Pose of the actor's frame now."""
