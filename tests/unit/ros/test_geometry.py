"""Stamps, frames, velocities and transforms between messages and ours."""

import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mbf_abstract.drive.robot import Odometry
from mbf_abstract.geometry import Twist
from mbf_abstract.geometry.transform import Transform
from mbf_ros.messages import geometry
from mbf_ros.messages.geometry import InvalidValueError, MessageContext
from mbf_ros.messages.interfaces import completed
from mbf_ros.messages.json_text import json_text

CONTEXT = MessageContext("map", 1_700_000_000.0)


@given(st.integers(0, 10**12))
def test_a_stamp_comes_back_to_the_microsecond(microseconds):
    stamp = microseconds / 1e6
    assert CONTEXT.stamp(CONTEXT.time(stamp)) == pytest.approx(stamp, abs=1e-6) or stamp == 0.0


@given(st.floats(allow_nan=True, allow_infinity=True))
def test_every_number_has_a_legal_time(seconds):
    time = geometry.duration(seconds)
    assert -(2**31) <= time["sec"] < 2**31 and 0 <= time["nanosec"] < 10**9
    if math.isfinite(seconds) and abs(seconds) < 2**31 - 1:
        assert geometry.seconds_of(time) == pytest.approx(seconds, abs=1e-6)


def test_no_stamp_stays_no_stamp():
    assert CONTEXT.stamp({"sec": 0, "nanosec": 0}) == 0.0


def transform(parent="/map", child="/odom", rotation=(0, 0, 0, 1), sec=1_700_000_005):
    q = dict(zip("xyzw", rotation, strict=True))
    header = {"stamp": {"sec": sec, "nanosec": 0}, "frame_id": parent}
    return {"header": header, "child_frame_id": child, "transform": {"translation": {"x": 1.0}, "rotation": q}}


def transforms_of(*transforms, static=False):
    message = completed("tf2_msgs/TFMessage", {"transforms": list(transforms)})
    return geometry.transforms_of(message, CONTEXT, received=9.0, static=static)


def test_transforms_lose_slashes_and_get_our_time():
    (found,) = transforms_of(transform())
    assert found == Transform((1.0, 0.0, 0.0), parent="map", child="odom", stamp=5.0)


def test_a_transform_without_a_stamp_is_as_old_as_its_arrival():
    (found,) = transforms_of(transform(sec=0))
    assert found.stamp == 9.0


def test_transforms_come_back_as_they_were():
    sent = [Transform((1.0, 2.0, 3.0), (0.0, 0.0, 0.6, 0.8), "map", "odom", 2.5)]
    text = json_text(geometry.transforms_message(sent, CONTEXT))
    assert geometry.transforms_of(completed("tf2_msgs/TFMessage", json.loads(text)), CONTEXT, 0.0) == sent


@pytest.mark.parametrize(
    ("bad", "text"),
    [
        (transform(rotation=(0, 0, 0, 0)), "squared norm of the rotation is 0"),
        (transform(rotation=(0, 0, None, 1)), "not finite"),
        (transform(child="/"), "a frame name must not be empty"),
    ],
)
def test_what_is_no_transform_is_refused(bad, text):
    with pytest.raises(InvalidValueError, match=text):
        transforms_of(bad)


def test_odometry_comes_back_as_it_was():
    sent = Odometry(Twist.planar(0.5, 0.1, -0.2), 4.0)
    message = geometry.odometry_message(sent, Transform((1, 2, 0), parent="odom"), CONTEXT)
    back = completed("nav_msgs/Odometry", json.loads(json_text(message)))
    assert geometry.odometry_of(back, CONTEXT, received=9.0) == sent
    assert (back["header"]["frame_id"], back["child_frame_id"]) == ("odom", "base_link")


def test_a_velocity_that_is_not_finite_is_refused():
    message = completed("geometry_msgs/Twist", {"linear": {"x": None}})
    with pytest.raises(InvalidValueError, match=r"linear\[0\] must be finite"):
        geometry.twist_of(message)
