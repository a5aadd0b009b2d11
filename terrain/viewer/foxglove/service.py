"""What clients of the protocol ask for, without sockets; everything here runs on the server's event loop."""

from __future__ import annotations

import json
import secrets
from collections.abc import Callable, Iterable
from typing import Any

from mbf_abstract.access.outbox import Frame
from mbf_abstract.access.page_access import Role
from mbf_abstract.access.visitor import HangUp
from mbf_abstract.config.findings import describe_value
from mbf_abstract.event_values import error_text
from terrain.recording.recording import Recording
from terrain.viewer.foxglove import protocol
from terrain.viewer.foxglove.channels import Channels, FoxgloveClient
from terrain.viewer.foxglove.protocol import Call, Level, ProtocolError, Published, list_in, number_in, text_in
from terrain.viewer.foxglove.steering import INPUTS, SERVICES, Steering, advertised_services
from terrain.viewer.logs.run_messages import RunMessages

WATCHING = ("time", "parameters")
STEERING = (*WATCHING, "clientPublish", "services")
"""Capabilities, by what a client may do."""
MOST_PROBLEMS = 5  # of one operation that are named
UNHEARD = "unheard"
Operation = dict[str, Any]


class FoxgloveService:
    """Serves the messages of a run or a robot, and steers it for those who may.

    Parameters
    ----------
    name : str
        Shown by the app.
    post : callable
        Has a function called on the event loop.
    on_fault : callable
        Takes why messages could not be made.
    began : float
        Time [s] of what is there from the start.

    Attributes
    ----------
    is_ready : bool
        Whether the last part has been worked on, so that the next one is welcome.
    """

    def __init__(
        self,
        name: str,
        steering: Steering,
        post: Callable[..., None],
        on_fault: Callable[[Exception], None],
        began: float = 0.0,
    ) -> None:
        self.is_ready = True
        self._name, self._steering, self._post, self._began = name, steering, post, began
        self._on_fault = on_fault
        self._session_id = secrets.token_hex(8)
        self._channels = Channels(on_fault)
        self._messages: RunMessages | None = None
        self._operations: dict[str, Callable[[FoxgloveClient, Operation], None]] = {
            "subscribe": self._subscribe,
            "unsubscribe": self._unsubscribe,
            "advertise": self._advertise,
            "unadvertise": self._unadvertise,
            "getParameters": self._get_parameters,
            "setParameters": self._set_parameters,
        }

    @property
    def is_watched(self) -> bool:
        """Whether a client is connected."""
        return self._channels.has_clients

    # ------------------------------------------------------------------------------------------------ from the robot
    def publish(self, part: Recording) -> None:
        """Send what has happened since the last part."""
        try:
            self._messages = self._messages or RunMessages(part, self._began)
            self._channels.publish(self._messages.take(part))
        except Exception as error:  # the next part may be fine
            self._on_fault(error)
        finally:
            self.is_ready = True

    # ------------------------------------------------------------------------------------------------ from clients
    def welcome(self, name: str, role: Role | None, hang_up: HangUp) -> FoxgloveClient:
        """Return a new client, which is sent what there is; without a token it is sent away."""
        client = FoxgloveClient(name, role, hang_up)
        if role is None:
            client.hang_up("the address needs the token")
            return client
        steers = role is Role.STEER
        client.outbox.answer(protocol.server_info(self._name, self._session_id, STEERING if steers else WATCHING))
        client.outbox.answer(protocol.advertise(self._channels.advertised()))
        if steers:
            client.outbox.answer(protocol.advertise_services(advertised_services()))
        self._channels.welcome(client)
        return client

    def take(self, visitor: FoxgloveClient, frame: Frame) -> None:
        """Do what a client asks for; what cannot be done is answered with a status."""
        if visitor.role is None:
            return
        try:
            if isinstance(frame, bytes):
                self._take_binary(visitor, protocol.parsed_binary(frame))
            else:
                self._take_text(visitor, protocol.parsed(frame))
        except ProtocolError as error:
            _report(visitor, str(error))
        except Exception as error:  # a fault of ours must not take the connection along
            _report(visitor, f"an error in the server: {type(error).__name__}: {error_text(error)}")

    def forget(self, visitor: FoxgloveClient) -> None:
        """Send nothing more to a client; its goals go on, as those of topics do."""
        self._channels.forget(visitor)

    def _take_text(self, client: FoxgloveClient, operation: Operation) -> None:
        take = self._operations.get(operation["op"])
        if take is None:
            raise ProtocolError(f"the operation {operation['op'][:40]!r} is not offered")
        take(client, operation)

    def _take_binary(self, client: FoxgloveClient, found: Published | Call) -> None:
        if isinstance(found, Call):
            self._call(client, found)
            return
        _require_steering(client)
        if found.channel not in client.inputs:
            raise ProtocolError(f"channel {found.channel} has not been advertised")
        self._steering.take(client.inputs[found.channel], protocol.json_in(found.payload))

    def _call(self, client: FoxgloveClient, call: Call) -> None:
        names = list(SERVICES)
        if client.role is not Role.STEER:
            client.outbox.answer(protocol.service_failure(call, "this client may only watch"))
        elif call.encoding != "json" or not 0 < call.service <= len(names):
            expected = f"a service from 1 to {len(names)}, called with json"
            got = f"service {call.service} with {describe_value(call.encoding)}"
            client.outbox.answer(protocol.service_failure(call, f"expected {expected}, got {got}"))
        else:
            name = names[call.service - 1]
            self._steering.call(name)
            answer = json.dumps({"success": True, "message": SERVICES[name]})
            client.outbox.answer(protocol.service_response(call, answer.encode()))

    # ------------------------------------------------------------------------------------------------ operations
    def _subscribe(self, client: FoxgloveClient, operation: Operation) -> None:
        def subscribe(one: Any) -> None:
            self._channels.subscribe(client, number_in(one, "channelId"), number_in(one, "id"))

        _for_each(list_in(operation, "subscriptions"), subscribe)

    def _unsubscribe(self, client: FoxgloveClient, operation: Operation) -> None:
        def unsubscribe(number: Any) -> None:
            self._channels.unsubscribe(client, number_in({"id": number}, "id"))

        _for_each(list_in(operation, "subscriptionIds"), unsubscribe)

    def _advertise(self, client: FoxgloveClient, operation: Operation) -> None:
        """Take messages on topics of ours; the app announces others, too, which nobody listens to."""
        _require_steering(client)

        def advertise(one: Any) -> None:
            number, topic = number_in(one, "id"), text_in(one, "topic")
            if topic not in INPUTS:
                text = f"{topic[:80]!r}: nobody listens; poses and places are taken on {', '.join(INPUTS)}"
                client.outbox.newest(UNHEARD, protocol.status(Level.INFO, text))
                return
            if (encoding := text_in(one, "encoding")) != "json":
                raise ProtocolError(f"{topic!r}: expected the encoding json, got {describe_value(encoding)}")
            client.inputs[number] = topic

        _for_each(list_in(operation, "channels"), advertise)

    def _unadvertise(self, client: FoxgloveClient, operation: Operation) -> None:
        def unadvertise(number: Any) -> None:
            client.inputs.pop(number_in({"id": number}, "id"), None)

        _for_each(list_in(operation, "channelIds"), unadvertise)

    def _get_parameters(self, client: FoxgloveClient, operation: Operation) -> None:
        names = {text_in({"name": name}, "name") for name in list_in(operation, "parameterNames")}
        client.outbox.answer(protocol.parameter_values(self._steering.parameters(names), _request(operation)))

    def _set_parameters(self, client: FoxgloveClient, operation: Operation) -> None:
        _require_steering(client)
        changes = {text_in(one, "name"): one.get("value") for one in list_in(operation, "parameters")}
        request = _request(operation)

        def change() -> None:
            problem = ""
            try:
                self._steering.set_parameters(changes)
            except ValueError as error:
                problem = error_text(error)
            except Exception as error:  # of a plugin that was changed; the app waits for an answer
                problem = f"{type(error).__name__}: {error_text(error)}"
            self._post(self._answer_change, client, list(changes), request, problem)

        self._steering.post(change)

    def _answer_change(self, client: FoxgloveClient, names: list[str], request: str | None, problem: str) -> None:
        """Send the values that hold now, and why they are not those that were asked for."""
        if problem:
            _report(client, problem)
        client.outbox.answer(protocol.parameter_values(self._steering.parameters(names), request))


def _for_each(items: Iterable[Any], take: Callable[[Any], None]) -> None:
    """Take each; raises ProtocolError, for the first ones that are wrong, once the others have been taken."""
    problems = []
    for one in items:
        try:
            take(one)
        except ProtocolError as error:
            problems.append(str(error))
    if problems:
        more = f"; and {len(problems) - MOST_PROBLEMS} more" if len(problems) > MOST_PROBLEMS else ""
        raise ProtocolError("; ".join(problems[:MOST_PROBLEMS]) + more)


def _require_steering(client: FoxgloveClient) -> None:
    if client.role is not Role.STEER:
        raise ProtocolError("this client may only watch")


def _request(operation: Operation) -> str | None:
    return text_in(operation, "id") if operation.get("id") is not None else None


def _report(client: FoxgloveClient, text: str) -> None:
    client.outbox.answer(protocol.status(Level.ERROR, text))
