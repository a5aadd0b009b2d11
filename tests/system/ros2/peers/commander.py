"""A client that calls the node as ``BasicNavigator`` of nav2_simple_commander calls Nav2, one call after the other.

That class has no wheel; this script follows its calls: it waits for ``get_state`` of amcl and bt_navigator, publishes
``initialpose`` until ``amcl_pose`` comes, sends goals with a callback for feedback, and spins only while it waits for
one future. Each line of stdin is a JSON order, and what comes of it is a JSON line on stdout.
"""

import json
import sys

import rclpy
from action_msgs.msg import GoalStatus
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from lifecycle_msgs.srv import GetState
from nav2_msgs.action import (
    BackUp,
    ComputePathThroughPoses,
    ComputePathToPose,
    DriveOnHeading,
    FollowPath,
    FollowWaypoints,
    NavigateThroughPoses,
    NavigateToPose,
    SmoothPath,
    Spin,
    Wait,
)
from nav2_msgs.srv import ClearCostmapAroundRobot, ClearCostmapExceptRegion, ClearEntireCostmap, GetCostmap, IsPathValid
from rclpy.action import ActionClient
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile

ACTIONS = {
    "navigate_through_poses": NavigateThroughPoses,
    "navigate_to_pose": NavigateToPose,
    "follow_waypoints": FollowWaypoints,
    "follow_path": FollowPath,
    "compute_path_to_pose": ComputePathToPose,
    "compute_path_through_poses": ComputePathThroughPoses,
    "smooth_path": SmoothPath,
    "spin": Spin,
    "backup": BackUp,
    "drive_on_heading": DriveOnHeading,
    "wait": Wait,
}
SERVICES = {
    "is_path_valid": IsPathValid,
    **{f"{name}_costmap/get_costmap": GetCostmap for name in ("global", "local")},
    **{f"{name}_costmap/clear_entirely_{name}_costmap": ClearEntireCostmap for name in ("global", "local")},
    **{f"{name}_costmap/clear_around_{name}_costmap": ClearCostmapAroundRobot for name in ("global", "local")},
    **{f"{name}_costmap/clear_except_{name}_costmap": ClearCostmapExceptRegion for name in ("global", "local")},
}
STATUSES = {
    GoalStatus.STATUS_SUCCEEDED: "succeeded",
    GoalStatus.STATUS_CANCELED: "canceled",
    GoalStatus.STATUS_ABORTED: "aborted",
}


def plain(value):
    """A message as JSON values."""
    if hasattr(value, "get_fields_and_field_types"):
        return {name: plain(getattr(value, name)) for name in value.get_fields_and_field_types()}
    return [plain(one) for one in value] if hasattr(value, "__iter__") and not isinstance(value, str) else value


def write(message, values):
    """Write JSON values into a message; all lists of messages here are of poses."""
    for name, value in values.items():
        if isinstance(value, dict):
            write(getattr(message, name), value)
        elif isinstance(value, list):
            setattr(message, name, [write(PoseStamped(), one) for one in value])
        else:
            setattr(message, name, type(getattr(message, name))(value))
    return message


class Commander(Node):
    def __init__(self):
        super().__init__("commander")
        self.clients_of = {name: ActionClient(self, kind, name) for name, kind in ACTIONS.items()}
        self.asked = {name: self.create_client(kind, name) for name, kind in SERVICES.items()}
        self.localised, self.feedback = False, []
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.create_subscription(PoseWithCovarianceStamped, "amcl_pose", self.take_pose, latched)
        self.initial_pose = self.create_publisher(PoseWithCovarianceStamped, "initialpose", 10)

    def take_pose(self, message):
        self.localised = True

    def meet(self, key):
        """What it does until Nav2 is active."""
        for name in ("amcl", "bt_navigator"):
            client = self.create_client(GetState, f"{name}/get_state")
            while not client.wait_for_service(timeout_sec=1.0):
                pass
            state = ""
            while state != "active":
                state = self.wait_for(client.call_async(GetState.Request())).current_state.label
            while name == "amcl" and not self.localised:
                self.initial_pose.publish(PoseWithCovarianceStamped())
                rclpy.spin_once(self, timeout_sec=1.0)
        self.say(key=key, what="ready")

    def task(self, key, action, goal, cancel=False):
        """Run one goal to its end; with ``cancel`` cancel it at its first feedback."""
        client, self.feedback = self.clients_of[action], []
        while not client.wait_for_server(timeout_sec=1.0):
            pass
        message = write(ACTIONS[action].Goal(), goal)
        handle = self.wait_for(client.send_goal_async(message, lambda one: self.feedback.append(plain(one.feedback))))
        if not handle.accepted:
            self.say(key=key, what="result", status="rejected")
            return
        future = handle.get_result_async()
        while not future.result():
            rclpy.spin_until_future_complete(self, future, timeout_sec=0.1)
            if cancel and self.feedback:
                self.wait_for(handle.cancel_goal_async())
                cancel = False
        ended = future.result()
        fields = {"status": STATUSES[ended.status], "feedback": self.feedback[-200:]}
        self.say(key=key, what="result", **fields, **plain(ended.result))

    def ask(self, key, service, request):
        client = self.asked[service]
        while not client.wait_for_service(timeout_sec=1.0):
            pass
        answer = self.wait_for(client.call_async(write(SERVICES[service].Request(), request)))
        self.say(key=key, what="answer", **plain(answer))

    def wait_for(self, future):
        rclpy.spin_until_future_complete(self, future)
        return future.result()

    def say(self, **fields):
        sys.stdout.write(json.dumps(fields) + "\n")
        sys.stdout.flush()


rclpy.init()
commander = Commander()
for line in sys.stdin:
    order = json.loads(line)
    getattr(commander, order.pop("order"))(**order)
