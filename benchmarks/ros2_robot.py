"""The robot of benchmarks/ros2.py and what it measures; run by that program, for each way to reach the navigator.

A kinematic robot publishes transforms and odometry at 50 Hz and a scan of 360 rays at 10 Hz, and takes commands. It
sends the goals itself, so that all times are read from one clock. The last line of its output is JSON.

    python benchmarks/ros2_robot.py local|ros2|ws://... CONFIG PID GOALS SCANS SECONDS
"""

import argparse
import json
import math
import os
import random
import threading
from contextlib import ExitStack
from pathlib import Path

import numpy as np

from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.goals.goal_types import GetPathGoal, MoveBaseGoal
from mbf_abstract.server.factory import read_config
from mbf_abstract.session import NavigationSession
from mbf_abstract.testing.loopback import LoopbackRobot
from mbf_abstract.time.clock import WallClock, unix_seconds, wall_seconds
from mbf_abstract.time.program_end import interruptible
from mbf_ros.messages.geometry import MessageContext, odometry_message, pose_stamped, transforms_message
from mbf_ros.messages.json_text import json_text
from mbf_ros.messages.maps import occupancy_cells
from mbf_ros.messages.sensors import laser_scan_of

STATE_PERIOD, TICKS_PER_SCAN = 0.02, 5
RAYS, RANGE, WALL, HIT = 360, 8.0, 7.5, 4.0  # m; a ray that meets nothing would be none in JSON
BEARINGS = [math.radians(degrees) for degrees in range(70, 300, 30)]  # of the post, never ahead of the robot
NEAR, FAR = Pose.planar(3.0, 0.0), Pose.planar(40.0, 0.0)
COSTMAP = "local_costmap"
LETHAL = 100
TYPES = {"/tf": "tf2_msgs/TFMessage", "/odom": "nav_msgs/Odometry", "/scan": "sensor_msgs/LaserScan"}
SOON = 20.0  # s
WITHIN = 300.0  # s; kernels may be compiled meanwhile


class Robot:
    """The robot and what it publishes through a link; the post that its scans show stands at a bearing [rad]."""

    def __init__(self, link):
        self.clock = WallClock()
        self.context = MessageContext("map", unix_seconds() - self.clock.now())
        self.transforms = TransformBuffer()
        self.drive = LoopbackRobot(self.clock, self.transforms, Pose.planar(0.0, 0.0))
        self.bearing = None
        self._link = link

    def start(self):
        """Publish from now on."""
        self.clock.spawn(self._publish_all, "robot")

    def show_post(self, bearing):
        """Send a scan that shows the post there, at once; those that follow do, too. Returns when it was sent [s]."""
        self.bearing, now = bearing, wall_seconds()
        self._link.publish("/scan", self._scan())
        return now

    def _publish_all(self):
        start, tick = self.clock.now(), 0
        while True:
            tick += 1
            self.clock.sleep_until(start + tick * STATE_PERIOD)
            self._publish_state()
            if tick % TICKS_PER_SCAN == 0:
                self._link.publish("/scan", self._scan())

    def _publish_state(self):
        newest, odometry = self.transforms.newest(), self.drive.odometry()
        self._link.publish("/tf", transforms_message(newest, self.context))
        if odometry is not None:
            T_odom_base = next(one for one in newest if one.child == "base_link")
            self._link.publish("/odom", odometry_message(odometry, T_odom_base, self.context))

    def _scan(self):
        step = 2.0 * math.pi / RAYS
        ranges = np.full(RAYS, WALL, np.float32)
        if self.bearing is not None:
            ranges[round(self.bearing / step) + np.arange(-3, 4)] = HIT
        header = self.context.header("base_link", self.clock.now())
        limits = {"range_min": 0.1, "range_max": RANGE, "time_increment": 0.0, "scan_time": 0.1}
        angles = {"angle_min": 0.0, "angle_max": (RAYS - 1) * step, "angle_increment": step}
        return {"header": header, **angles, **limits, "ranges": ranges, "intensities": np.zeros(0, np.float32)}


class Post:
    """Waits until a costmap shows the post at a bearing."""

    def __init__(self):
        self._place, self._came, self._time = (0.0, 0.0), threading.Event(), 0.0

    def expect(self, bearing):
        """Wait for a costmap that comes from now on."""
        self._came.clear()
        self._place = HIT * math.cos(bearing), HIT * math.sin(bearing)

    def take(self, width, resolution, x_min, y_min, cells):
        """Take a costmap, its cells row by row; returns whether it has the post."""
        column, row = int((self._place[0] - x_min) / resolution), int((self._place[1] - y_min) / resolution)
        around = [cells[(row + j) * width + column + i] for j in (-1, 0, 1) for i in (-1, 0, 1)]
        if max(around) >= LETHAL and not self._came.is_set():
            self._time = wall_seconds()
            self._came.set()
        return self._came.is_set()

    def wait(self):
        """When the first such costmap came [s]."""
        assert self._came.wait(SOON), "no costmap shows the post"
        return self._time


class LocalPost(Post):
    """The same of a map in this process."""

    def __init__(self, server, clock):
        super().__init__()
        self._server, self._clock = server, clock

    def wait(self):
        """See ``Post``."""
        while not self._look():
            self._clock.sleep(0.001)
        return super().wait()

    def _look(self):
        view = self._server.map_view(COSTMAP)
        x_min, x_max, y_min, _ = view.extent
        width = view.costs.shape[1]
        cells = occupancy_cells(view.costs).reshape(-1)
        return self.take(width, (x_max - x_min) / width, x_min, y_min, cells)


class LocalLink:
    """The navigator is in this process."""

    def __init__(self, config, closing):
        self.robot = Robot(self)
        session = closing.enter_context(NavigationSession(self.robot.clock))
        session.serve(*read_config(config), self.robot.drive, self.robot.transforms)
        self._navigator = session.navigator
        self.post = LocalPost(session.navigator.server, self.robot.clock)

    def publish(self, topic, message):
        """Only scans: the navigator has the transforms and the odometry of the robot."""
        if topic == "/scan":
            clock, context = self.robot.clock, self.robot.context
            self._navigator.server.take_scan(laser_scan_of(message, context, "scan", clock.now()))

    def send(self, action, target):
        """Send a goal; returns when it was accepted [s], and its handle."""
        handle = self._navigator.send((GetPathGoal if action == "get_path" else MoveBaseGoal)(target))
        return wall_seconds(), handle

    def wait(self, handle):
        """Whether a goal has succeeded, and when its result came [s]."""
        return bool(handle.wait(WITHIN).success), wall_seconds()

    def cancel(self, handle):
        """Cancel a goal."""
        handle.cancel()


class BridgeLink:
    """The navigator is behind a rosbridge server; its protocol knows no acceptance of goals."""

    def __init__(self, address, closing):
        from websockets.sync.client import connect

        self.post, self.robot = Post(), Robot(self)
        self._topics, self._goals = (closing.enter_context(connect(address, max_size=None)) for _ in range(2))
        for topic, kind in TYPES.items():
            self._say(self._topics, op="advertise", topic=topic, type=kind)
        for topic, kind in (("/cmd_vel", "geometry_msgs/Twist"), (f"/{COSTMAP}/costmap", "nav_msgs/OccupancyGrid")):
            self._say(self._topics, op="subscribe", topic=topic, type=kind)
        self.robot.clock.spawn(self._read, "reader")

    def publish(self, topic, message):
        """Publish."""
        self._topics.send(json_text({"op": "publish", "topic": topic, "msg": message}))

    def send(self, action, target):
        """Send a goal; returns None, as nobody says when it is accepted, and what identifies it."""
        goal = f"{action}:{wall_seconds()}", f"/move_base_flex/{action}"
        args = {"target_pose": pose_stamped(target, self.robot.context)}
        self._say(self._goals, op="send_action_goal", id=goal[0], action=goal[1], args=args, feedback=False)
        return None, goal

    def wait(self, goal):
        """See ``LocalLink``."""
        while True:
            frame = json.loads(self._goals.recv(timeout=WITHIN))
            if frame["op"] == "action_result" and frame["id"] == goal[0]:
                return bool(frame["result"] and frame.get("status") == 4), wall_seconds()

    def cancel(self, goal):
        """Cancel a goal."""
        self._say(self._goals, op="cancel_action_goal", id=goal[0], action=goal[1])

    def _say(self, socket, **operation):
        socket.send(json_text(operation))

    def _read(self):
        from websockets.exceptions import ConnectionClosed

        try:
            for text in self._topics:
                frame = json.loads(text)
                if frame["op"] == "publish":
                    self._take(frame["topic"], frame["msg"])
        except ConnectionClosed:
            return

    def _take(self, topic, message):
        if topic == "/cmd_vel":
            self.robot.drive.send_command(twist(message))
            return
        info = message["info"]
        corner = info["origin"]["position"]
        self.post.take(info["width"], info["resolution"], corner["x"], corner["y"], message["data"])


class RosLink:
    """The navigator is a node of ROS 2; this is another one. All goals are sent on the executor's thread."""

    def __init__(self, closing):
        import rclpy
        from geometry_msgs.msg import Twist as TwistMessage
        from mbf_msgs.action import GetPath, MoveBase
        from nav_msgs.msg import OccupancyGrid
        from rclpy.action import ActionClient
        from rclpy.executors import SingleThreadedExecutor
        from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data

        from mbf_ros.ros2.conversion import interface_class

        rclpy.init()
        closing.callback(rclpy.try_shutdown)
        self.post, self.robot = Post(), Robot(self)
        node, usual = rclpy.create_node("robot"), QoSProfile(depth=100)
        self._classes = {topic: interface_class(kind) for topic, kind in TYPES.items()}
        self._publishers = {
            topic: node.create_publisher(kind, topic, qos_profile_sensor_data if topic == "/scan" else usual)
            for topic, kind in self._classes.items()
        }
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        node.create_subscription(TwistMessage, "cmd_vel", self._take_command, usual)
        node.create_subscription(OccupancyGrid, f"{COSTMAP}/costmap", self._take_grid, latched)
        kinds = {"get_path": GetPath, "move_base": MoveBase}
        self._clients = {name: ActionClient(node, kind, f"/move_base_flex/{name}") for name, kind in kinds.items()}
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(node)
        self.robot.clock.spawn(self._executor.spin, "executor")
        for client in self._clients.values():
            assert client.wait_for_server(WITHIN), "the node offers no actions"

    def publish(self, topic, message):
        """Publish."""
        from mbf_ros.ros2.conversion import fill

        self._publishers[topic].publish(fill(self._classes[topic](), message))

    def send(self, action, target):
        """Send a goal, again until it is accepted; returns when that was [s] since it was sent, and its goal."""
        while True:
            goal = RosGoal(self._clients[action], pose_stamped(target, self.robot.context))
            self._executor.create_task(goal.send)
            assert goal.answered.wait(WITHIN), "the goal was neither accepted nor rejected"
            if goal.handle.accepted:
                return goal.accepted_at, goal
            self.robot.clock.sleep(0.2)

    def wait(self, goal):
        """See ``LocalLink``."""
        assert goal.ended.wait(WITHIN), "the goal has no result"
        return goal.success, goal.ended_at

    def cancel(self, goal):
        """Cancel a goal."""
        self._executor.create_task(goal.handle.cancel_goal_async)

    def _take_command(self, message):
        self.robot.drive.send_command(Twist.planar(message.linear.x, message.linear.y, message.angular.z))

    def _take_grid(self, message):
        info, corner = message.info, message.info.origin.position
        self.post.take(info.width, info.resolution, corner.x, corner.y, message.data)


class RosGoal:
    """One goal of ``RosLink`` and its times [s]; callbacks on the executor's thread."""

    def __init__(self, client, target):
        self._client, self._target = client, target
        self.answered, self.ended = threading.Event(), threading.Event()
        self.accepted_at = self.ended_at = 0.0
        self.handle, self.success = None, False

    def send(self):
        """Send it."""
        from mbf_ros.ros2.conversion import fill

        goal = fill(self._client._action_type.Goal(), {"target_pose": self._target})
        self._client.send_goal_async(goal).add_done_callback(self._take_answer)

    def _take_answer(self, future):
        self.accepted_at, self.handle = wall_seconds(), future.result()
        if self.handle.accepted:
            self.handle.get_result_async().add_done_callback(self._take_result)
        self.answered.set()

    def _take_result(self, future):
        self.ended_at, self.success = wall_seconds(), future.result().result.outcome == 0
        self.ended.set()


def twist(message):
    return Twist.planar(message["linear"]["x"], message["linear"]["y"], message["angular"]["z"])


def cpu_seconds(pid):
    """Processor time [s] of a process so far."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def measure_goals(link, count):
    """Times [ms] from sending a goal for a plan until it is accepted, and until its result."""
    accepted, ended = [], []
    for _ in range(count):
        began = wall_seconds()
        accepted_at, goal = link.send("get_path", NEAR)
        success, ended_at = link.wait(goal)
        assert success, "a plan has failed"
        accepted += [] if accepted_at is None else [1000.0 * (accepted_at - began)]
        ended.append(1000.0 * (ended_at - began))
    return {"accepted_ms": accepted, "planned_ms": ended}


def measure_scans(link, count):
    """Times [ms] from sending the first scan that shows the post until a costmap that has it."""
    chance, times = random.Random(1), []
    for number in range(count + 3):
        bearing = BEARINGS[number % len(BEARINGS)]
        link.robot.clock.sleep(chance.uniform(0.05, 0.15))  # at any phase of the updates
        link.post.expect(bearing)
        sent = link.robot.show_post(bearing)
        times.append(1000.0 * (link.post.wait() - sent))
    link.robot.show_post(None)
    return {"scan_to_costmap_ms": times[3:]}


def measure_drive(link, pid, seconds):
    """Times [ms] between commands as the robot receives them, and the CPU share [%] of the navigator meanwhile."""
    _, goal = link.send("move_base", FAR)
    link.robot.clock.sleep(1.5)
    link.robot.drive.commands.clear()
    began, used = wall_seconds(), cpu_seconds(pid)
    link.robot.clock.sleep(seconds)
    share = 100.0 * (cpu_seconds(pid) - used) / (wall_seconds() - began)
    stamps = [time for time, _ in tuple(link.robot.drive.commands)]
    link.cancel(goal)
    link.wait(goal)
    return {"between_commands_ms": (1000.0 * np.diff(stamps)).tolist(), "cpu_percent": [share]}


def warm_up(link):
    """Wait until a plan comes and the robot has driven a little: all kernels are compiled."""
    link.robot.start()
    while not link.wait(link.send("get_path", NEAR)[1])[0]:
        link.robot.clock.sleep(0.2)
    _, goal = link.send("move_base", FAR)
    link.robot.clock.sleep(0.5)
    link.cancel(goal)
    link.wait(goal)


def given():
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("link", help="local, ros2 or the address of a rosbridge server")
    parser.add_argument("config", type=Path, help="of the navigator, where the link is local")
    parser.add_argument("pid", type=int, help="process of the navigator; 0 for this one")
    for what in ("goals", "scans"):
        parser.add_argument(what, type=int, help="how many are measured")
    parser.add_argument("seconds", type=float, help="of the drive")
    return parser.parse_args()


def main():
    asked = given()
    with ExitStack() as closing:
        if asked.link == "local":
            link = LocalLink(asked.config, closing)
        else:
            link = RosLink(closing) if asked.link == "ros2" else BridgeLink(asked.link, closing)
        warm_up(link)
        answer = measure_goals(link, asked.goals) | measure_scans(link, asked.scans)
        answer |= measure_drive(link, asked.pid or os.getpid(), asked.seconds)
    print(json.dumps(answer), flush=True)
    os._exit(0)  # threads of the robot go on


if __name__ == "__main__":
    with interruptible():
        main()
