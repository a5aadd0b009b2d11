"""Transforms stamped after the clock: they age from when they came, and those far ahead are refused."""

import pytest

from mbf_abstract.geometry.transform import Transform, TransformError
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.geometry.transform_problems import MAX_LEAD, StaleTransformError

UNIX = 1.79e9  # time.time() where the clock began at zero


class Time:
    """A clock to set by hand."""

    now = 0.0

    def __call__(self):
        return self.now


@pytest.fixture
def time():
    return Time()


@pytest.fixture
def buffer(time):
    one = TransformBuffer()
    one.follow_clock(time)
    return one


def pose(stamp, x=0.0, parent="map", child="base"):
    return Transform((x, 0.0, 0.0), parent=parent, child=child, stamp=stamp)


def test_a_post_dated_transform_ages_from_when_it_came(buffer, time):
    buffer.set(pose(1.0))
    time.now = 0.5
    assert buffer.lookup("map", "base", now=0.5, max_age=0.5).stamp == 1.0
    with pytest.raises(StaleTransformError, match=r"0\.600 s old"):
        buffer.lookup("map", "base", now=0.6, max_age=0.5)


@pytest.mark.parametrize("ahead", [MAX_LEAD + 0.01, 1000.0, UNIX])
def test_a_transform_far_ahead_is_refused_and_the_good_ones_serve_on(buffer, time, ahead):
    buffer.set(pose(0.0, x=1.0))
    buffer.set(pose(ahead, x=99.0))
    time.now = 0.1
    buffer.set(pose(0.1, x=2.0))
    assert buffer.lookup("map", "base", now=0.1, max_age=0.5).translation[0] == 2.0
    with pytest.raises(StaleTransformError, match=r"0\.600 s old"):
        buffer.lookup("map", "base", now=0.7, max_age=0.5)


def test_an_error_names_what_was_refused(buffer):
    buffer.set(pose(UNIX))
    with pytest.raises(TransformError, match=r"refused: map->base \(1790000000\.000 s ahead of the clock"):
        buffer.lookup("map", "base")


def test_one_frame_of_the_future_does_not_hide_that_its_source_is_silent(buffer, time):
    buffer.set(pose(1.9, parent="map", child="odom"))
    for step in range(30):
        time.now = 0.1 * step
        buffer.set(pose(time.now, parent="odom", child="base"))
    with pytest.raises(StaleTransformError, match=r"2\.900 s old"):
        buffer.lookup("map", "base", now=2.9, max_age=1.0)


def test_what_was_filled_in_before_the_clock_was_known_is_looked_through(time):
    buffer = TransformBuffer()
    buffer.set(pose(1000.0))
    buffer.set(pose(1.0, parent="base", child="lidar"))
    buffer.follow_clock(time)
    assert not buffer.can_transform("map", "base") and buffer.can_transform("base", "lidar")


def test_a_buffer_without_a_clock_refuses_at_the_lookup():
    buffer = TransformBuffer()
    buffer.set(pose(1000.0))
    with pytest.raises(StaleTransformError, match=r"stamped 1000\.000 s in the future"):
        buffer.lookup("map", "base", now=0.0, max_age=3.0)


def test_static_transforms_have_no_future(buffer):
    buffer.set(Transform((1.0, 0.0, 0.0), parent="map", child="base", stamp=UNIX, static=True))
    assert buffer.lookup("map", "base", now=0.0, max_age=0.1).translation[0] == 1.0


def test_of_a_chain_one_step_of_the_future_is_enough():
    buffer = TransformBuffer()  # without a clock it takes such transforms, too
    buffer.set(pose(1.0, child="odom"))
    buffer.set(pose(2.0 + MAX_LEAD, parent="odom"))
    with pytest.raises(StaleTransformError, match=r"stamped 3\.000 s in the future"):
        buffer.lookup("map", "base", now=1.0, max_age=5.0)
