"""The two connections to a robot: one on which only commands go out, and one for all the rest."""

from __future__ import annotations

import secrets
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import partial

from mbf_abstract.event_values import error_text
from mbf_abstract.time.clock import Clock, unix_seconds
from mbf_ros.ros2.robot import Arrivals
from mbf_ros.rosbridge.protocol import Operation, OperationError
from mbf_ros.rosbridge_robot.connection import Backoff, Connection, NotConnectedError
from mbf_ros.rosbridge_robot.dialing import dial
from mbf_ros.rosbridge_robot.frames import cbor_decoder, operation_of
from mbf_ros.rosbridge_robot.options import LinkOptions
from mbf_ros.rosbridge_robot.proof import auth_frame
from mbf_ros.rosbridge_robot.topics import Reports

SERVER = "the server of the robot"
Greeting = Callable[[], Iterable[str]]


class RobotLinks:
    """The connections.

    Parameters
    ----------
    address : str
    options : LinkOptions
    clock : Clock
        Real time.
    reports : Reports
        Of frames that mean nothing, and of complaints of the server.
    greetings : callable, callable
        The frames with which the command and the data connection begin, after the proof of the secret.
    on_change : callable
        Called with the name of a connection and the reason when it is lost, with an empty text when it is open again.
    on_fault : callable
        Takes the text of an exception that no frame may raise.

    Attributes
    ----------
    commands, data : Connection
    handlers : dict of str to callable
        What takes the operations that come on the data connection, by name; may raise OperationError.

    Raises
    ------
    LinkError
        A package is missing.
    """

    def __init__(
        self,
        address: str,
        options: LinkOptions,
        clock: Clock,
        reports: Reports,
        greetings: tuple[Greeting, Greeting],
        on_change: Callable[[str, str], None],
        on_fault: Callable[[str], None],
    ) -> None:
        self._options, self._reports, self._on_fault = options, reports, on_fault
        self._decode_cbor = cbor_decoder()
        self.handlers: dict[str, Callable[[Operation], None]] = {}
        self.commands, self.data = (
            Connection(
                name,
                partial(dial, address, options),
                clock,
                Backoff(options.first_delay, options.longest_delay),
                partial(self._greeting, greeting),
                self._take,
                partial(on_change, name),
                self._report_fault,
            )
            for name, greeting in zip(("commands", "data"), greetings, strict=True)
        )

    @property
    def problem(self) -> str:
        """Which connection is lost, and why; empty if none."""
        return self.commands.problem or self.data.problem

    def post(self, frames: Iterable[str]) -> None:
        """Send frames on the data connection that a new one begins with, too; without a connection do nothing."""
        with suppress(NotConnectedError):
            for text in frames:
                self.data.answer(text)

    def close(self) -> None:
        """End both connections; idempotent."""
        self.commands.close()
        self.data.close()

    def _greeting(self, greeting: Greeting) -> list[str]:
        secret = self._options.secret
        proof = [auth_frame(secret, unix_seconds, lambda: secrets.token_hex(16))] if secret else []
        return [*proof, *greeting()]

    def _take(self, received: str | bytes) -> None:
        try:
            operation = operation_of(received, self._decode_cbor)
            if operation["op"] == "status" and operation.get("level") in ("error", "warning"):
                self._reports.bad(SERVER, str(operation.get("msg"))[:300])
            if handler := self.handlers.get(operation["op"]):
                handler(operation)
        except OperationError as error:
            self._reports.bad(SERVER, str(error))
        except Exception as error:  # a fault of ours must not take the connection along
            self._report_fault(error)

    def _report_fault(self, error: Exception) -> None:
        self._on_fault(f"{type(error).__name__}: {error_text(error)}")


class LinkArrivals(Arrivals):
    """Arrivals over connections: what is heard of a robot counts only while both are there."""

    def __init__(self, now: Callable[[], float], links: Callable[[], RobotLinks]) -> None:
        super().__init__(now)
        self._links = links

    def problem(self, limit: float) -> str:
        """Which connection is lost, or which topic has been silent for longer than ``limit`` [s]; empty if none."""
        return self._links().problem or super().problem(limit)
