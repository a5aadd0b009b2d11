"""What sensors, actors and sessions need of a world and of a robot, with physics and without."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

from mbf_abstract.drive.robot import Odometry
from mbf_abstract.geometry import Command, Pose, Twist
from terrain.physics.motion_sample import MotionSample, Thing
from terrain.physics.robot_models import RobotSpec
from terrain.worlds.surface import Surface


class SimulatedWorld(Protocol):
    """A world that moves in fixed steps: ``BulletWorld`` or ``KinematicWorld``."""

    @property
    def time_step(self) -> float:
        """Length of a step [s]."""

    @property
    def time(self) -> float:
        """Simulated time [s]."""

    def step(self) -> None:
        """Advance by one time step."""

    def before_step(self, callback: Callable[[], None]) -> None:
        """Call ``callback`` before each step."""

    def after_step(self, callback: Callable[[], None]) -> None:
        """Call ``callback`` after each step: monitors and sensors."""


class SimulatedRobot(Protocol):
    """A robot in such a world: ``WheeledRobot`` or ``KinematicRobot``."""

    @property
    def spec(self) -> RobotSpec:
        """Its model."""

    def pose(self) -> Pose:
        """Ground truth of base_link in map."""

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
