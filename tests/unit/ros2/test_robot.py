"""The driver of a robot behind topics lets no motion out while something fails to come."""

import pytest

from mbf_abstract.drive.robot import Odometry
from mbf_abstract.geometry import Twist
from mbf_abstract.geometry.transform import Transform
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.time.sim_clock import SimClock
from mbf_ros.ros2.robot import Arrivals, Frames, RosRobot, SilenceError

MOTION = Twist((0.5, 0.0, 0.0))


class Site:
    """A robot of which everything is heard, once a second, unless it is silenced."""

    def __init__(self):
        self.clock, self.transforms, self.sent = SimClock(), TransformBuffer(), []
        self.arrivals = Arrivals(self.clock.now)
        self.arrivals.expect("odom")
        self.robot = RosRobot(
            self.sent.append, self.transforms, self.clock, self.arrivals, Frames("map", "base_link"), lambda: 1.5
        )

    def hear(self, silent=""):
        now = self.clock.now()
        for topic in {"odom", "scan"} - {silent}:
            self.arrivals.hear(topic)
        if silent != "tf":
            self.transforms.set(Transform((0.0, 0.0, 0.0), parent="map", child="base_link", stamp=now))
        self.robot.take_odometry(Odometry(Twist(), now))


def test_motions_go_out_while_all_is_heard():
    site = Site()
    for _ in range(3):
        site.hear()
        site.robot.send_command(MOTION)
        assert site.robot.odometry().stamp == site.clock.now()
        site.clock.sleep(1.0)
    assert site.sent == [MOTION] * 3


@pytest.mark.parametrize(
    ("silent", "text"), [("odom", "on odom for 2.00 s"), ("scan", "on scan for 2.00 s"), ("tf", "2.000 s old")]
)
def test_only_zero_goes_out_when_one_falls_silent_until_it_is_heard_again(silent, text):
    site = Site()
    site.hear()
    for _ in range(2):
        site.clock.sleep(1.0)
        site.hear(silent)
    with pytest.raises(SilenceError, match=text):
        site.robot.send_command(MOTION)
    with pytest.raises(SilenceError, match=text):
        site.robot.odometry()
    site.robot.send_command(Twist())
    site.hear()
    site.robot.send_command(MOTION)
    assert site.sent == [Twist(), MOTION]


def test_nothing_is_driven_before_the_first_odometry():
    site = Site()
    with pytest.raises(SilenceError, match="no message has come on odom yet"):
        site.robot.send_command(MOTION)
