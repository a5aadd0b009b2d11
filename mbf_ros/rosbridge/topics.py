"""Topics: who publishes, who listens, and how often. The server is the hub: clients hear each other through it.

A message of a known type is checked, whoever publishes it; one of another type goes on as it is. A topic of the
navigator's own cannot be published by clients: the velocity gate stays the only one that commands the robot.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from mbf_ros.messages.interfaces import Message, MessageError, completed, full_name, known_types
from mbf_ros.rosbridge.client import Client
from mbf_ros.rosbridge.protocol import OperationError, absolute, frame
from mbf_ros.rosbridge.subscription import Subscription

MAX_TOPICS = 500
MAX_THROTTLE, MAX_QUEUE = 3_600_000, 1000  # ms, messages
DEPTH = 10
"""How many messages of a topic wait for a client that asks for no queue; the default of ROS."""


@dataclass(eq=False)
class Topic:
    """A topic.

    Attributes
    ----------
    type : str
        Full name of its messages.
    is_ours : bool
        Whether the navigator publishes it.
    is_shared : bool
        Whether clients may publish what is ours, too.
    outdates : str
        Topic whose waiting messages are dropped when one of this is sent; of this one only the newest waits.
    on_message : callable, optional
        Takes what clients publish.
    latched : str, optional
        The frame that every new subscriber gets first.
    keeps_last : bool
        Whether the last message becomes the latched one.
    newcomers : int
        How often somebody has begun to listen.
    depth : int
        How many messages wait for a client that asks neither for a queue nor for a throttle.
    """

    type: str
    is_ours: bool = False
    is_shared: bool = False
    outdates: str = ""
    on_message: Callable[[Message], None] | None = None
    latched: str | None = None
    keeps_last: bool = False
    newcomers: int = 0
    depth: int = DEPTH
    publishers: set[Client] = field(default_factory=set)
    subscriptions: dict[Client, Subscription] = field(default_factory=dict)


class TopicTable:
    """All topics by name; used on the event loop, but for ``is_wanted``."""

    def __init__(self) -> None:
        self._topics: dict[str, Topic] = {}

    def __getitem__(self, name: str) -> Topic:
        return self._topics[name]

    def types(self) -> dict[str, str]:
        """Types by the names of the topics, sorted."""
        return {name: self._topics[name].type for name in sorted(self._topics)}

    # ------------------------------------------------------------------------------------- for the navigator
    def add_output(
        self,
        name: str,
        type_name: str,
        latched: bool = False,
        depth: int = DEPTH,
        shared: bool = False,
        outdates: str = "",
    ) -> None:
        """Add a topic that the navigator publishes; a latched one sends its last message to new subscribers."""
        self._topics[name] = Topic(
            full_name(type_name), is_ours=True, is_shared=shared, outdates=outdates, keeps_last=latched, depth=depth
        )

    def add_input(self, name: str, type_name: str, on_message: Callable[[Message], None]) -> None:
        """Add a topic that the navigator listens to; ``on_message`` may raise MessageError."""
        self._topics[name] = Topic(full_name(type_name), on_message=on_message)

    def is_wanted(self, name: str) -> bool:
        """Whether a message now has a use: somebody listens, or will get it later. On any thread."""
        topic = self._topics[name]
        return topic.keeps_last or bool(topic.subscriptions)

    def audience(self, name: str) -> tuple[int, int]:
        """How many listen, and how often somebody has begun to. On any thread."""
        topic = self._topics[name]
        return len(topic.subscriptions), topic.newcomers

    def send(self, name: str, text: str) -> None:
        """Send the frame of a message to those who listen."""
        topic = self._topics[name]
        if topic.keeps_last:
            topic.latched = text
        if topic.outdates:
            for subscription in self._topics[topic.outdates].subscriptions.values():
                subscription.drop_waiting()
        for subscription in topic.subscriptions.values():
            subscription.offer(text)

    # ------------------------------------------------------------------------------------------ for clients
    def advertise(self, client: Client, name: str, type_name: str, latched: bool) -> None:
        """Let a client publish a topic; raises OperationError where it is ours, or has another type."""
        topic = self._of_type(name, type_name)
        if topic.is_ours and not topic.is_shared:
            raise OperationError(f"advertise: {name} is published by the navigator only")
        topic.keeps_last = topic.keeps_last or latched
        topic.publishers.add(client)

    def unadvertise(self, client: Client, name: str) -> None:
        """Let a client publish a topic no more."""
        if name in self._topics:
            self._topics[name].publishers.discard(client)
            self._drop_unused(name)

    def publish(self, name: str, values: Any) -> None:
        """Take a message of a client, and send it to those who listen.

        Raises
        ------
        OperationError
            The topic is ours, was not advertised, or the message is not of its type.
        """
        topic = self._topics.get(name)
        if topic is None:
            raise OperationError(f"publish: {name} was not advertised, so its type is not known")
        if topic.is_ours and not topic.is_shared:
            raise OperationError(f"publish: {name} is published by the navigator only")
        try:
            message = completed(topic.type, values) if topic.type in known_types() else values
            if topic.on_message is not None:
                topic.on_message(message)
        except MessageError as error:
            raise OperationError(f"publish: {name}: {error}") from error
        if topic.subscriptions or topic.keeps_last:
            self.send(name, frame("publish", topic=name, msg=message))

    def subscribe(
        self, client: Client, spelling: str, type_name: str, wish_id: str | None, throttle: int, queue: int
    ) -> None:
        """Let a client listen, at most once in ``throttle`` [ms]; raises OperationError where it has another type."""
        name = absolute(spelling)
        topic = self._of_type(name, type_name) if type_name or name not in self._topics else self._topics[name]
        subscription = topic.subscriptions.setdefault(client, Subscription(client, name, spelling, topic.depth))
        topic.newcomers += 1
        subscription.wish(wish_id, throttle / 1000.0, 0 if topic.outdates else queue)
        if topic.latched is not None:
            subscription.offer(topic.latched)

    def unsubscribe(self, client: Client, name: str, wish_id: str | None) -> None:
        """End the subscription of one id, or of all."""
        topic = self._topics.get(name)
        if topic is not None and client in topic.subscriptions and topic.subscriptions[client].withdraw(wish_id):
            del topic.subscriptions[client]
            self._drop_unused(name)

    def forget(self, client: Client) -> None:
        """End everything of a client that is gone."""
        for name in list(self._topics):
            self.unsubscribe(client, name, None)
            self.unadvertise(client, name)

    def _of_type(self, name: str, type_name: str) -> Topic:
        """The topic of a name, new where there is none; raises OperationError where it has another type."""
        wanted = full_name(type_name)
        if name not in self._topics:
            if len(self._topics) >= MAX_TOPICS:
                raise OperationError(f"there are {MAX_TOPICS} topics already")
            if not wanted:
                raise OperationError(f"the topic {name!r} is not known, so its type must be given")
            self._topics[name] = Topic(wanted)
        if self._topics[name].type != wanted:
            raise OperationError(f"the topic {name!r}: expected the type {self._topics[name].type}, got {wanted}")
        return self._topics[name]

    def _drop_unused(self, name: str) -> None:
        topic = self._topics[name]
        if not (topic.is_ours or topic.on_message or topic.publishers or topic.subscriptions):
            del self._topics[name]
