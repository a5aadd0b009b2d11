"""Messages of a robot reach navigation, whether as JSON or as CBOR, and bad ones are reported once."""

import base64
import json
import math

import cbor2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mbf_abstract.drive.robot import Odometry
from mbf_abstract.geometry import Twist
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.time.sim_clock import SimClock
from mbf_ros.messages.geometry import MessageContext, duration
from mbf_ros.messages.interfaces import completed
from mbf_ros.robot_inputs import RobotInputs
from mbf_ros.ros2.robot import Arrivals, Frames, RosRobot
from mbf_ros.rosbridge.protocol import OperationError, frame
from mbf_ros.rosbridge_robot.frames import TYPED_ARRAYS, cbor_decoder, operation_of
from mbf_ros.rosbridge_robot.topics import REPORT_PERIOD, Reports, RobotTopics

DECODE = cbor_decoder()
FLOAT32, UINT8 = 85, 64


class Site:
    """Topics of a robot, with all that takes them."""

    def __init__(self):
        self.clock, self.transforms, self.said, self.scans, self.goals = SimClock(), TransformBuffer(), [], [], []
        self.arrivals = Arrivals(self.clock.now)
        self.topics = RobotTopics(
            self.clock.now,
            lambda: MessageContext("map", 1000.0),
            self.arrivals,
            Reports(self.clock.now, self.said.append),
        )
        frames = Frames("map", "base_link")
        self.robot = RosRobot(lambda _: None, self.transforms, self.clock, self.arrivals, frames, lambda: 1.0)
        inputs = RobotInputs(self.clock.now, lambda: MessageContext("map", 1000.0), self.topics.hear)
        self.topics.listen_to(inputs.of_robot(self.robot, self.transforms, True))
        sensors = {
            "front/scan": ("sensor_msgs/LaserScan", "lidar"),
            "/points": ("sensor_msgs/PointCloud2", "camera"),
        }
        self.topics.listen_to(inputs.of_sensors(self.scans.append, sensors), 0.2)

    def send(self, topic, **message):
        self.topics.take({"op": "publish", "topic": topic, "msg": message})

    def odom(self, stamp, speed=0.0):
        twist = {"twist": {"linear": {"x": speed}, "angular": {}}}
        self.send("/odom", header={"stamp": duration(stamp)}, twist=twist)

    def tf(self, parent, child):
        transform = {"translation": {"x": 1.0}, "rotation": {"w": 1.0}}
        self.send("/tf", transforms=[{"header": {"frame_id": parent}, "child_frame_id": child, "transform": transform}])


def scan(**fields):
    return {"header": {"frame_id": "/laser"}, "angle_min": 0.0, "angle_increment": 0.1, "range_max": 5.0, **fields}


def test_odometry_and_transforms_are_taken_with_frames_that_lose_their_slash():
    site = Site()
    site.tf("/map", "/base_link")
    site.odom(1000.0, speed=0.5)
    assert site.robot.odometry() == Odometry(Twist((0.5, 0.0, 0.0)), 0.0)
    assert site.robot.problem() == ""


def test_clouds_are_asked_for_as_cbor_and_not_too_often():
    asked = {one["topic"]: one for one in map(json.loads, Site().topics.requests())}
    assert asked["/tf"]["type"] == "tf2_msgs/TFMessage" and asked["/tf"]["throttle_rate"] == 0
    assert (asked["/points"]["throttle_rate"], asked["/points"]["compression"]) == (200, "cbor")
    assert (asked["/front/scan"]["throttle_rate"], asked["/front/scan"]["compression"]) == (0, "cbor")
    assert asked["/odom"]["compression"] == "none"


def test_a_topic_may_be_added_while_the_others_are_asked_for(monkeypatch):
    site = Site()

    def slow_frame(*arguments, topic, **fields):
        site.topics.listen(f"{topic}/more", "nav_msgs/Odometry", lambda _: None)  # as another thread does meanwhile
        return frame(*arguments, topic=topic, **fields)

    monkeypatch.setattr("mbf_ros.rosbridge_robot.topics.frame", slow_frame)
    assert len(site.topics.requests()) == 5


def test_a_bad_message_is_reported_with_topic_and_field_and_those_that_follow_are_counted():
    site = Site()
    for _ in range(3):
        site.send("/front/scan", **scan(ranges=[1.0, "far"]))
    assert site.said == ["/front/scan: sensor_msgs/LaserScan.ranges[1]: expected a float32, got 'far'"]
    site.clock.sleep(REPORT_PERIOD)
    site.send("/front/scan", ranges=[1.0])
    assert len(site.said) == 2 and "'header' of sensor_msgs/LaserScan is missing" in site.said[1]
    assert site.said[1].endswith("(and 2 more since the last report)")
    site.tf("odom", "odom")
    assert site.said[2].startswith("/tf: ") and "a frame in itself" in site.said[2]
    assert site.scans == []


@pytest.mark.parametrize(("stamp", "where"), [(1003.0, "3.00 s in the future"), (990.0, "10.00 s in the past")])
def test_a_calendar_that_is_wrong_is_reported(stamp, where):
    site = Site()
    site.odom(stamp)
    assert site.said == [f"/odom: it is stamped {where}; set both calendars (NTP), or see --time"]


def test_a_sensor_is_missed_once_it_was_heard_and_after_a_lost_connection_all_must_come_again():
    site = Site()
    site.tf("map", "base_link")
    site.odom(1000.0)
    assert site.robot.problem() == ""
    site.send("/front/scan", **scan(ranges=[1.0]))
    site.topics.lost()
    assert "on /odom yet" in site.robot.problem()
    site.odom(1000.0)
    assert "on /front/scan yet" in site.robot.problem()
    site.send("/front/scan", **scan(ranges=[1.0]))
    assert site.robot.problem() == ""


def test_the_infinite_range_of_a_ray_that_met_nothing_survives_in_cbor():
    site, ranges = Site(), np.array([2.0, math.inf], np.float32)
    for sent in (cbor2.CBORTag(FLOAT32, ranges.tobytes()), [2.0, None]):
        operation = {"op": "publish", "topic": "/front/scan", "msg": scan(ranges=sent)}
        site.topics.take(operation_of(cbor2.dumps(operation), DECODE))
    as_cbor, as_json = site.scans
    assert as_cbor.hits.tolist() == [True, False] and as_json.hits.tolist() == [True]


def test_the_bytes_of_a_cloud_are_taken_plain_as_a_typed_array_and_in_base64():
    data = np.array([[1.0, 2.0, 3.0]], "<f4").tobytes()
    fields = [{"name": axis, "offset": 4 * i, "datatype": 7, "count": 1} for i, axis in enumerate("xyz")]
    size = {"height": 1, "width": 1, "point_step": 12, "row_step": 12, "fields": fields, "is_bigendian": False}
    site = Site()
    for sent in (data, cbor2.CBORTag(UINT8, data), base64.b64encode(data).decode()):
        message = {"header": {"frame_id": "camera"}, "is_dense": True, "data": sent, **size}
        operation = {"op": "publish", "topic": "/points", "msg": message}
        site.topics.take(operation_of(cbor2.dumps(operation), DECODE))
    assert [one.points.tolist() for one in site.scans] == [[[1.0, 2.0, 3.0]]] * 3 and site.said == []


@given(st.sampled_from(sorted(TYPED_ARRAYS)), st.lists(st.integers(0, 100), max_size=5))
def test_a_typed_array_is_the_list_of_its_numbers(tag, numbers):
    array = np.array(numbers, TYPED_ARRAYS[tag])
    message = {"op": "x", "numbers": cbor2.CBORTag(tag, array.tobytes())}
    found = operation_of(cbor2.dumps(message), DECODE)["numbers"]
    assert found.tolist() == numbers and found.dtype.isnative


@given(st.binary(max_size=40) | st.text(max_size=40))
def test_whatever_comes_is_an_operation_or_refused_with_a_text(frame):
    try:
        assert isinstance(operation_of(frame, DECODE)["op"], str)
    except OperationError as error:
        assert str(error)


def test_a_tag_that_is_not_known_is_refused():
    with pytest.raises(OperationError, match="expected a frame of CBOR: the tag 99 of CBOR is not known"):
        operation_of(cbor2.dumps({"op": "x", "msg": cbor2.CBORTag(99, b"")}), DECODE)


def test_numbers_of_another_kind_than_the_field_are_checked_one_by_one():
    whole = np.array([1, 2], np.int16)
    message = completed("sensor_msgs/LaserScan", scan(ranges=whole))
    assert message["ranges"].dtype == np.float32 and message["ranges"].tolist() == [1.0, 2.0]
