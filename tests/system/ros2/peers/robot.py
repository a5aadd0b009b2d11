"""A robot as a node of ROS 2: it drives as cmd_vel says and publishes tf, odometry and a scan, and a log on stdout.

It stops by itself when no command has come for ``COMMAND_TIMEOUT``. It takes orders on stdin, one a line: the name
of a topic and "off" or "on" silences it, "clock 12.5" sets simulated time, "fail now" and "hang now" publish on
``fail`` and ``hang``. Each line of the log is JSON with ``at``, the time of this computer [s]: an order that was done,
with the time at which its topic was last published; a command that came, as its speed and where the robot was; or where
it stopped by itself.
"""

import json
import math
import sys
import threading
import time
from collections import deque

import rclpy
from geometry_msgs.msg import TransformStamped, Twist
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Empty
from tf2_msgs.msg import TFMessage

PERIOD, COMMAND_TIMEOUT = 0.1, 3.0  # s; oftener, a node on a busy machine would hear it seconds late


class Robot(Node):
    def __init__(self, simulated):
        super().__init__("robot")
        self.x = self.y = self.yaw = 0.0
        self.time = 1000.0
        self.simulated, self.command, self.commanded = simulated, Twist(), 0.0
        self.silent, self.published, self.orders = set(), {}, deque()
        self.tf = self.create_publisher(TFMessage, "/tf", 100)
        self.odom = self.create_publisher(Odometry, "odom", 10)
        self.scan = self.create_publisher(LaserScan, "scan", qos_profile_sensor_data)
        self.clock = self.create_publisher(Clock, "/clock", 10)
        self.faults = {name: self.create_publisher(Empty, name, 10) for name in ("fail", "hang")}
        self.create_subscription(Twist, "cmd_vel", self.take, 10)
        self.create_timer(PERIOD, self.step)

    def take(self, message):
        self.command, self.commanded = message, time.monotonic()
        self.log(speed=math.hypot(message.linear.x, message.linear.y) + abs(message.angular.z), x=self.x)

    def log(self, **fields):
        sys.stdout.write(json.dumps({**fields, "at": time.monotonic()}) + "\n")
        sys.stdout.flush()

    def stamp(self):
        if not self.simulated:
            return self.get_clock().now().to_msg()
        stamp = Clock().clock
        stamp.sec, stamp.nanosec = int(self.time), int(self.time % 1.0 * 1e9)
        return stamp

    def step(self):
        while self.orders:
            self.obey(self.orders.popleft())
        if self.command != Twist() and time.monotonic() - self.commanded > COMMAND_TIMEOUT:
            self.command = Twist()
            self.log(stood=True, x=self.x)
        turn, speed = self.command.angular.z, self.command.linear.x
        self.yaw += turn * PERIOD
        self.x += speed * math.cos(self.yaw) * PERIOD
        self.y += speed * math.sin(self.yaw) * PERIOD
        self.time += PERIOD
        if self.simulated:
            self.say("clock", self.clock, lambda: Clock(clock=self.stamp()))
        self.say("tf", self.tf, lambda: TFMessage(transforms=[self.transform()]))
        self.say("odom", self.odom, self.odometry)
        self.say("scan", self.scan, self.scan_of_a_wall)

    def say(self, topic, publisher, message):
        if topic not in self.silent:
            publisher.publish(message())
            self.published[topic] = time.monotonic()

    def transform(self):
        transform = TransformStamped(child_frame_id="base_link")
        transform.header.frame_id, transform.header.stamp = "map", self.stamp()
        transform.transform.translation.x, transform.transform.translation.y = self.x, self.y
        transform.transform.rotation.z = math.sin(self.yaw / 2)
        transform.transform.rotation.w = math.cos(self.yaw / 2)
        return transform

    def odometry(self):
        odometry = Odometry(child_frame_id="base_link")
        odometry.header.frame_id, odometry.header.stamp = "odom", self.stamp()
        odometry.twist.twist = self.command
        return odometry

    def scan_of_a_wall(self):
        scan = LaserScan(angle_min=1.4, angle_max=1.7, angle_increment=0.1, range_min=0.1, range_max=5.0)
        scan.header.frame_id, scan.header.stamp = "base_link", self.stamp()
        scan.ranges = [4.0] * 4  # a wall on its left
        return scan

    def obey(self, order):
        topic, value = order.split()
        if value in ("on", "off"):
            (self.silent.add if value == "off" else self.silent.discard)(topic)
        elif topic in self.faults:
            self.faults[topic].publish(Empty())
        else:
            self.time = float(value)
        self.log(done=order, last=self.published.get(topic))

    def listen(self):
        for line in sys.stdin:
            self.orders.append(line.strip())


rclpy.init()
robot = Robot("simulated" in sys.argv)
threading.Thread(target=robot.listen, daemon=True).start()
robot.log(ready=True)
rclpy.spin(robot)
