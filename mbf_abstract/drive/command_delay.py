"""Where a robot will be when its next command takes effect: a prediction by the commands it has not yet carried out.

When to use: between a robot's pose and its controller, where commands take effect later than a control period. When
not: for what holds now, such as whether the goal is reached.

Formula: the predictor of Smith (1957), for a robot that does what it is commanded once the delay has passed. What is
measured now says nothing of the velocity then: added to the changes that are pending, it swings with its own delay.
"""

from __future__ import annotations

from collections import deque
from dataclasses import replace

from mbf_abstract.geometry import AckermannCommand, Command, Pose, Twist
from mbf_abstract.geometry.arcs import arc_poses
from mbf_abstract.geometry.rotations import quaternion_from_yaw, quaternion_multiply
from mbf_abstract.geometry.transform import rotate

SHORTEST = 1e-6
"""[s] A command that holds for less moves nothing."""


class CommandDelay:
    """The commands of the last moments."""

    def __init__(self) -> None:
        self._sent: deque[tuple[float, Twist]] = deque()

    def note(self, time: float, command: Command) -> None:
        """Take note of a command sent at ``time`` [s]; the curve of a car that is given an angle counts as straight."""
        if self._sent and self._sent[-1][0] >= time:
            return
        twist = Twist.planar(command.speed) if isinstance(command, AckermannCommand) else command
        self._sent.append((time, twist))

    def ahead(self, now: float, delay: float, pose: Pose, velocity: Twist) -> tuple[Pose, Twist]:
        """Pose and velocity ``delay`` [s] after ``now`` [s], when a command that is sent now takes effect.

        Parameters
        ----------
        pose, velocity : Pose, Twist
            As measured now, the velocity in the robot's frame.
        """
        while len(self._sent) > 1 and self._sent[1][0] <= now - delay:
            self._sent.popleft()
        if delay == 0.0 or not self._sent:
            return pose, velocity
        predicted, last = velocity, now
        for time, command in self._sent:
            begin = max(time + delay, now)
            pose, last, predicted = _moved(pose, predicted, begin - last), begin, command
        return _moved(pose, predicted, now + delay - last), predicted


def _moved(pose: Pose, velocity: Twist, duration: float) -> Pose:
    """The pose after ``duration`` [s] in the robot's plane."""
    if duration < SHORTEST:
        return pose
    driven = arc_poses((0.0, 0.0, 0.0), velocity.vx, velocity.vy, velocity.wz, duration, duration)
    x, y, yaw = driven[-1].tolist()
    dx, dy, dz = rotate(pose.orientation, (x, y, 0.0))
    position = pose.x + dx, pose.y + dy, pose.z + dz
    return replace(pose, position=position, orientation=quaternion_multiply(pose.orientation, quaternion_from_yaw(yaw)))
