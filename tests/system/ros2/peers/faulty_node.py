"""Our node as ``mbf ros2 CONFIG`` runs it, with a fault of ours: a message on ``fail`` makes a callback raise."""

import sys

from std_msgs.msg import Empty

from mbf_abstract.cli import main
from mbf_ros.ros2.topics import Inputs

listen_to_goals = Inputs.listen_to_goals


def listen_and_fail(inputs, send):
    def fail(message):
        raise KeyError("a fault of ours")

    listen_to_goals(inputs, send)
    inputs._node.create_subscription(Empty, "fail", fail, 10)


Inputs.listen_to_goals = listen_and_fail
sys.argv = ["mbf", "ros2", *sys.argv[1:]]
main()
