"""Reads serialised messages, a type and bytes in base64 on each line, with rclpy; writes their fields as JSON."""

import base64
import sys

from rclpy.serialization import deserialize_message

from mbf_ros.messages.json_text import json_text
from mbf_ros.ros2.conversion import interface_class, to_dict

for line in sys.stdin:
    name, content = line.split()
    message = deserialize_message(base64.b64decode(content), interface_class(name))
    sys.stdout.write(json_text(to_dict(message)) + "\n")
