"""One client's subscription of a topic: how often it is sent a message, and what waits meanwhile."""

from __future__ import annotations

import asyncio
import json
from collections import deque

from mbf_ros.rosbridge.client import Client


class Subscription:
    """One client's subscription of one topic, of one or more ids; the least throttle and the longest queue hold."""

    def __init__(self, client: Client, topic: str, spelling: str, depth: int) -> None:
        self._client = client
        self._topic = topic
        self._spelling = spelling
        self._depth = depth
        self._wishes: dict[str | None, tuple[float, int]] = {}
        self._held: deque[str] = deque()
        self._due = 0.0
        self._timer: asyncio.TimerHandle | None = None

    def wish(self, wish_id: str | None, throttle: float, queue: int) -> None:
        """Add an id with its least time between two messages [s] and how many may wait."""
        self._wishes[wish_id] = (throttle, queue)

    def withdraw(self, wish_id: str | None) -> bool:
        """Remove an id, all without one; whether none is left."""
        if wish_id is None:
            self._wishes.clear()
        self._wishes.pop(wish_id, None)
        if not self._wishes:
            self.drop_waiting()
        return not self._wishes

    def drop_waiting(self) -> None:
        """Send nothing of what has been offered and still waits."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        self._held.clear()
        self._client.outbox.forget(self._topic)

    def offer(self, text: str) -> None:
        """Send a frame now, or hold it until the next one is due."""
        if self._spelling != self._topic:  # the client knows the topic by this name only
            old, new = (f'"topic":{json.dumps(name)}' for name in (self._topic, self._spelling))
            text = text.replace(old, new, 1)
        throttle = min(throttle for throttle, _ in self._wishes.values())
        keep = max(1, *(queue for _, queue in self._wishes.values()))
        now = asyncio.get_running_loop().time()
        if self._timer is None and now >= self._due:
            self._due = now + throttle
            self._client.outbox.newest(self._topic, text, max(keep, 1 if throttle else self._depth))
            return
        while len(self._held) >= keep:
            self._held.popleft()
        self._held.append(text)
        if self._timer is None:
            self._timer = asyncio.get_running_loop().call_at(self._due, self._send_held)

    def _send_held(self) -> None:
        self._timer = None
        text = self._held.popleft()
        rest, self._held = self._held, deque()
        self._due = 0.0
        self.offer(text)
        for held in rest:
            self.offer(held)
