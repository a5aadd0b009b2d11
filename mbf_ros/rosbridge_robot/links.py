"""The two connections to a robot: one on which only commands go out, and one for all the rest."""

from __future__ import annotations

import secrets
import threading
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial

from mbf_abstract.event_values import error_text
from mbf_abstract.time.clock import Clock, unix_seconds
from mbf_ros.ros2.robot import Arrivals
from mbf_ros.rosbridge.authentication import auth_frame
from mbf_ros.rosbridge.protocol import Operation, OperationError, frame
from mbf_ros.rosbridge_robot.connection import Backoff, Connection, NotConnectedError
from mbf_ros.rosbridge_robot.dialing import LinkError, dial
from mbf_ros.rosbridge_robot.frames import cbor_decoder, operation_of
from mbf_ros.rosbridge_robot.options import LinkOptions
from mbf_ros.rosbridge_robot.topics import Reports

SERVER = "the server of the robot"
QUESTION = "mbf: are you there"
Greeting = Callable[[], Iterable[str]]


@dataclass
class Asked:
    """What a server did before it answered the first question: its complaints, and why it hung up, if it did."""

    complaints: list[str] = field(default_factory=list)
    lost: str = ""
    over: threading.Event = field(default_factory=threading.Event)


class RobotLinks:
    """The connections.

    Parameters
    ----------
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
        self._options, self._reports, self._on_fault, self._on_change = options, reports, on_fault, on_change
        self._asked: Asked | None = None
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
                partial(self._change, name),
                self._report_fault,
            )
            for name, greeting in zip(("commands", "data"), greetings, strict=True)
        )

    def open_data(self) -> None:
        """Connect for the first time, and ask something that every server answers, if only by a refusal.

        A server that asks for a proof hangs up where that is missing or wrong. One that says nothing counts as open.

        Raises
        ------
        LinkError
            The robot cannot be reached, or its server has hung up before it answered.
        """
        self._asked = asked = Asked()
        self.data.open()
        with suppress(NotConnectedError):
            self.data.answer(frame("call_service", id=QUESTION, service="/rosapi/get_time"))
        asked.over.wait(self._options.open_timeout)
        self._asked = None
        if asked.lost:
            raise LinkError(self._refusal(asked))
        for complaint in asked.complaints:
            self._reports.bad(SERVER, complaint)

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

    def _change(self, name: str, problem: str) -> None:
        if self._asked is None:
            self._on_change(name, problem)
        elif problem:
            self._asked.lost = self._asked.lost or problem
            self._asked.over.set()

    def _refusal(self, asked: Asked) -> str:
        """What it means that the server has hung up before it answered."""
        said = "; ".join([*asked.complaints, asked.lost])
        if not self._options.secret:
            return f"the robot's server hung up ({said}); if it asks for auth, give --secret-file"
        return f"the robot's server hung up ({said}): the secret is wrong, or the calendars differ; auth needs NTP"

    def _complain(self, text: str) -> None:
        if self._asked is None:
            self._reports.bad(SERVER, text)
        else:
            self._asked.complaints.append(text)

    def _take(self, received: str | bytes) -> None:
        try:
            operation = operation_of(received, self._decode_cbor)
            if operation["op"] == "status" and operation.get("level") in ("error", "warning"):
                self._complain(str(operation.get("msg"))[:300])
            if operation["op"] == "service_response" and self._asked is not None:
                self._asked.over.set()
            if handler := self.handlers.get(operation["op"]):
                handler(operation)
        except OperationError as error:
            self._complain(str(error))
        except Exception as error:  # a fault of ours must not take the connection along
            self._report_fault(error)

    def _report_fault(self, error: Exception) -> None:
        self._on_fault(f"{type(error).__name__}: {error_text(error)}")


class LinkArrivals(Arrivals):
    """Arrivals over connections: what is heard of a robot counts only while both are there."""

    def __init__(self, now: Callable[[], float], links: Callable[[], RobotLinks]) -> None:
        super().__init__(now)
        self._links = links

    def problems(self, limit: float) -> dict[str, str]:
        """As ``Arrivals.problems``, after which connection is lost, and why."""
        return {"rosbridge": self._links().problem, **super().problems(limit)}
