"""Services: a type and a function from request to response. What may take a while runs on a thread of its own."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

from mbf_abstract.time.clock import Clock
from mbf_ros.messages.interfaces import Message, MessageError, completed, known_types
from mbf_ros.rosbridge.client import Client
from mbf_ros.rosbridge.protocol import OperationError, frame, no_such

MAX_CALLS = 20
"""How many calls of one client may be worked on at a time."""


@dataclass(frozen=True)
class Service:
    """One service.

    Attributes
    ----------
    type : str
        ``package/srv/Name``, or what clients know.
    call : callable
        Takes a request and returns the response; raises an exception whose text is for the client.
    takes_time : bool
        Call it on a thread of its own.
    changes_nothing : bool
        Whether those may call it who only watch.
    """

    type: str
    call: Callable[[Message], Message]
    takes_time: bool = False
    changes_nothing: bool = False

    def request(self, values: object) -> Message:
        """Return the checked request of a client; raises MessageError."""
        name = f"{self.type}_Request"
        if name in known_types():
            return completed(name, values or {}, self.type)
        if not isinstance(values or {}, dict):
            raise MessageError(f"{self.type}: expected an object, got {values!r}")
        return dict(values or {})  # type: ignore[call-overload, no-any-return]


class ServiceTable:
    """Services by name; used on the event loop only."""

    def __init__(self, clock: Clock) -> None:
        self.services: dict[str, Service] = {}
        self._clock = clock

    def call(self, client: Client, name: str, values: object, call_id: str | None) -> None:
        """Call a service, and answer the client when there is a response."""
        service = self.services.get(name)
        try:
            if service is None:
                raise OperationError(no_such("service", name, self.services))
            if client.calls >= MAX_CALLS:
                raise OperationError(f"{MAX_CALLS} services of this client are being worked on already")
            request = service.request(values)
        except (OperationError, MessageError) as error:
            self._answer(client, name, call_id, str(error), False)
            return
        if service.takes_time:
            self._call_on_thread(client, service, name, request, call_id)
        else:
            self._answer(client, name, call_id, *_outcome(service, request))

    def _call_on_thread(
        self, client: Client, service: Service, name: str, request: Message, call_id: str | None
    ) -> None:
        loop = asyncio.get_running_loop()
        client.calls += 1

        def finish(values: object, succeeded: bool) -> None:
            client.calls -= 1
            self._answer(client, name, call_id, values, succeeded)

        def run() -> None:
            outcome = _outcome(service, request)
            with suppress(RuntimeError):  # the server is closed
                loop.call_soon_threadsafe(finish, *outcome)

        self._clock.spawn(run, f"service {name}")

    @staticmethod
    def _answer(client: Client, name: str, call_id: str | None, values: object, succeeded: bool) -> None:
        client.outbox.answer(frame("service_response", id=call_id, service=name, values=values, result=succeeded))


def _outcome(service: Service, request: Message) -> tuple[object, bool]:
    """The response and True, or why there is none and False."""
    try:
        return service.call(request), True
    except Exception as error:  # of a map, a transform or a parameter: all are answers here
        return f"{type(error).__name__}: {error}", False
