"""What ROS 2 costs: delay of a goal and of a scan, and how evenly commands reach the robot.

Run: python benchmarks/ros2.py [--seconds 20], in an environment with ROS 2 and our message packages, see docs/ros2.md

Three processes: a robot that is a node, `mbf ros2` with Nav2's names, and a client. Measured are the time from sending
a goal until the client knows that it is accepted; the time between two commands at 20 Hz where the robot gets them; and
the time from publishing a scan that sees a wall, or no wall, until a costmap in which that shows has come back.
"""

import argparse
import json
import statistics
import subprocess
import sys
import tempfile
import threading
from itertools import pairwise
from pathlib import Path

import rclpy
from geometry_msgs.msg import TransformStamped, Twist
from map_msgs.msg import OccupancyGridUpdate
from mbf_msgs.action import GetPath, MoveBase
from nav_msgs.msg import OccupancyGrid, Odometry
from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Bool
from tf2_msgs.msg import TFMessage

from mbf_abstract.time.clock import WallClock, wall_seconds

PERIOD = 0.02  # s between two states of the robot
LOCAL = "width: 8.0, height: 8.0, resolution: 0.1, rolling_window: true"
CONFIG = f"""
backend: costmap
controller_frequency: 20.0
max_vel_x: 0.3
global_costmap: {{width: 200.0, height: 20.0, resolution: 0.5, origin_x: -10.0, origin_y: -10.0,
  layers: [{{name: area, type: keepout}}], area: {{zones: []}}}}
local_costmap: {{{LOCAL}, update_frequency: 20.0, layers: [{{name: seen, type: obstacle}}],
  seen: {{sources: {{scan: {{obstacle_max_range: 3.5, raytrace_max_range: 3.8}}}}}}}}
planners: [{{name: shortest, type: straight_line}}]
controllers: [{{name: follow, type: follow_path}}]
"""


class Robot:
    """Drives as ``cmd_vel`` says; ``wall`` chooses whether its scans see one, 3 m on its left."""

    def __init__(self) -> None:
        self.node = rclpy.create_node("robot")
        self.x, self.command, self.stamps, self.wall = 0.0, Twist(), [], False
        self.tf = self.node.create_publisher(TFMessage, "/tf", 100)
        self.odom = self.node.create_publisher(Odometry, "odom", 10)
        self.scan = self.node.create_publisher(LaserScan, "scan", qos_profile_sensor_data)
        self.node.create_subscription(Twist, "cmd_vel", self._take, 10)
        self.node.create_subscription(Bool, "wall", self._build, 10)
        self.node.create_timer(PERIOD, self._step)

    def _take(self, message: Twist) -> None:
        self.stamps.append(wall_seconds())
        self.command = message

    def _build(self, message: Bool) -> None:
        self.wall = message.data
        self._look()

    def _step(self) -> None:
        self.x += self.command.linear.x * PERIOD
        transform = TransformStamped(child_frame_id="base_link")
        transform.header.frame_id, transform.header.stamp = "map", self.node.get_clock().now().to_msg()
        transform.transform.translation.x, transform.transform.rotation.w = self.x, 1.0
        self.tf.publish(TFMessage(transforms=[transform]))
        odometry = Odometry(header=transform.header, child_frame_id="base_link")
        odometry.twist.twist = self.command
        self.odom.publish(odometry)
        self._look()

    def _look(self) -> None:
        scan = LaserScan(angle_min=1.4, angle_max=1.7, angle_increment=0.05, range_min=0.1, range_max=4.0)
        scan.header.frame_id, scan.header.stamp = "base_link", self.node.get_clock().now().to_msg()
        scan.ranges = [3.0 if self.wall else float("inf")] * 7
        self.scan.publish(scan)


class Client:
    """Sends goals, builds the wall and tears it down, and watches the local costmap; all on one thread."""

    def __init__(self) -> None:
        self.node = rclpy.create_node("client")
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.get_path = ActionClient(self.node, GetPath, "/move_base_flex/get_path")
        self.move_base = ActionClient(self.node, MoveBase, "/move_base_flex/move_base")
        self.wall = self.node.create_publisher(Bool, "wall", 10)
        self.lethal, self.width = None, 0
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.node.create_subscription(OccupancyGrid, "local_costmap/costmap", self._whole, latched)
        self.node.create_subscription(OccupancyGridUpdate, "local_costmap/costmap_updates", self._update, 10)

    def _whole(self, message: OccupancyGrid) -> None:
        self.lethal = 100 in message.data

    def _update(self, message: OccupancyGridUpdate) -> None:
        self.lethal = 100 in message.data  # the wall is all there is, and a window that has changed holds it

    def _wait_for(self, future):
        self.executor.spin_until_future_complete(future)
        return future.result()

    def accepted(self, count: int) -> list[float]:
        """Times [ms] until goals are accepted."""
        delays = []
        for _ in range(count):
            goal = GetPath.Goal(use_start_pose=True)
            for pose in (goal.start_pose, goal.target_pose):
                pose.header.frame_id, pose.pose.orientation.w = "map", 1.0
            goal.target_pose.pose.position.x = 5.0
            began = wall_seconds()
            handle = self._wait_for(self.get_path.send_goal_async(goal))
            delays.append(1000.0 * (wall_seconds() - began))
            self._wait_for(handle.get_result_async())
        return delays

    def seen(self, count: int) -> list[float]:
        """Times [ms] until what a scan shows is in the costmap."""
        delays = []
        for number in range(count):
            wanted, began = number % 2 == 0, wall_seconds()
            self.wall.publish(Bool(data=wanted))
            while self.lethal is not wanted:
                self.executor.spin_once()
            delays.append(1000.0 * (wall_seconds() - began))
            until = wall_seconds() + 0.3
            while (left := until - wall_seconds()) > 0.0:
                self.executor.spin_once(timeout_sec=left)
        return delays

    def drive(self, seconds: float) -> None:
        """Drive for some seconds."""
        goal = MoveBase.Goal()
        goal.target_pose.header.frame_id, goal.target_pose.pose.orientation.w = "map", 1.0
        goal.target_pose.pose.position.x = 180.0
        handle = self._wait_for(self.move_base.send_goal_async(goal))
        WallClock().sleep(seconds)
        self._wait_for(handle.cancel_goal_async())
        self._wait_for(handle.get_result_async())


def serve_robot() -> None:
    """Be the robot until the end of the input, then print when commands came [s]."""
    rclpy.init()
    robot = Robot()
    spinning = threading.Thread(target=rclpy.spin, args=(robot.node,), daemon=True)
    spinning.start()
    sys.stdin.read()
    print(json.dumps(robot.stamps), flush=True)


def row(name: str, values: list[float]) -> str:
    ordered = sorted(values)
    low, high = (ordered[int(share * (len(ordered) - 1))] for share in (0.05, 0.95))
    return f"| {name} | {statistics.median(values):.2f} | {low:.2f} | {high:.2f} | {ordered[-1]:.2f} |"


def measure(seconds: float, file: Path) -> None:
    robot_command = [sys.executable, __file__, "--robot"]
    mbf = "from mbf_abstract.cli import main; main()"
    node_command = [sys.executable, "-c", mbf, "ros2", str(file), "--map-period", "0.05"]
    with (
        subprocess.Popen(robot_command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as robot,
        subprocess.Popen(node_command, stdout=subprocess.PIPE, text=True) as node,
    ):
        assert robot.stdin is not None and robot.stdout is not None and node.stdout is not None
        while "is ready" not in node.stdout.readline():
            pass
        rclpy.init()
        client = Client()
        client.get_path.wait_for_server()
        client.move_base.wait_for_server()
        client.accepted(20)
        print("| ms | median | 5 % | 95 % | worst |\n|---|---|---|---|---|")
        print(row("goal sent until accepted, 300 goals", client.accepted(300)))
        client.seen(4)
        print(row("scan published until a costmap shows it, 60 scans", client.seen(60)))
        client.drive(seconds)
        robot.stdin.close()
        stamps = json.loads(robot.stdout.readline())
        moving = [1000.0 * (later - earlier) for earlier, later in pairwise(stamps) if later - earlier < 0.5]
        print(row("between commands at 20 Hz", moving[10:-5]))
        node.terminate()
    rclpy.shutdown()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--robot", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.robot:
        serve_robot()
        return
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "robot.yaml"
        file.write_text(CONFIG)
        measure(options.seconds, file)


if __name__ == "__main__":
    main()
