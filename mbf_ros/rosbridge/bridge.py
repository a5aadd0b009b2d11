"""What the operations of clients do, without sockets: the tables of topics, services and actions, and who may use them.

Everything here runs on the server's event loop, one operation after the other, and none of them waits.
"""

from __future__ import annotations

from collections.abc import Callable

from mbf_abstract.access.page_access import Role
from mbf_abstract.access.visitor import HangUp
from mbf_abstract.event_bus import EventBus
from mbf_abstract.event_values import error_text
from mbf_abstract.events import EventKind
from mbf_abstract.time.clock import Clock
from mbf_ros.messages.geometry import MessageContext
from mbf_ros.rosbridge.actions import ActionTable, free_id
from mbf_ros.rosbridge.authentication import Authentication
from mbf_ros.rosbridge.client import Client
from mbf_ros.rosbridge.offered_actions import OfferedActions
from mbf_ros.rosbridge.protocol import Operation, OperationError, absolute, frame, id_in, number_in, parsed, text_in
from mbf_ros.rosbridge.services import ServiceTable
from mbf_ros.rosbridge.topics import MAX_QUEUE, MAX_THROTTLE, TopicTable

WATCHING = {"subscribe", "unsubscribe", "call_service", "set_level", "auth"}
"""Operations of those who may only watch; of the services they may call those that change nothing."""
NOT_OFFERED = {
    "fragment": "send whole messages",
    "png": "this server does not compress",
    "advertise_service": "clients cannot offer services here",
}


class Bridge:
    """The tables, and what changes them.

    Parameters
    ----------
    clock : Clock
        Makes the threads of services that take time.
    events : EventBus
        Learns of clients, and of faults here.
    cancel_on_disconnect : bool
        Whether the goals of a client that is gone are canceled.
    """

    def __init__(
        self,
        clock: Clock,
        events: EventBus,
        context: MessageContext,
        authentication: Authentication,
        cancel_on_disconnect: bool = True,
    ) -> None:
        self.topics = TopicTable()
        self.services = ServiceTable(clock)
        self.actions = ActionTable(context)
        self.offered = OfferedActions()
        self._events = events
        self._authentication = authentication
        self._cancel_on_disconnect = cancel_on_disconnect
        self._operations: dict[str, Callable[[Client, Operation], None]] = {
            "advertise": self._advertise,
            "unadvertise": lambda client, op: self.topics.unadvertise(client, _topic(op)),
            "publish": lambda client, op: self.topics.publish(_topic(op), op.get("msg", {})),
            "subscribe": self._subscribe,
            "unsubscribe": lambda client, op: self.topics.unsubscribe(client, _topic(op), id_in(op)),
            "call_service": self._call_service,
            "send_action_goal": self._send_action_goal,
            "cancel_action_goal": lambda client, op: self.actions.cancel_goal(client, id_in(op)),
            "advertise_action": self._advertise_action,
            "unadvertise_action": lambda client, op: self.offered.withdraw(client, _action(op)),
            "action_feedback": lambda client, op: self.offered.feedback(client, _action(op), op),
            "action_result": lambda client, op: self.offered.result(client, _action(op), op),
            "set_level": lambda client, op: None,  # errors are always sent, and nothing else
            "auth": lambda client, op: None,  # of a client that needs none
        }

    def welcome(self, name: str, role: Role | None, hang_up: HangUp) -> Client:
        """Return the client of a new connection."""
        return Client(name, role, hang_up)

    def take(self, client: Client, text: str | bytes) -> None:
        """Do what a client asks for; what cannot be done is answered with a status of the level error."""
        operation_id = None
        try:
            operation = parsed(text)
            operation_id = id_in(operation)
            if client.role is None:
                self._authenticate(client, operation)
            else:
                self._operation(client, operation)(client, operation)
        except OperationError as error:
            client.refuse(str(error), operation_id)
        except Exception as error:  # a fault of ours must not take the connection along
            fault = f"{type(error).__name__}: {error_text(error)}"
            self._events.emit(EventKind.FAULT, "rosbridge", type=type(error).__name__, message=fault)
            client.refuse(f"an error in the server: {fault}", operation_id)

    def forget(self, client: Client) -> None:
        """End what a client that is gone has left; its goals, if it is so configured."""
        self.topics.forget(client)
        self.offered.forget(client)
        goals = list(client.goals.values())
        client.goals.clear()
        if self._cancel_on_disconnect:
            for handle in goals:
                handle.cancel("the client has disconnected")

    # ------------------------------------------------------------------------------------------------ operations
    def _authenticate(self, client: Client, operation: Operation) -> None:
        """Take ``auth`` of a client whose address had no token, and nothing else."""
        try:
            if operation["op"] != "auth":
                raise OperationError(f"{operation['op']}: this server needs a token, in the address or with auth")
            client.role = self._authentication.role(operation)
        except OperationError:
            client.hang_up("no access without the token")
            raise

    def _operation(self, client: Client, operation: Operation) -> Callable[[Client, Operation], None]:
        name = operation["op"]
        if name not in self._operations:
            reason = NOT_OFFERED.get(name, "it is not known")
            raise OperationError(f"the operation {name[:40]!r} is not offered: {reason}")
        if client.role is not Role.STEER and name not in WATCHING:
            raise OperationError(f"{name}: this client may only watch")
        return self._operations[name]

    def _advertise(self, client: Client, op: Operation) -> None:
        latched = op.get("latch") is True
        self.topics.advertise(client, _topic(op), text_in(op, "type"), latched)

    def _subscribe(self, client: Client, op: Operation) -> None:
        throttle, queue = number_in(op, "throttle_rate", MAX_THROTTLE), number_in(op, "queue_length", MAX_QUEUE)
        if op.get("compression") == "cbor-raw":
            raise OperationError("subscribe: cbor-raw is not offered; without compression messages come as JSON")
        self.topics.subscribe(client, text_in(op, "topic"), text_in(op, "type", ""), id_in(op), throttle, queue)

    def _call_service(self, client: Client, op: Operation) -> None:
        name = absolute(text_in(op, "service"))
        service = self.services.services.get(name)
        if client.role is not Role.STEER and service is not None and not service.changes_nothing:
            raise OperationError(f"call_service: this client may only watch, and {name} changes something")
        self.services.call(client, name, op.get("args"), id_in(op))

    def _send_action_goal(self, client: Client, op: Operation) -> None:
        name, kind = _action(op), text_in(op, "action_type", "")
        if name not in self.offered.offers:
            self.actions.send_goal(client, name, kind, id_in(op), op.get("args", {}), op.get("feedback") is True)
            return
        try:
            self.offered.send_goal(client, name, free_id(client, id_in(op)), op)
        except OperationError as error:
            failed = {"values": str(error), "status": 0, "result": False}
            client.outbox.answer(frame("action_result", id=id_in(op), action=name, **failed))

    def _advertise_action(self, client: Client, op: Operation) -> None:
        name = _action(op)
        if name in self.actions.actions:
            raise OperationError(f"advertise_action: {name} is the navigator's own")
        self.offered.offer(client, name, text_in(op, "type"))


def _topic(op: Operation) -> str:
    return absolute(text_in(op, "topic"))


def _action(op: Operation) -> str:
    return absolute(text_in(op, "action"))
