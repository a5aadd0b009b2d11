"""The robot as the framework sees it: a sink for commands, odometry, and poses through the transform buffer.

``RobotInformation`` is what plugins and executions ask. It never returns old data: a pose or a velocity beyond
its age limit raises ``RobotStateError`` with the measured age, so no command is computed on it (promise P6).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol, cast

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.event_values import error_text
from mbf_abstract.geometry import Command, Pose, Twist
from mbf_abstract.geometry.transform import TransformError
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.time.clock import Clock, ThreadDetached

MAX_ODOMETRY_LEAD = 0.2
"""How far [s] odometry may be stamped in the future: what clocks of two computers differ by."""
TRACK_SPACING = 0.05
"""Least distance [m] between two points of the driven track."""
TRACK_POINTS = 200
"""Length of the track: ten metres of a slow robot."""
FASTEST = 200.0
"""Largest component of a measured velocity [m/s, rad/s]; no robot on the ground is faster, and controllers think ahead
by it."""


class RobotStateError(Exception):
    """The robot's pose or velocity is unknown or too old; the text names which, and its age."""


@dataclass(frozen=True)
class Odometry:
    """A measured velocity in the base frame and its time [s]."""

    velocity: Twist
    stamp: float


def odometry_problem(answer: object) -> str:
    """Why this is no answer of a driver's ``odometry``; empty if it is one."""
    if answer is None:
        return ""
    if not isinstance(answer, Odometry):
        return f"the driver answered with {type(answer).__name__}, expected Odometry or None"
    velocity: object = answer.velocity
    if not isinstance(velocity, Twist):
        return f"the driver's Odometry holds {type(velocity).__name__}, expected Twist"
    numbers = (*velocity.linear, *velocity.angular)
    try:
        finite = all(math.isfinite(number) for number in (*numbers, answer.stamp))
    except TypeError:
        finite = False
    if not finite:
        return f"the driver's Odometry is not finite: {velocity} at {answer.stamp} s"
    if max(map(abs, numbers)) > FASTEST:
        return f"the driver's Odometry is faster than {FASTEST:g} m/s or rad/s: {velocity}"
    return ""


class Robot(Protocol):
    """What a robot driver implements: two plain functions, called from several threads.

    The driver of a car may give its tightest curve in an attribute ``min_turning_radius`` [m]; the velocity gate,
    planners and controllers respect it unless the configuration gives another one.

    A driver built on asyncio hands a command to its loop with ``asyncio.run_coroutine_threadsafe`` and answers
    ``odometry`` from a variable.
    """

    def send_command(self, command: Command) -> None:
        """Apply a command until the next one; called only by the velocity gate. Must not block.

        Where a call blocks all the same, a stop comes from another thread while it lasts.
        """

    def odometry(self) -> Odometry | None:
        """Last measured velocity, or None if this robot has no odometry. Must not block."""


def turning_radius_of(robot: Robot) -> float:
    """Radius [m] of the tightest curve, from the driver; 0 = the robot turns on the spot."""
    return float(getattr(robot, "min_turning_radius", 0.0))


class RobotInformation:
    """Fresh robot state in the frames of the server.

    Parameters
    ----------
    max_pose_age, max_velocity_age : float
        Age limits [s] of the robot's transform and odometry.
    uses_odometry : bool
        Without it the driver is never asked, and the robot counts as one that measures no velocity.
    """

    def __init__(
        self,
        robot: Robot,
        transforms: TransformBuffer,
        clock: Clock,
        global_frame: str = "map",
        robot_frame: str = "base_link",
        max_pose_age: float = 3.0,
        max_velocity_age: float = 3.0,
        uses_odometry: bool = True,
    ) -> None:
        self._robot = robot
        self._transforms = transforms
        self._clock = clock
        self.global_frame = global_frame
        self.robot_frame = robot_frame
        self.max_pose_age = max_pose_age
        self.max_velocity_age = max_velocity_age
        self._uses_odometry = uses_odometry
        self._track: tuple[tuple[float, float, float], ...] = ()

    def pose(self) -> Pose:
        """Robot pose in the global frame, at most ``max_pose_age`` old.

        Raises
        ------
        RobotStateError
            The transform is missing or too old.
        """
        now = self._clock.now()
        try:
            transform = self._transforms.lookup(self.global_frame, self.robot_frame, now=now, max_age=self.max_pose_age)
        except TransformError as error:
            raise RobotStateError(f"no fresh robot pose: {error}") from error
        pose = Pose(transform.translation, transform.rotation, self.global_frame, transform.stamp)
        self._extend_track(pose.position)
        return pose

    def recent_track(self) -> NDArray[np.float64]:
        """Positions (n, 3) [m] of the robot in the global frame, oldest first, as returned by ``pose()``.

        A robot that drives back rolls its track up, so the last points always lead further back.
        """
        return np.array(self._track, dtype=np.float64).reshape(-1, 3)

    def _extend_track(self, position: tuple[float, float, float]) -> None:
        track = self._track  # replaced as a whole, because any thread may ask for a pose
        if track and math.dist(position, track[-1]) < TRACK_SPACING:
            return
        if len(track) > 1 and math.dist(position, track[-2]) < math.dist(track[-1], track[-2]):
            track = track[:-1]
            if math.dist(position, track[-1]) < TRACK_SPACING:
                self._track = track
                return
        self._track = (*track, position)[-TRACK_POINTS:]

    @property
    def has_odometry(self) -> bool:
        """Whether the robot measures its velocity at all; raises RobotStateError."""
        return self._odometry() is not None

    def velocity(self) -> Twist:
        """Measured velocity in the base frame; zero for a robot without odometry. Raises RobotStateError."""
        return self.measured_velocity() or Twist()

    def measured_velocity(self) -> Twist | None:
        """Measured velocity in the base frame; None for a robot without odometry.

        Raises
        ------
        RobotStateError
            The last odometry is older than ``max_velocity_age`` or from the future, or the driver raised.
        """
        odometry = self._odometry()
        if odometry is None:
            return None
        age = self._clock.now() - odometry.stamp
        if age > self.max_velocity_age:
            raise RobotStateError(f"odometry is {age:.2f} s old, limit {self.max_velocity_age:.2f} s")
        if not age >= -MAX_ODOMETRY_LEAD:
            raise RobotStateError(f"odometry is stamped {-age:.2f} s in the future, limit {MAX_ODOMETRY_LEAD:.2f} s")
        return odometry.velocity

    def _odometry(self) -> Odometry | None:
        if not self._uses_odometry:
            return None
        try:
            answer: object = self._robot.odometry()
        except ThreadDetached:
            raise
        except BaseException as error:
            text = f"no odometry: the driver raised {type(error).__name__}: {error_text(error)}"
            raise RobotStateError(text) from error
        problem = odometry_problem(answer)
        if problem:
            raise RobotStateError(f"no odometry: {problem}")
        return cast("Odometry | None", answer)
