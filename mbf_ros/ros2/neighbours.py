"""Other nodes with which ours does not work, which ROS 2 says nothing about: of its name, or with other types."""

from __future__ import annotations

from typing import Any


class Namesakes:
    """Warns where another node has the name of ours: each goal would reach both, and both would command the robot.

    Only a warning, as a node that was killed seems to be there until its lease of DDS ends.
    """

    def __init__(self, node: Any) -> None:
        self._node = node
        self._are_known = False

    def look(self) -> None:
        """Look at the nodes that are there; warns again once the other one was gone."""
        own = (self._node.get_name(), self._node.get_namespace())
        are_there = self._node.get_node_names_and_namespaces().count(own) > 1
        if are_there and not self._are_known:
            self._node.get_logger().warning(
                f"another node is called {self._node.get_fully_qualified_name()}, unless it was killed some seconds "
                "ago: both take every goal and command the robot; end one of them, or give one a namespace of its own"
            )
        self._are_known = are_there


class Mismatches:
    """Warns, once each, where another node uses a topic of ours with another type: nothing is delivered there."""

    def __init__(self, node: Any) -> None:
        self._node = node
        self._known: set[str] = set()

    def look(self) -> None:
        """Look at who publishes what we listen for, and who listens for what we publish."""
        for ours in self._node.subscriptions:
            self._compare(ours, self._node.get_publishers_info_by_topic(ours.topic_name), "published")
        for ours in self._node.publishers:
            self._compare(ours, self._node.get_subscriptions_info_by_topic(ours.topic_name), "listened for")

    def _compare(self, ours: Any, others: list[Any], verb: str) -> None:
        own = type_name(ours.msg_type)
        for other in sorted({one.topic_type for one in others} - {own}):
            text = f"{ours.topic_name}: {other} is {verb} there by another node, and {own} by this one"
            if text not in self._known:
                self._known.add(text)
                self._node.get_logger().warning(f"{text}: nothing is delivered")


def type_name(kind: Any) -> str:
    """Return a class of messages as ROS 2 names it, e.g. ``nav_msgs/msg/Odometry``."""
    return f"{kind.__module__.partition('.')[0]}/msg/{kind.__name__}"
