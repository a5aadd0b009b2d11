"""Nodes of one name, which would both drive one robot, and topics with other types are warned of."""

from types import SimpleNamespace

import pytest

from mbf_ros.ros2.neighbours import Mismatches, Namesakes


class Neighbourhood:
    """What a node of rclpy, ``/robot/move_base_flex``, sees of all nodes, itself included."""

    def __init__(self, *others):
        self.others, self.warnings = list(others), []

    def get_name(self):
        return "move_base_flex"

    def get_namespace(self):
        return "/robot"

    def get_fully_qualified_name(self):
        return "/robot/move_base_flex"

    def get_node_names_and_namespaces(self):
        return [("move_base_flex", "/robot"), *self.others]

    def get_logger(self):
        return SimpleNamespace(warning=self.warnings.append)


SAME = ("move_base_flex", "/robot")


@pytest.mark.parametrize("others", [(), [("move_base_flex", "/other")], [("rviz", "/robot")]])
def test_nodes_of_other_names_or_namespaces_are_no_namesakes(others):
    node = Neighbourhood(*others)
    Namesakes(node).look()
    assert not node.warnings


def test_a_namesake_is_warned_of_once_until_it_comes_again():
    node = Neighbourhood(SAME)
    namesakes = Namesakes(node)
    for others in ([SAME], [SAME], [], [SAME]):
        node.others = others
        namesakes.look()
    assert len(node.warnings) == 2
    assert "another node is called /robot/move_base_flex" in node.warnings[0]


class Odometry:
    """Stands for the class that rclpy makes of the message."""


class TwistStamped(Odometry):
    """Likewise."""


Odometry.__module__ = "nav_msgs.msg._odometry"
TwistStamped.__module__ = "geometry_msgs.msg._twist_stamped"


class Topics(Neighbourhood):
    """What a node sees that listens for odometry, publishes commands, and finds others at both topics."""

    subscriptions = (SimpleNamespace(topic_name="/odom", msg_type=Odometry),)
    publishers = (SimpleNamespace(topic_name="/cmd_vel", msg_type=TwistStamped),)

    def get_publishers_info_by_topic(self, topic):
        return [SimpleNamespace(topic_type=kind) for kind in self.others[0]]

    def get_subscriptions_info_by_topic(self, topic):
        return [SimpleNamespace(topic_type=kind) for kind in self.others[1]]


def test_topics_with_the_same_types_are_no_mismatch():
    node = Topics(["nav_msgs/msg/Odometry"], ["geometry_msgs/msg/TwistStamped"])
    Mismatches(node).look()
    assert not node.warnings


def test_a_topic_with_another_type_is_named_once_on_both_sides():
    node = Topics(["geometry_msgs/msg/Pose", "nav_msgs/msg/Odometry"], ["geometry_msgs/msg/Twist"])
    mismatches = Mismatches(node)
    for _ in range(2):
        mismatches.look()
    odometry, commands = node.warnings
    assert odometry.startswith("/odom: geometry_msgs/msg/Pose is published there by another node, and nav_msgs/msg/Od")
    assert commands.startswith("/cmd_vel: geometry_msgs/msg/Twist is listened for there by another node, and geometry_")
