"""Commands that reach the motors late, as over a bus or a radio."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from mbf_abstract.geometry import Command
from mbf_abstract.time.clock import TIME_RESOLUTION
from terrain.physics.protocols import SimulatedWorld


class CommandDelay:
    """Hands commands over after a fixed time, in their order.

    Parameters
    ----------
    send : callable
        Takes the commands that are due.
    delay : float
        [s of the world]; at 0 commands pass at once.
    """

    def __init__(self, world: SimulatedWorld, send: Callable[[Command], None], delay: float) -> None:
        self._world = world
        self._send = send
        self._delay = delay
        self._waiting: deque[tuple[float, Command]] = deque()
        if delay > 0.0:
            world.before_step(self._hand_over)

    def __call__(self, command: Command) -> None:
        """Take a command."""
        if self._delay > 0.0:
            self._waiting.append((self._world.time + self._delay, command))
        else:
            self._send(command)

    def _hand_over(self) -> None:
        while self._waiting and self._waiting[0][0] <= self._world.time + TIME_RESOLUTION:
            self._send(self._waiting.popleft()[1])
