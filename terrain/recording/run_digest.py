"""One SHA-256 of all that a robot did: equal digests are equal drives, bit for bit.

Equal event logs can hide different drives, since events hold rounded numbers and most control cycles write none. The
digest takes the true pose after every step of the drive loop, every command handed to the robot's motors, and every
event. Floats go in as their eight bytes, little-endian, on every machine.
"""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Callable

from mbf_abstract.events import Event, EventSink
from mbf_abstract.geometry import Command, Pose, Twist

POSE, COMMAND, EVENT = b"p", b"c", b"e"  # a letter before each entry, so that no entry can pass for another


class RunDigest(EventSink):
    """The running digest of one run; also a sink of its events.

    Parameters
    ----------
    now : callable
        Time [s] of the run's clock, which stamps poses and commands.
    """

    def __init__(self, now: Callable[[], float]) -> None:
        self._now = now
        self._hash = hashlib.sha256()

    def pose(self, pose: Pose) -> None:
        """Take the true pose of the robot at this instant."""
        self._take(POSE, *pose.position, *pose.orientation)

    def command(self, command: Command) -> None:
        """Take a command that is handed to the robot at this instant."""
        if isinstance(command, Twist):
            self._take(COMMAND, *command.linear, *command.angular)
        else:
            self._take(COMMAND, command.speed, command.steering_angle)

    def write(self, event: Event) -> None:
        """Take an event, as the line that ``events.jsonl`` holds."""
        self._hash.update(EVENT + event.to_json().encode() + b"\n")

    def hexdigest(self) -> str:
        """Return the digest of all that was taken so far, 64 hexadecimal digits."""
        return self._hash.hexdigest()

    def _take(self, kind: bytes, *numbers: float) -> None:
        self._hash.update(kind + struct.pack(f"<B{len(numbers) + 1}d", len(numbers), self._now(), *numbers))
