"""Whether the client of a goal is gone: killed, crashed, disconnected or ended.

ROS 2 does not say who sent a goal. What DDS shows is who listens to the feedback of an action, and every action client
does. So a goal belongs to all that listened when it came; when none of them is there any more, its client is gone.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import Any


class GoalClients:
    """Finds the goals of an action whose clients are gone.

    Parameters
    ----------
    look : callable
        Returns identifiers of those that listen to the feedback of the action, now.
    """

    def __init__(self, look: Callable[[], frozenset[bytes]]) -> None:
        self._look = look
        self._clients: dict[bytes, frozenset[bytes]] = {}

    def welcome(self, goal: bytes) -> None:
        """Note who may have sent a goal that has come just now."""
        self._clients[goal] = self._look()

    def abandoned(self, goals: Collection[bytes]) -> list[bytes]:
        """Return those of all unfinished goals whose clients are gone; forget goals that are not among them.

        A goal that came before DDS showed any client belongs to the first ones that it shows.
        """
        present = self._look() if goals else frozenset()
        self._clients = {goal: self._clients.get(goal) or present for goal in goals}
        return [goal for goal, clients in self._clients.items() if clients and not clients & present]


def feedback_listeners(node: Any, action: str) -> frozenset[bytes]:
    """Return the identifiers (GID) of those that listen to the feedback of an action of a node."""
    found = node.get_subscriptions_info_by_topic(f"{action}/_action/feedback")
    return frozenset(bytes(one.endpoint_gid) for one in found)
