"""Whether the client of a goal is gone: killed, crashed, disconnected or ended.

ROS 2 does not say who sent a goal. What DDS shows is who listens to the feedback of an action, and every action client
does. So a goal belongs to all clients that were there when it came; when none of them is there any more, its client is
gone. Who only listens, as ``ros2 topic echo`` and recorders do, is no client: it has no ``send_goal``.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Any

JOINING_LOOKS = 2
"""Looks at which clients still join a goal: the first may come at once, before DDS has shown a client that is new."""


@dataclass
class _Goal:
    """Who may have sent a goal, and how many looks have followed since it came."""

    clients: frozenset[bytes]
    looks: int = 0

    def see(self, present: frozenset[bytes]) -> bool:
        """Take what one look has shown; returns whether the client is gone."""
        self.looks += 1
        if self.looks <= JOINING_LOOKS or not self.clients:
            self.clients |= present
        return bool(self.clients) and not self.clients & present


class GoalClients:
    """Finds the goals of an action whose clients are gone.

    Parameters
    ----------
    look : callable
        Returns identifiers of the clients of the action, now.
    """

    def __init__(self, look: Callable[[], frozenset[bytes]]) -> None:
        self._look = look
        self._goals: dict[bytes, _Goal] = {}

    def welcome(self, goal: bytes) -> None:
        """Note who may have sent a goal that has come just now."""
        self._goals[goal] = _Goal(self._look())

    def abandoned(self, goals: Collection[bytes]) -> list[bytes]:
        """Return those of all unfinished goals whose clients are gone; forget goals that are not among them.

        DDS may show a client later than its goal comes. So those that the next ``JOINING_LOOKS`` looks show, or the
        first that shows any, count as if they had been there.
        """
        present = self._look() if goals else frozenset()
        self._goals = {goal: self._goals.get(goal) or _Goal(frozenset()) for goal in goals}
        return [goal for goal, its in self._goals.items() if its.see(present)]


def action_clients(node: Any, action: str) -> frozenset[bytes]:
    """Return the identifiers (GID) of the clients of an action of a node, by what they listen to its feedback with.

    Where the graph does not say which node listens, or has several of its name, the listener counts as a client.
    """
    found = node.get_subscriptions_info_by_topic(f"{action}/_action/feedback")
    nodes = node.get_node_names_and_namespaces()
    service = node.resolve_service_name(f"{action}/_action/send_goal")

    def is_client(name: str, namespace: str) -> bool:
        if nodes.count((name, namespace)) != 1:
            return True
        try:
            return service in dict(node.get_client_names_and_types_by_node(name, namespace))
        except RuntimeError:  # rclpy's NodeNameNonExistentError: the node has gone meanwhile
            return True

    return frozenset(bytes(one.endpoint_gid) for one in found if is_client(one.node_name, one.node_namespace))
