"""The newest command for a simulated robot: put there by the thread of the executor, taken by that of the simulator."""

from __future__ import annotations

from mbf_abstract.event_values import error_text
from mbf_abstract.geometry import Command
from mbf_abstract.time.clock import Clock
from mbf_ros.ros2.running import RosError


class NewestCommand:
    """One command, or why none will come any more.

    Parameters
    ----------
    real_time : Clock
        On which is waited.
    """

    def __init__(self, real_time: Clock) -> None:
        self._condition = real_time.condition()
        self._command: Command | None = None
        self._failure: BaseException | None = None

    def put(self, command: Command) -> None:
        """Replace the command."""
        with self._condition:
            self._command = command
            self._condition.notify_all()

    def fail(self, error: BaseException) -> None:
        """Let no more commands come, because of a fault of ours; who waits for one goes on at once."""
        with self._condition:
            self._failure = error
            self._condition.notify_all()

    def check(self) -> None:
        """Raise RosError if no more commands will come."""
        if self._failure is not None:
            raise RosError(f"{type(self._failure).__name__}: {error_text(self._failure)}") from self._failure

    def take(self) -> Command | None:
        """Return the command if one has come since the last call."""
        with self._condition:
            command, self._command = self._command, None
            return command

    def wait(self, seconds: float) -> bool:
        """Wait for a command, at most ``seconds`` [s]; returns whether there is one. Raises RosError as ``check``."""
        with self._condition:
            if self._command is None and self._failure is None:
                self._condition.wait(seconds)
            self.check()
            return self._command is not None
