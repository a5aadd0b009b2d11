"""Publishes messages: a JSON object with topic, type and message on each line of stdin; "latched" where it says so."""

import json
import sys
import threading

import rclpy
from rclpy.qos import DurabilityPolicy, QoSProfile

from mbf_ros.messages.interfaces import completed
from mbf_ros.ros2.conversion import fill, interface_class

rclpy.init()
node = rclpy.create_node("publisher")
publishers = {}
threading.Thread(target=rclpy.spin, args=(node,), daemon=True).start()
for line in sys.stdin:
    order = json.loads(line)
    topic, kind = order["topic"], interface_class(order["type"])
    if topic not in publishers:
        policy = DurabilityPolicy.TRANSIENT_LOCAL if order.get("latched") else DurabilityPolicy.VOLATILE
        publishers[topic] = node.create_publisher(kind, topic, QoSProfile(depth=1, durability=policy))
    publishers[topic].publish(fill(kind(), completed(order["type"], order["message"])))
    sys.stdout.write(json.dumps({"published": topic}) + "\n")
    sys.stdout.flush()
