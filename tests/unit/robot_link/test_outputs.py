"""Commands to a robot: zero is the first on every connection but the first one."""

import json

import pytest

from mbf_abstract.time.sim_clock import SimClock
from mbf_ros.messages.geometry import MessageContext
from mbf_ros.rosbridge_robot.outputs import CommandTopic


@pytest.mark.parametrize("stamped", [False, True])
def test_zero_comes_first_where_commands_were_sent_on_an_earlier_connection(stamped):
    topic = CommandTopic(lambda: None, stamped, "base_link", SimClock(), lambda: MessageContext("map", 0.0))
    kind = "geometry_msgs/TwistStamped" if stamped else "geometry_msgs/Twist"
    advertised = {"op": "advertise", "topic": "/cmd_vel", "type": kind}
    assert [json.loads(one) for one in topic.greeting()] == [advertised]
    for _ in range(2):
        again, command = map(json.loads, topic.greeting())
        assert again == advertised and command["op"] == "publish" and command["topic"] == "/cmd_vel"
        value = command["msg"]["twist"] if stamped else command["msg"]
        assert all(number == 0.0 for vector in value.values() for number in vector.values())
