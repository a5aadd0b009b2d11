"""The driver of a robot that is a ROS 2 node: commands go out as messages, odometry and transforms come in.

A robot of which nothing is heard must not be driven on. When odometry, a transform between the global and the robot's
frame, a sensor or simulated time fails to come for ``max_silence``, zero is sent, and no motion goes out until all
have come again. Silence is measured in real time, so it counts also where simulated time or the executor stands still.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from mbf_abstract.drive.commands import stands_still
from mbf_abstract.drive.robot import Odometry
from mbf_abstract.geometry import Command
from mbf_abstract.geometry.transform import TransformError
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.time.clock import Clock

TRANSFORM = "tf"


@dataclass(frozen=True)
class Frames:
    """Between which frames the robot's pose is."""

    global_frame: str
    robot_frame: str


class SilenceError(RuntimeError):
    """Something that the robot must send has not come; the text names it, and for how long."""


class Arrivals:
    """When the last message came on each topic; ``now`` is real time [s]."""

    def __init__(self, now: Callable[[], float]) -> None:
        self._now = now
        self._heard: dict[str, float | None] = {}

    def expect(self, topic: str) -> None:
        """Count a topic as silent until its next message."""
        self._heard[topic] = None

    def hear(self, topic: str) -> None:
        """Note that a message has come."""
        self._heard[topic] = self._now()

    def problems(self, limit: float) -> dict[str, str]:
        """What is wrong with each topic, empty for one on which a message has come in the last ``limit`` [s]."""
        now = self._now()
        return {topic: _silence(topic, heard, now, limit) for topic, heard in tuple(self._heard.items())}


def _silence(topic: str, heard: float | None, now: float, limit: float) -> str:
    if heard is None:
        return f"no message has come on {topic} yet"
    return f"no message on {topic} for {now - heard:.2f} s" if now - heard > limit else ""


class RosRobot:
    """The driver.

    Parameters
    ----------
    publish : callable
        Sends a command to the robot.
    clock : Clock
        Of the stamps of transforms.
    arrivals : Arrivals
        Topics on which messages must come.
    max_silence : callable
        Longest time [s] without a message.
    """

    def __init__(
        self,
        publish: Callable[[Command], None],
        transforms: TransformBuffer,
        clock: Clock,
        arrivals: Arrivals,
        frames: Frames,
        max_silence: Callable[[], float],
    ) -> None:
        self._publish, self._transforms, self._clock = publish, transforms, clock
        self._arrivals, self._frames, self._max_silence = arrivals, frames, max_silence
        self._odometry: Odometry | None = None

    def take_odometry(self, odometry: Odometry) -> None:
        """Take the newest odometry."""
        self._odometry = odometry

    def send_command(self, command: Command) -> None:
        """Send a command; a motion raises SilenceError while something fails to come."""
        if not stands_still(command) and (problem := self.problem()):
            raise SilenceError(problem)
        self._publish(command)

    def odometry(self) -> Odometry:
        """The last odometry; raises SilenceError while something fails to come."""
        if problem := self.problem():
            raise SilenceError(problem)
        if self._odometry is None:
            raise SilenceError("no odometry has come yet")
        return self._odometry

    def problem(self) -> str:
        """What fails to come; empty if all does."""
        return next(filter(None, self.problems().values()), "")

    def problems(self) -> dict[str, str]:
        """What is wrong with each topic that must come, and with the robot's transform; empty where nothing is."""
        limit = self._max_silence()
        target, source = self._frames.global_frame, self._frames.robot_frame
        try:
            self._transforms.lookup(target, source, now=self._clock.now(), max_age=limit)
            transform = ""
        except TransformError as error:
            transform = str(error)
        return {**self._arrivals.problems(limit), TRANSFORM: transform}
