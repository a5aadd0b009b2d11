"""Hands commands to the robot's driver, never under a lock: a driver that blocks holds up its caller only.

One call runs at a time. A stop that is asked for during a call is sent by whoever is in that call as soon as it
returns, so zero is the last command after every call that came back late. While a call lasts, no motion is begun.
"""

from __future__ import annotations

import inspect

from mbf_abstract.drive.commands import stands_still, zero_like
from mbf_abstract.drive.robot import Robot
from mbf_abstract.event_bus import EventBus
from mbf_abstract.event_values import error_text
from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Command, Twist
from mbf_abstract.time.clock import Clock, Condition, ThreadDetached
from mbf_abstract.time.program_end import is_for_the_program


class CommandWriter:
    """The calls of one driver's ``send_command``.

    Parameters
    ----------
    condition : Condition
        The gate's lock. ``deliver`` is called without it, all other methods with it.

    Attributes
    ----------
    last_command : Command
        The last command to the robot; a motion counts from the start of its call, a stop once it is delivered.
    last_time : float
        When the last command was delivered, or the first motion after a stand begun [s].
    problem : str
        Why the last command was not delivered; empty if it was.
    """

    def __init__(self, robot: Robot, clock: Clock, events: EventBus, condition: Condition) -> None:
        self._robot = robot
        self._clock = clock
        self._events = events
        self._condition = condition
        self._calls = 0
        self._waiting = 0
        self._stop_due = False
        self.last_command: Command = Twist()
        self.last_time = clock.now()
        self.problem = ""

    @property
    def busy(self) -> bool:
        """Whether a call is running, or hangs."""
        return self._calls > 0

    @property
    def stands(self) -> bool:
        """Whether zero was the last command to the robot."""
        return stands_still(self.last_command)

    def silence(self, timeout: float) -> str:
        """Why the robot is stopped that has had no command for ``timeout`` [s]."""
        what = "send_command has not returned" if self.busy else "no command"
        return f"{what} for {self._clock.now() - self.last_time:.3f} s (command_timeout {timeout:g} s)"

    def wait_until_free(self, limit: float) -> None:
        """Wait at most ``limit`` [s] for the end of the running call."""
        deadline = self._clock.now() + limit
        self._waiting += 1
        try:
            while self.busy and (remaining := deadline - self._clock.now()) > 0.0:
                self._condition.wait(remaining)
        finally:
            self._waiting -= 1

    def begin(self, command: Command) -> Command:
        """Announce a motion that ``deliver`` is to send; only while not ``busy``."""
        if self.stands:
            self.last_time = self._clock.now()
            self._condition.notify_all()  # the watchdog sleeps while zero is commanded
        self._calls += 1
        self.last_command = command
        return command

    def begin_stop(self, although_busy: bool = False) -> Command | None:
        """Announce the zero that ``deliver`` is to send; None where the running call will send it.

        With ``although_busy`` zero is sent beside a call that hangs, and once more when that call returns.
        """
        self._stop_due = self.busy
        if self.busy and not although_busy:
            return None
        self._calls += 1
        return zero_like(self.last_command)

    def deliver(self, command: Command | None) -> bool:
        """Call the driver with an announced command, then with the zero that is due; whether the first got through."""
        delivered = True
        passing: BaseException | None = None
        while command is not None:
            again = False
            try:
                problem = self._call(command)
            except ThreadDetached as error:  # what is due is still to be sent before this thread ends
                problem, passing = "send_command kept the processor busy for too long", error
            except BaseException as error:  # Ctrl-C or SIGTERM: passed on, but not before zero was sent
                problem, again, passing = f"{type(error).__name__} came in between", passing is None, error
            with self._condition:
                following = self._end_call(command, problem, again)
            delivered = delivered and not problem
            command = following
        if passing is not None:
            raise passing
        return delivered

    def _call(self, command: Command) -> str:
        """Why the driver did not take the command; empty if it did."""
        try:
            with self._clock.guarded("robot.send_command"):
                answer: object = self._robot.send_command(command)  # type: ignore[func-returns-value]
            if inspect.iscoroutine(answer):
                answer.close()
                raise TypeError("it returned a coroutine, which is not awaited")
        except BaseException as error:
            if isinstance(error, ThreadDetached) or is_for_the_program(error):
                raise
            kind, text = type(error).__name__, error_text(error)
            self._events.emit(EventKind.FAULT, "robot", where="send_command", type=kind, message=text)
            return f"send_command raised {kind}: {text}"
        return ""

    def _end_call(self, command: Command, problem: str, again: bool) -> Command | None:
        """Note how a call ended; the zero that is due after it, or wanted ``again``, announced."""
        self._calls -= 1
        self.problem = problem
        if not problem or not stands_still(command):
            self.last_command = command
        if not problem and not self._stop_due:
            self.last_time = self._clock.now()
        if problem or self._stop_due or self._waiting or stands_still(command):
            self._condition.notify_all()
        return self.begin_stop() if (self._stop_due or again) and not self.busy else None
