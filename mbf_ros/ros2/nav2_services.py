"""Services of Nav2's servers: questions to the map, and the state of the nodes for which ours stands."""

from __future__ import annotations

from typing import Any

from mbf_abstract.drive.robot import RobotStateError
from mbf_abstract.server.navigation_server import AbstractNavigationServer
from mbf_ros.messages.geometry import NO_COVARIANCE, pose_stamped
from mbf_ros.messages.interfaces import Message
from mbf_ros.messages.nav2.queries import NAV2_QUESTIONS
from mbf_ros.ros2.actions import Serving
from mbf_ros.ros2.conversion import fill, interface_class
from mbf_ros.ros2.services import ServedQueries

SERVERS = (
    "behavior_server",
    "bt_navigator",
    "controller_server",
    "planner_server",
    "smoother_server",
    "waypoint_follower",
)
"""Nodes of Nav2 whose work is done here."""
AMCL = "amcl"
INACTIVE: Message = {"id": 2, "label": "inactive"}
ACTIVE: Message = {"id": 3, "label": "active"}


class Nav2Services:
    """The services on a node.

    Parameters
    ----------
    queries : ServedQueries
        Answers questions beside each other.
    stands_for_amcl : bool
        Also answer for ``amcl``: its state, and on ``amcl_pose`` where the robot is, as soon as somebody publishes on
        ``initialpose``. The pose that comes there is not used, as the robot is localised by something else.
    """

    def __init__(
        self,
        node: Any,
        server: AbstractNavigationServer,
        serving: Serving,
        queries: ServedQueries,
        stands_for_amcl: bool,
    ) -> None:
        self._node, self._server, self._serving = node, server, serving
        for name, question in NAV2_QUESTIONS.items():
            queries.offer(name, question)
        state = interface_class("lifecycle_msgs/srv/GetState")
        for name in (*SERVERS, AMCL) if stands_for_amcl else SERVERS:
            node.create_service(state, f"{name}/get_state", self._get_state, callback_group=queries.group)
        if stands_for_amcl:
            self._stand_for_amcl()

    def _get_state(self, request: Any, response: Any) -> Any:
        return fill(response, {"current_state": INACTIVE if self._serving.refusal() else ACTIVE})

    def _stand_for_amcl(self) -> None:
        from rclpy.qos import DurabilityPolicy, QoSProfile

        kind = interface_class("geometry_msgs/PoseWithCovarianceStamped")
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        publisher = self._node.create_publisher(kind, "amcl_pose", latched)

        def answer(message: Any) -> None:
            try:
                pose = pose_stamped(self._server.runtime.robot.pose(), self._serving.context())
            except RobotStateError:  # the next message may come when it is known
                return
            body = {"pose": pose["pose"], "covariance": NO_COVARIANCE}
            publisher.publish(fill(kind(), {"header": pose["header"], "pose": body}))

        self._node.create_subscription(kind, "initialpose", answer, 10)
