"""Our node as ``mbf ros2 CONFIG`` runs it, with time to end on a slow machine, and faults of ours that tests wake.

A message on ``fail`` makes a callback raise, one on ``hang`` makes a callback wait for ever, the cancelling of an
exe_path goal makes its coroutine raise, and a first message on ``/clock`` that is before ``EPOCH`` the callback that
takes it.
"""

import sys
import threading
from dataclasses import replace
from functools import partial

from std_msgs.msg import Empty

import mbf_ros.ros2.node as node
import mbf_ros.ros2.options as options
from mbf_abstract.cli import main
from mbf_ros.ros2.actions import ACTIONS

EPOCH = 450.0
FAULT = KeyError("a fault of ours")


class Inputs(node.Inputs):
    def __init__(self, robot):
        super().__init__(robot)
        self._node.create_subscription(Empty, "fail", self.fail, 10)
        self._node.create_subscription(Empty, "hang", self.hang, 10)

    def fail(self, message):
        raise FAULT

    def hang(self, message):
        threading.Event().wait()


class Clock(node.SimulatedRosClock):
    def __init__(self, ros_time):
        if ros_time < EPOCH:
            raise FAULT
        super().__init__(ros_time)


def result(value, context):
    if value.outcome == outcomes.CANCELED:
        raise FAULT
    return mapping.result(value, context)


mapping, outcomes = ACTIONS["exe_path"]
ACTIONS["exe_path"] = (replace(mapping, result=result), outcomes)
node.Inputs, node.SimulatedRosClock = Inputs, Clock
options.NodeOptions = partial(options.NodeOptions, time_to_end=60.0, time_to_send=60.0)
sys.argv = ["mbf", "ros2", *sys.argv[1:]]
main()
