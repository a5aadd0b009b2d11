"""A client of the node: each line of stdin is a JSON order, and what comes of it is a JSON line on stdout.

All that is sent is sent on the thread of the executor. Of rclpy 9.1.2 ``send_goal_async`` makes two futures and returns
the second one, and 7.1.6 makes its only one after it has sent: an answer that comes before on another thread is lost,
and the goal waits for ever.
"""

import collections
import json
import sys
import threading
import time

import rclpy
import rclpy.action.client
from action_msgs.msg import GoalStatus
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from mbf_msgs.action import ExePath, GetPath, MoveBase, Recovery
from mbf_msgs.srv import CheckPath, CheckPoint, CheckPose, FindValidPose
from nav_msgs.msg import Path
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.task import Future
from std_srvs.srv import Empty, Trigger

ACTIONS = {"get_path": GetPath, "exe_path": ExePath, "move_base": MoveBase, "recovery": Recovery}
SERVICES = {
    "check_point_cost": CheckPoint,
    "check_pose_cost": CheckPose,
    "check_path_cost": CheckPath,
    "find_valid_pose": FindValidPose,
    "clear_costmaps": Empty,
    "pause": Trigger,
    "resume": Trigger,
    "cancel_all": Trigger,
    "get_parameters": GetParameters,
    "set_parameters": SetParameters,
}
STATUSES = {
    GoalStatus.STATUS_SUCCEEDED: "succeeded",
    GoalStatus.STATUS_CANCELED: "canceled",
    GoalStatus.STATUS_ABORTED: "aborted",
}

rclpy.init()
node = rclpy.create_node("client")
clients = {name: ActionClient(node, kind, f"/move_base_flex/{name}") for name, kind in ACTIONS.items()}
services = {name: node.create_client(kind, f"/move_base_flex/{name}") for name, kind in SERVICES.items()}
queues = {f"{name}_service_qos_profile": QoSProfile(depth=100) for name in ("goal", "result", "cancel")}
many_recoveries = ActionClient(node, Recovery, "/move_base_flex/recovery", **queues)
initial_pose = node.create_publisher(PoseWithCovarianceStamped, "initialpose", 10)
handles, shown_goals = {}, []


def say(**fields):
    sys.stdout.write(json.dumps(fields) + "\n")
    sys.stdout.flush()


def meet(key):
    for client in (*clients.values(), many_recoveries):
        client.wait_for_server()
    for client in services.values():
        client.wait_for_service()
    say(key=key, what="ready")


def part(key):
    """Wait until no server of an action is seen any more."""
    while any(client.server_is_ready() for client in clients.values()):
        time.sleep(0.1)
    say(key=key, what="alone")


def find(key, actions):
    """Wait for the servers of some actions."""
    for action in actions:
        clients[action].wait_for_server()
    say(key=key, what="found")


def pose(x, y, frame="map", w=1.0):
    stamped = PoseStamped()
    stamped.header.frame_id = frame
    stamped.pose.position.x, stamped.pose.position.y = float(x), float(y)  # rclpy would take the bits of an int
    stamped.pose.orientation.w = float(w)
    return stamped


class LateFuture(Future):
    """As where another thread gets its turn while a goal is being sent."""

    def __init__(self, **fields):
        time.sleep(0.3)
        super().__init__(**fields)


def send(key, action, target=None, path=None, shown=False, late=False, **fields):
    """Send a goal: to a target, along a path, or to the goal that a simulator shows."""
    goal = ACTIONS[action].Goal(**fields)
    if shown:
        goal.target_pose = shown_goals[-1]
    if target is not None:
        goal.target_pose = pose(*target)
    if path is not None:
        goal.path = Path(poses=[pose(*one) for one in path])
        goal.path.header.frame_id = "map"

    def feedback(message):
        say(
            key=key,
            what="feedback",
            dist=message.feedback.dist_to_goal,
        )

    def accepted(future):
        handles[key] = future.result()
        if future.result().accepted:
            future.result().get_result_async().add_done_callback(ended)
        say(key=key, what="accepted" if future.result().accepted else "rejected")

    def ended(future):
        result = future.result().result
        poses = (
            [[one.pose.position.x, one.pose.position.y] for one in result.path.poses] if action == "get_path" else []
        )
        status = STATUSES[future.result().status]
        say(key=key, what="result", status=status, outcome=result.outcome, message=result.message, poses=poses)

    rclpy.action.client.Future = LateFuture if late else Future
    clients[action].send_goal_async(goal, feedback_callback=feedback).add_done_callback(accepted)
    rclpy.action.client.Future = Future


def take_shown_goal(message):
    shown_goals.append(message)
    say(key="goal", what="shown")


def repeat(key, number):
    """Ask for a plan many times, each time when the one before has come, and count the outcomes."""
    goal = GetPath.Goal(use_start_pose=True, start_pose=pose(0.0, 0.0), target_pose=pose(1.0, 0.0))
    outcomes = collections.Counter()

    def ask():
        clients["get_path"].send_goal_async(goal).add_done_callback(
            lambda future: future.result().get_result_async().add_done_callback(ended)
        )

    def ended(future):
        outcomes[future.result().result.outcome] += 1
        if outcomes.total() < number:
            ask()
        else:
            say(key=key, what="repeated", outcomes=outcomes)

    ask()


def burst(key, number):
    """Send so many recoveries at once, cancel all at once when all are accepted, and count the outcomes."""
    taken, outcomes = [], collections.Counter()

    def accepted(future):
        taken.append(future.result())
        future.result().get_result_async().add_done_callback(ended)
        if len(taken) == number:
            say(key=key, what="accepted", number=sum(one.accepted for one in taken))
            for one in taken:
                one.cancel_goal_async()

    def ended(future):
        outcomes[future.result().result.outcome] += 1
        if outcomes.total() == number:
            say(key=key, what="over", outcomes=outcomes)

    for slot in range(1, number + 1):
        goal = Recovery.Goal(behavior="long_pause", concurrency_slot=slot)
        many_recoveries.send_goal_async(goal).add_done_callback(accepted)


def cancel(key):
    handles[key].cancel_goal_async()


def call(key, service, target=None, path=None, **fields):
    request = SERVICES[service].Request(**fields)
    if service == "check_point_cost":
        stamped = pose(*target)
        request.point.header, request.point.point = stamped.header, stamped.pose.position
    elif target is not None:
        request.pose = pose(*target)
    if path is not None:
        request.path.poses = [pose(*one) for one in path]

    def answered(future):
        names = [name for name in future.result().get_fields_and_field_types() if name in ("state", "cost", "success")]
        say(key=key, what="answer", **{name: getattr(future.result(), name) for name in names})

    services[service].call_async(request).add_done_callback(answered)


def get(key, names):
    def plain(value):
        if value.type == ParameterType.PARAMETER_STRING_ARRAY:
            return list(value.string_array_value)
        return value.double_value if value.type == ParameterType.PARAMETER_DOUBLE else value.string_value

    services["get_parameters"].call_async(GetParameters.Request(names=names)).add_done_callback(
        lambda future: say(key=key, what="values", values=[plain(one) for one in future.result().values])
    )


def put(key, name, value):
    number = ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=value)
    request = SetParameters.Request(parameters=[Parameter(name=name, value=number)])

    def answered(future):
        result = future.result().results[0]
        say(key=key, what="set", successful=result.successful, reason=result.reason)

    services["set_parameters"].call_async(request).add_done_callback(answered)


def place(key, x, y):
    """Say where the robot is."""
    said, message = pose(x, y), PoseWithCovarianceStamped()
    message.header, message.pose.pose = said.header, said.pose
    initial_pose.publish(message)
    say(key=key, what="placed")


def look(key, topic):
    """Say when somebody publishes on a topic."""
    while not node.count_publishers(topic):
        time.sleep(0.1)
    say(key=key, what="seen")


def take_orders():
    for line in sys.stdin:
        order = json.loads(line)
        name = order.pop("order")
        if name in waiting:
            waiting[name](**order)
        else:
            executor.create_task(orders[name], **order)


executor = SingleThreadedExecutor()
executor.add_node(node)
waiting = {"meet": meet, "part": part, "find": find, "look": look}
latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
node.create_subscription(PoseStamped, "/simulator/goal", take_shown_goal, latched)
orders = {
    "send": send,
    "repeat": repeat,
    "burst": burst,
    "cancel": cancel,
    "call": call,
    "get": get,
    "put": put,
    "place": place,
}
threading.Thread(target=take_orders, daemon=True).start()
executor.spin()
