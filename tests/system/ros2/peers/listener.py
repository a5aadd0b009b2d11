"""Subscribes to topics, a name, a type and "latched" or "volatile" on each line of stdin; writes what comes as JSON."""

import json
import sys
import threading

import rclpy
from rclpy.qos import DurabilityPolicy, QoSProfile

from mbf_ros.messages.json_text import json_text
from mbf_ros.ros2.conversion import interface_class, to_dict

rclpy.init()
node = rclpy.create_node("listener")


def say(topic, message):
    sys.stdout.write(json_text({"topic": topic, "message": to_dict(message)}) + "\n")
    sys.stdout.flush()


threading.Thread(target=rclpy.spin, args=(node,), daemon=True).start()
for line in sys.stdin:
    topic, kind, durability = line.split()
    policy = DurabilityPolicy.TRANSIENT_LOCAL if durability == "latched" else DurabilityPolicy.VOLATILE
    quality = QoSProfile(depth=100, durability=policy)
    node.create_subscription(interface_class(kind), topic, lambda message, topic=topic: say(topic, message), quality)
    sys.stdout.write(json.dumps({"listens": topic}) + "\n")
    sys.stdout.flush()
