"""Commands to a robot: zero is the first on every connection but the first one, and repeated for a while."""

import json

import pytest

from mbf_abstract.geometry import Twist
from mbf_abstract.time.sim_clock import SimClock
from mbf_ros.messages.geometry import MessageContext
from mbf_ros.rosbridge_robot.outputs import LONGEST_SETTLING, SETTLING_TIME, ZERO_PERIOD, CommandTopic, Settling


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


class Sent(list):
    """A connection that keeps the speeds that are sent."""

    def newest(self, kind, frame):
        self.append(json.loads(frame)["msg"]["linear"]["x"])


def test_zero_is_repeated_unless_the_last_command_was_a_motion():
    sent = Sent()
    topic = CommandTopic(lambda: sent, False, "base_link", SimClock(), lambda: MessageContext("map", 0.0))
    topic.repeat_zero()
    topic.publish(Twist.planar(0.3))
    topic.repeat_zero()
    topic.publish(Twist())
    topic.repeat_zero()
    assert sent == [0.0, 0.3, 0.0, 0.0]


@pytest.mark.parametrize(
    ("silence", "expected"), [(0.0, SETTLING_TIME), (20.0, 20.0 + SETTLING_TIME), (1e9, LONGEST_SETTLING)]
)
def test_zero_is_due_until_a_while_after_the_robot_was_heard_again_but_not_for_ever(silence, expected):
    now = [5.0]
    settling = Settling(lambda: now[0])
    assert not settling.is_due(True)
    settling.begin()
    due = []
    for tenths in range(1000):
        now[0] = 5.0 + tenths / 10
        if settling.is_due(is_heard=tenths / 10 > silence):
            due.append(tenths / 10)
    assert len(due) == pytest.approx(expected / ZERO_PERIOD, abs=2)
    assert due[0] == 0.0 and due[-1] == pytest.approx(expected, abs=2 * ZERO_PERIOD)
