"""The channels of the server: their schemas, who listens, and what one who comes later needs of each.

Messages are made and written when somebody listens, once for all. Everything here runs on the server's event loop.
"""

from __future__ import annotations

import base64
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

from mcap_protobuf.schema import build_file_descriptor_set

from mbf_abstract.access.visitor import Visitor
from terrain.viewer.foxglove.protocol import ProtocolError, message_data, server_time
from terrain.viewer.logs.event_messages import Stamped
from terrain.viewer.logs.foxglove_messages import nanoseconds
from terrain.viewer.logs.run_messages import TOPICS, bytes_of, json_schema

NUMBERS = {topic: number for number, topic in enumerate(TOPICS, 1)}
HISTORY = 1000
"""How many messages of a topic without a state wait for a slow client; older ones are dropped."""
WAITING = {"/tf": 100, "/actions": 100, "/scan": 10, "/objects": 10}
"""How many of a state, whose messages are small or few; of the others the newest of each part."""
TIME = "time"


@dataclass(eq=False)
class FoxgloveClient(Visitor):
    """A connected client.

    Attributes
    ----------
    subscriptions : dict of str to int
        The number that it has given its subscription, by topic.
    inputs : dict of int to str
        Topics that it publishes, by the numbers of its channels.
    """

    subscriptions: dict[str, int] = field(default_factory=dict)
    inputs: dict[int, str] = field(default_factory=dict)


class Written:
    """A message as bytes, once they are needed."""

    def __init__(self, message: Stamped) -> None:
        self.topic, self.part, self.stamp = message.topic, message.part, nanoseconds(message.time)
        self._make = message.make
        self._payload: bytes | None = None

    def put(self, client: FoxgloveClient) -> None:
        """Put the message into the outbox of a client that listens to its topic."""
        if self._payload is None:
            self._payload = bytes_of(self._make())
        frame = message_data(client.subscriptions[self.topic], self.stamp, self._payload)
        keep = WAITING.get(self.topic, 1) if self.part is not None else HISTORY
        client.outbox.newest((self.topic, self.part), frame, keep)


class Channels:
    """The table of channels.

    Parameters
    ----------
    on_fault : callable
        Takes why a message could not be made; the others are sent.
    """

    def __init__(self, on_fault: Callable[[Exception], None]) -> None:
        self._on_fault = on_fault
        self._state: dict[str, dict[str, Written]] = {topic: {} for topic in TOPICS}
        self._clients: set[FoxgloveClient] = set()

    @property
    def has_clients(self) -> bool:
        """Whether anybody could listen; may be asked on any thread."""
        return bool(self._clients)

    @staticmethod
    def advertised() -> list[dict[str, Any]]:
        """All channels with their schemas."""
        return [{"id": number, "topic": topic, **_schema(topic)} for topic, number in NUMBERS.items()]

    def publish(self, messages: Iterable[Stamped]) -> None:
        """Hand messages to those who listen, and keep what shows the present state."""
        newest = None
        for one in messages:
            newest, listeners = one.time, [client for client in self._clients if one.topic in client.subscriptions]
            if one.part is None and not listeners:
                continue
            written = Written(one)
            if one.part is not None:
                self._state[one.topic].pop(one.part, None)  # so that the newest comes last
                self._state[one.topic][one.part] = written
            for client in listeners:
                self._put(written, client)
        if newest is not None:
            for client in self._clients:
                client.outbox.newest(TIME, server_time(nanoseconds(newest)))

    def welcome(self, client: FoxgloveClient) -> None:
        """Add a client."""
        self._clients.add(client)

    def forget(self, client: FoxgloveClient) -> None:
        """Send nothing more to a client."""
        self._clients.discard(client)

    def subscribe(self, client: FoxgloveClient, number: int, subscription: int) -> None:
        """Let a client listen, and send it the present state of the channel."""
        topic = next((topic for topic, own in NUMBERS.items() if own == number), None)
        if topic is None:
            raise ProtocolError(f"there is no channel {number}")
        if topic in client.subscriptions or subscription in client.subscriptions.values():
            raise ProtocolError(f"subscription {subscription}: its number is used, or {topic} is subscribed to already")
        client.subscriptions[topic] = subscription
        for written in self._state[topic].values():
            self._put(written, client)

    def unsubscribe(self, client: FoxgloveClient, subscription: int) -> None:
        """End a subscription, and drop what waits of it."""
        topic = next((topic for topic, own in client.subscriptions.items() if own == subscription), None)
        if topic is None:
            raise ProtocolError(f"there is no subscription {subscription}")
        del client.subscriptions[topic]
        for kind in [(topic, None), *((topic, part) for part in self._state[topic])]:
            client.outbox.forget(kind)

    def _put(self, written: Written, client: FoxgloveClient) -> None:
        try:
            written.put(client)
        except Exception as error:
            self._on_fault(error)


def _schema(topic: str) -> dict[str, str]:
    """Encoding and schema of a topic."""
    schema = TOPICS[topic]
    if isinstance(schema, str):
        return {"encoding": "json", "schemaName": schema, "schema": json_schema(schema), "schemaEncoding": "jsonschema"}
    files = build_file_descriptor_set(schema).SerializeToString(deterministic=True)
    name: str = schema.DESCRIPTOR.full_name
    return {
        "encoding": "protobuf",
        "schemaName": name,
        "schema": base64.b64encode(files).decode(),
        "schemaEncoding": "protobuf",
    }
