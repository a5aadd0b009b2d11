"""The robot's time is read off the stamps of its messages, or off ``/clock``."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mbf_abstract.time.sim_clock import SimClock
from mbf_ros.messages.geometry import MessageContext, duration
from mbf_ros.ros2.robot import Arrivals
from mbf_ros.rosbridge_robot.options import TimeSource
from mbf_ros.rosbridge_robot.robot_time import CONTRADICTIONS, LeastDelay, RobotTime
from mbf_ros.rosbridge_robot.topics import Reports, RobotTopics

ROBOT = 5000.0  # s by which the robot's calendar is ahead


class Site:
    def __init__(self, source):
        self.real, self.said = SimClock(), []
        self.arrivals = Arrivals(self.real.now)
        reports = Reports(self.real.now, self.said.append)
        self.topics = RobotTopics(self.real.now, MessageContext, self.arrivals, reports)
        self.time = RobotTime(source, self.real, self.arrivals)
        self.time.listen(self.topics)

    def send(self, topic, **message):
        self.topics.take({"op": "publish", "topic": topic, "msg": message})

    def odom(self, stamp):
        twist = {"twist": {"linear": {}, "angular": {}}}
        self.send("/odom", header={"stamp": duration(stamp)}, twist=twist)


def test_no_time_is_known_before_the_first_message():
    for source in (TimeSource.ODOM, TimeSource.SIMULATED):
        assert Site(source).time.clock(0.0) is None
    assert Site(TimeSource.CALENDAR).time.clock(0.0) is not None


def test_the_message_with_the_least_delay_shows_the_time_of_a_robot_whose_calendar_is_not_ours():
    site = Site(TimeSource.ODOM)
    site.real.sleep(1.0)
    for delay in (0.3, 0.02, 0.2):
        sent = site.real.now() + ROBOT
        site.real.sleep(delay)
        site.odom(sent)
    clock = site.time.clock(0.0)
    assert clock.epoch + clock.now() == pytest.approx(site.real.now() + ROBOT - 0.02, abs=0.05)
    assert site.said == []


def test_odometry_without_a_stamp_shows_no_time():
    site = Site(TimeSource.ODOM)
    site.odom(0.0)
    assert site.time.clock(0.0) is None


def test_time_passes_as_the_topic_clock_says_and_a_jump_back_is_one():
    site, jumps = Site(TimeSource.SIMULATED), []
    site.send("/clock", clock=duration(100.0))
    clock = site.time.clock(0.0)
    clock.on_jump.append(jumps.append)
    site.send("/clock", clock=duration(100.5))
    assert clock.now() == pytest.approx(0.5) and clock.epoch == pytest.approx(100.0)
    site.send("/clock", clock=duration(10.0))
    assert jumps == [pytest.approx(-90.5)] and clock.now() == pytest.approx(0.5)
    site.real.sleep(3.0)
    assert "no message on /clock for 3.00 s" in site.arrivals.problems(1.0)["/clock"]


@given(st.lists(st.tuples(st.floats(0.0, 3.0), st.floats(0.0, 0.49)), min_size=1, max_size=40), st.floats(0.5, 6.0))
def test_the_least_delay_is_that_of_all_messages_in_the_window(messages, window):
    least, arrival, seen = LeastDelay(window), 0.0, []
    for gap, delay in messages:
        arrival += gap
        stamp = arrival - delay + ROBOT
        seen.append((arrival, stamp - arrival))
        naive = max(difference for at, difference in seen if at >= arrival - window)
        assert least.add(stamp, arrival) == naive


@pytest.fixture
def followed():
    """A site whose robot has been heard for a while, and the jumps of its time."""
    site, jumps = Site(TimeSource.ODOM), []
    say(site, 50)
    site.time.clock(0.0).on_jump.append(jumps.append)
    return site, jumps


def say(site, count, step=0.0):
    """Odometry at 50 Hz from a robot whose calendar is off by a step."""
    for _ in range(count):
        site.real.sleep(0.02)
        site.odom(site.real.now() + ROBOT + step)


@pytest.mark.parametrize("step", [-3.0, 3.0])
def test_a_calendar_that_is_set_is_one_jump_within_a_second(followed, step):
    site, jumps = followed
    say(site, 50, step)
    assert jumps == [pytest.approx(step, abs=0.1)]
    say(site, 600, step)
    assert len(jumps) == 1


@pytest.mark.parametrize("step", [-3.0, 3.0])
def test_a_bad_stamp_now_and_then_is_no_jump(followed, step):
    site, jumps = followed
    for _ in range(3):
        say(site, 1, step)
        say(site, 30)
    assert jumps == []


def test_messages_that_the_network_has_held_back_for_seconds_change_nothing():
    least = LeastDelay()
    least.add(ROBOT, 0.0)
    sent = [0.02 * number for number in range(1, 101)]
    found = {least.add(stamp + ROBOT, 2.0 + 0.001 * number) for number, stamp in enumerate(sent)}
    assert found == {ROBOT}


@given(st.lists(st.tuples(st.floats(0.0, 1.0), st.floats(-5.0, 5.0)), min_size=1, max_size=40))
def test_whatever_came_before_the_estimate_is_that_of_messages_that_agree_for_half_a_second(messages):
    least, arrival = LeastDelay(), 0.0
    for gap, difference in messages:
        arrival += gap
        least.add(arrival + ROBOT + difference, arrival)
    for _ in range(CONTRADICTIONS):
        arrival += 0.3
        found = least.add(arrival + ROBOT, arrival)
    assert found == pytest.approx(ROBOT, abs=0.51)
