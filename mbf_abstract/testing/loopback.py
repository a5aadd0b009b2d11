"""A robot without physics: it moves exactly as commanded, on the clock, and can be made to fail.

Use it to test plugins, executives and the framework. It has no mass, no slip and no walls; for behaviour on
ground use the worlds of ``terrain``.
"""

from __future__ import annotations

import math
from collections import deque

from mbf_abstract.drive.robot import Odometry
from mbf_abstract.geometry import AckermannCommand, Command, Pose, Twist, quaternion_from_yaw
from mbf_abstract.geometry.transform import Transform
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.session import NavigationSession
from mbf_abstract.time.clock import Clock, Priority

MAX_LOGGED_COMMANDS = 100_000


class LoopbackRobot:
    """Integrates the last command and publishes ``map -> odom -> base_link`` and odometry.

    Parameters
    ----------
    clock : Clock
        Its steps are taken by a thread of this clock.
    transforms : TransformBuffer
        Where poses are published.
    start : Pose
        First pose in the global frame; only x, y and yaw move later.
    period : float
        Time of one step [s].
    wheelbase : float
        Distance of the axles [m] for Ackermann commands.

    Attributes
    ----------
    commands : deque of (float, Command)
        Every command with its time.
    stuck : bool
        Set it and the robot ignores its commands.
    publishes_pose, publishes_odometry : bool
        Clear them and the localisation or the odometry falls silent.
    T_map_odom : Transform
        Replace it to let the localisation jump.
    """

    def __init__(
        self, clock: Clock, transforms: TransformBuffer, start: Pose, period: float = 0.02, wheelbase: float = 0.5
    ) -> None:
        self.commands: deque[tuple[float, Command]] = deque(maxlen=MAX_LOGGED_COMMANDS)
        self.stuck = False
        self.publishes_pose = True
        self.publishes_odometry = True
        self.T_map_odom = Transform((0.0, 0.0, 0.0), parent=start.frame_id, child="odom")
        self._clock = clock
        self._transforms = transforms
        self._period = period
        self._wheelbase = wheelbase
        self._x, self._y, self._z = start.position
        self._yaw = start.yaw
        self._command: Command = Twist()
        self._odometry: Odometry | None = None
        self._closed = False
        self._publish()
        clock.spawn(self._loop, "loopback robot", Priority.SIMULATOR)

    @property
    def command(self) -> Command:
        """What the robot is doing right now."""
        return self._command

    @property
    def pose(self) -> Pose:
        """True pose in the global frame."""
        return self.T_map_odom.apply_to_pose(
            Pose.planar(self._x, self._y, self._yaw, self._z, "odom", self._clock.now())
        )

    def send_command(self, command: Command) -> None:
        """Move like this until the next command."""
        self.commands.append((self._clock.now(), command))
        self._command = command

    def odometry(self) -> Odometry | None:
        """Velocity of the last step."""
        return self._odometry

    def moved_after(self, time: float) -> list[tuple[float, Command]]:
        """Return the commands later than ``time`` [s] that do not mean standing still."""
        return [(stamp, command) for stamp, command in self.commands if stamp > time and not command.is_stopped()]

    def close(self) -> None:
        """End the thread at its next step."""
        self._closed = True

    def _loop(self) -> None:
        start, steps = self._clock.now(), 0
        while not self._closed:
            steps += 1
            self._clock.sleep_until(start + steps * self._period)
            self._step(self._period)

    def _step(self, seconds: float) -> None:
        velocity = Twist() if self.stuck else self._velocity()
        middle = self._yaw + 0.5 * velocity.wz * seconds
        self._x += (velocity.vx * math.cos(middle) - velocity.vy * math.sin(middle)) * seconds
        self._y += (velocity.vx * math.sin(middle) + velocity.vy * math.cos(middle)) * seconds
        self._yaw += velocity.wz * seconds
        if self.publishes_odometry:
            self._odometry = Odometry(velocity, self._clock.now())
        if self.publishes_pose:
            self._publish()

    def _velocity(self) -> Twist:
        command = self._command
        if isinstance(command, AckermannCommand):
            return Twist.planar(command.speed, wz=command.speed * math.tan(command.steering_angle) / self._wheelbase)
        return command

    def _publish(self) -> None:
        now = self._clock.now()
        rotation = quaternion_from_yaw(self._yaw)
        T = self.T_map_odom
        self._transforms.set(Transform(T.translation, T.rotation, T.parent, T.child, now))
        self._transforms.set(Transform((self._x, self._y, self._z), rotation, "odom", "base_link", now))


class LoopbackSession(NavigationSession):
    """A session with a loopback robot; give ``robot`` and ``transforms`` to ``serve``.

    Parameters
    ----------
    start : Pose
        Where the robot stands.
    clock : Clock, optional
        A new ``SimClock`` if not given.
    period : float
        Time of one step of the robot [s].
    """

    def __init__(self, start: Pose, clock: Clock | None = None, period: float = 0.02) -> None:
        super().__init__(clock)
        self.transforms = TransformBuffer()
        self.robot = LoopbackRobot(self.clock, self.transforms, start, period)
        self.on_close(self.robot.close)
