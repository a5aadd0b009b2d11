"""Facts F215 to F237 of the transform cache and buffer of tf2, and what ours promises beyond them."""

import math
import threading

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mbf_abstract.geometry import Path, Pose, quaternion_from_yaw, rotation_matrix
from mbf_abstract.geometry.transform import InvalidTransformError, Transform, TransformError, rotate, slerp
from mbf_abstract.geometry.transform_buffer import MAX_PENDING_REQUESTS, TransformBuffer
from mbf_abstract.geometry.transform_cache import MAX_SAMPLES, TransformCache
from mbf_abstract.geometry.transform_problems import (
    ConnectivityError,
    ExtrapolationError,
    StaleTransformError,
    UnknownFrameError,
)

NANO = 2.0**-30  # about a nanosecond, and a binary fraction, so that sums of stamps are exact


def sample(stamp, x=0.0, y=0.0, yaw=0.0, parent="map", child="base", static=False):
    return Transform((x, y, 0.0), quaternion_from_yaw(yaw), parent, child, stamp, static)


def buffer_with(*samples):
    buffer = TransformBuffer()
    for transform in samples:
        buffer.set(transform)
    return buffer


def planar(transform):
    yaw = Pose(transform.translation, transform.rotation).yaw
    return (*(round(value, 4) for value in transform.translation[:2]), abs(round(math.degrees(yaw), 4)))


# ------------------------------------------------------------------------------------------------------------- cache
INSERTED = [sample(stamp * NANO, x=index) for index, stamp in enumerate((0, 10, 5, 3, 8, 8, 8))]


def kept(cache):
    return [(round(transform.stamp / NANO), int(transform.translation[0])) for transform in cache]


def cache_with_inserted(times=1):
    cache = TransformCache(window=10 * NANO)
    for transform in INSERTED * times:
        cache.insert(transform)
    return cache


@pytest.mark.parametrize("times", [1, 2], ids=["F215", "F216"])
def test_samples_are_kept_newest_first_and_only_once(times):
    assert kept(cache_with_inserted(times)) == [(10, 1), (8, 6), (8, 5), (8, 4), (5, 2), (3, 3), (0, 0)]


def test_f217_samples_older_than_the_window_are_pruned_and_refused():
    cache = cache_with_inserted()
    assert cache.insert(sample(15 * NANO, x=20))
    assert not cache.insert(sample(0.0, x=21))
    assert cache.insert(sample(5 * NANO, x=22))
    assert kept(cache) == [(15, 20), (10, 1), (8, 6), (8, 5), (8, 4), (5, 22), (5, 2)]


def test_f218_each_stamp_is_returned_exactly():
    cache = TransformCache(window=200.0)
    for stamp in np.random.default_rng(0).permutation(99):
        cache.insert(sample(float(stamp), x=float(stamp) ** 2))
    assert [cache.at(float(stamp)).translation[0] for stamp in range(99)] == [stamp**2 for stamp in range(99)]


def test_f219_the_same_sample_is_kept_once():
    cache = TransformCache(window=10.0)
    for _ in range(99):
        cache.insert(sample(1.0))
    assert len(cache) == 1


def test_f220_without_a_time_the_newest_is_returned():
    buffer = buffer_with(sample(1.0, x=1), sample(3.0, x=3), sample(2.0, x=2))
    assert buffer.lookup("map", "base").translation == (3.0, 0.0, 0.0)
    assert buffer.lookup("map", "base").stamp == 3.0


@pytest.mark.parametrize("ratio", [0.0, 0.1, 0.25, 0.5, 0.99, 1.0])
def test_f221_between_two_samples_it_is_linear_in_translation_and_slerp_in_rotation(ratio):
    cache = TransformCache(window=10.0)
    cache.insert(sample(0.0, x=1.0, yaw=0.3))
    cache.insert(sample(100 * NANO, x=3.0, y=-2.0, yaw=1.5))
    found = cache.at(ratio * 100 * NANO)
    assert found.translation == pytest.approx((1.0 + 2.0 * ratio, -2.0 * ratio, 0.0), abs=2e-6)
    assert Pose((0, 0, 0), found.rotation).yaw == pytest.approx(0.3 + 1.2 * ratio, abs=1e-6)


@pytest.mark.parametrize("stamp", [1.0, 1.3, 1.99])
def test_f222_where_the_parent_changes_the_older_sample_holds(stamp):
    cache = TransformCache(window=10.0)
    cache.insert(sample(1.0, x=1.0, parent="a"))
    cache.insert(sample(2.0, x=2.0, parent="b"))
    assert (cache.at(stamp).parent, cache.at(stamp).translation[0]) == ("a", 1.0)
    assert cache.at(2.0).parent == "b"


@given(st.lists(st.floats(-1, 1), min_size=8, max_size=8))
def test_f223_slerp_at_one_half_has_equal_angles_to_both_ends(numbers):
    ends = np.array(numbers).reshape(2, 4)
    norms = np.linalg.norm(ends, axis=1)
    if norms.min() < 1e-3:
        return
    a, b = (tuple(end) for end in ends / norms[:, None])
    if abs(np.dot(a, b)) < 1e-6:  # half a turn apart: both ways are equally short
        return
    middle = Pose((0, 0, 0), slerp(a, b, 0.5))
    assert middle.angle_to(Pose((0, 0, 0), a)) == pytest.approx(middle.angle_to(Pose((0, 0, 0), b)), abs=1e-5)


def test_the_number_of_samples_is_bounded():
    cache = TransformCache(window=1e9)
    for stamp in range(MAX_SAMPLES + 5):
        cache.insert(sample(float(stamp)))
    assert (len(cache), cache.oldest.stamp) == (MAX_SAMPLES, 5.0)


# ------------------------------------------------------------------------------------------------------------ lookup
@pytest.mark.parametrize(
    ("samples", "time", "error", "text"),
    [
        pytest.param((), None, UnknownFrameError, "'base' and 'map' are unknown frames; there is no", id="F224"),
        pytest.param((sample(1.0, parent="foo"),), None, UnknownFrameError, "'map' is an unknown frame", id="F225"),
        pytest.param((sample(2.0),), 4.0, ExtrapolationError, "'base' has one sample at 2.000 s", id="F226"),
        pytest.param((sample(2.0), sample(3.0)), 1.0, ExtrapolationError, "extrapolation into the past", id="F227a"),
        pytest.param((sample(2.0), sample(3.0)), 4.0, ExtrapolationError, "into the future: 'base'", id="F227b"),
        pytest.param(
            (sample(2.0, parent="odom"), sample(2.0, child="laser")),
            None,
            ConnectivityError,
            "separate trees with the roots 'odom' and 'map'",
            id="two trees",
        ),
    ],
)
def test_what_cannot_be_answered_names_both_frames_and_what_exists(samples, time, error, text):
    buffer = buffer_with(*samples)
    with pytest.raises(error) as raised:
        buffer.lookup("map", "base", time)
    assert "no transform from 'base' to 'map': " in str(raised.value)
    assert text in str(raised.value)
    assert all(f"{transform.parent}->{transform.child}" in str(raised.value) for transform in samples)
    assert not buffer.can_transform("map", "base", time)


def test_f226_one_sample_answers_its_own_time():
    assert buffer_with(sample(2.0, x=5)).lookup("map", "base", 2.0).translation[0] == 5.0


def test_f228_a_static_transform_answers_any_time():
    buffer = buffer_with(sample(1.0, x=1, static=True))
    assert buffer.lookup("map", "base", 2.0).translation[0] == 1.0
    assert buffer.lookup("map", "base", now=100.0, max_age=0.1).stamp == 100.0
    with pytest.raises(TransformError, match=r"map->base \(static\)"):
        buffer.lookup("map", "x")


def test_f230_a_cleared_buffer_takes_a_static_transform():
    buffer = buffer_with(sample(1.0))
    buffer.clear()
    assert buffer.frames() == []
    buffer.set(sample(0.0, x=4, static=True))
    assert buffer.lookup("map", "base").translation[0] == 4.0
    buffer.set(sample(5.0, x=6))
    assert buffer.lookup("map", "base", 5.0).translation[0] == 6.0


def test_f231_a_pending_request_is_answered_when_the_transform_arrives():
    buffer, answers = TransformBuffer(), []
    buffer.when_available("map", "base", 2.0, answers.append)
    withdraw = buffer.when_available("map", "base", 9.0, answers.append)
    buffer.set(sample(1.0, x=1))
    assert answers == []
    buffer.set(sample(3.0, x=3))
    withdraw()
    withdraw()
    buffer.set(sample(10.0, x=10))
    buffer.when_available("map", "base", 10.0, answers.append)
    assert [(answer.parent, answer.child, answer.stamp) for answer in answers] == [
        ("map", "base", 2.0),
        ("map", "base", 10.0),
    ]


def test_the_number_of_pending_requests_is_bounded():
    buffer = TransformBuffer()
    for _ in range(MAX_PENDING_REQUESTS):
        buffer.when_available("map", "base", None, print)
    with pytest.raises(RuntimeError, match="1000 transform requests"):
        buffer.when_available("map", "base", None, print)


@pytest.mark.parametrize(
    "arguments",
    [
        pytest.param(((0, 0, 0), (0, 0, 0, 0)), id="F229"),
        pytest.param(((float("nan"), 0, 0),), id="F232 nan"),
        pytest.param(((0, 0, 0), (0, 0, 0, 1), "", "b"), id="F232 no parent"),
        pytest.param(((0, 0, 0), (0, 0, 0, 1), "a", ""), id="F232 no child"),
        pytest.param(((0, 0, 0), (0, 0, 0, 1), "/a", "b"), id="slash"),
        pytest.param(((0, 0, 0), (0, 0, 0, math.sqrt(1.0101))), id="F234 long"),
        pytest.param(((0, 0, 0), (0, 0, 0, math.sqrt(0.9899))), id="F234 short"),
        pytest.param(((0, 0),), id="two numbers"),
    ],
)
def test_an_impossible_transform_is_refused(arguments):
    with pytest.raises(InvalidTransformError):
        Transform(*arguments)


def test_f232_a_frame_in_itself_and_a_loop_are_refused():
    buffer = buffer_with(sample(0.0, parent="a", child="b"), sample(0.0, parent="b", child="c"))
    with pytest.raises(InvalidTransformError, match="a frame in itself"):
        buffer.set(sample(0.0, parent="a", child="a"))
    with pytest.raises(InvalidTransformError, match="closes a loop: c -> b -> a -> c"):
        buffer.set(sample(0.0, parent="c", child="a"))


@pytest.mark.parametrize("names", [("", "b"), ("b", ""), ("/a", "b"), ("b", "/a"), ("", "")])
def test_f233_an_illegal_frame_name_is_an_invalid_argument(names):
    with pytest.raises(InvalidTransformError, match="frame name"):
        buffer_with(sample(0.0)).lookup(*names)


def test_f234_a_rotation_within_the_tolerance_is_normalised():
    rotation = Transform((0, 0, 0), (0.0, 0.0, 0.0, math.sqrt(1.0099))).rotation
    assert rotation == (0.0, 0.0, 0.0, 1.0)


def test_f235_a_chain_adds_up():
    buffer = buffer_with(sample(1.0, x=1, parent="a", child="b"), sample(1.0, x=1, parent="b", child="c"))
    assert buffer.lookup("a", "c").translation == (2.0, 0.0, 0.0)
    assert buffer.lookup("c", "a").translation == (-2.0, 0.0, 0.0)
    assert (buffer.lookup("c", "a").parent, buffer.lookup("c", "a").child) == ("c", "a")


@pytest.mark.parametrize(("source", "expected"), [("e", (-1.0, 2.0, 0.0)), ("g", (-2.0, 2.0, 0.0))])
def test_f236_frames_on_two_branches_meet_at_their_common_ancestor(source, expected):
    buffer = buffer_with(
        sample(1.0, x=1, parent="a", child="b"),
        sample(1.0, x=1, parent="b", child="c"),
        sample(1.0, y=1, parent="a", child="d"),
        sample(1.0, x=1, y=1, parent="d", child="e"),
        sample(1.0, y=1, parent="d", child="f"),
        sample(1.0, parent="f", child="g"),
    )
    assert buffer.lookup("c", source, 1.0).translation == expected


@pytest.mark.parametrize(
    ("steps", "expected"),
    [
        (1, (-0.2929, 0.7071, 45.0)),
        (2, (-1.0, 1.0, 90.0)),
        (4, (-2.0, 0.0, 180.0)),
        (8, (0.0, 0.0, 0.0)),
    ],
)
def test_f237_a_ring_of_eight_frames_closes(steps, expected):
    x, y = math.sqrt(0.5) - 1.0, math.sqrt(0.5)
    ring = [sample(1.0, x, y, math.pi / 4, parent=f"f{i}", child=f"f{i + 1}") for i in range(steps)]
    assert planar(buffer_with(*ring).lookup("f0", f"f{steps}", 1.0)) == pytest.approx(expected, abs=1e-4)


# ---------------------------------------------------------------------------------------------------- beyond the facts
@pytest.mark.parametrize("odom_stamps", [(9.9,), (1.0, 9.9)], ids=["no common time", "common time"])
def test_an_old_transform_is_refused_with_its_age(odom_stamps):
    buffer = buffer_with(sample(1.0, parent="odom"), *(sample(stamp, child="odom") for stamp in odom_stamps))
    assert buffer.lookup("map", "odom", now=10.0, max_age=0.5).stamp == 9.9
    with pytest.raises(StaleTransformError) as raised:
        buffer.lookup("map", "base", now=10.0, max_age=0.5)
    assert str(raised.value) == (
        "no transform from 'base' to 'map': the newest is 9.000 s old, limit 0.500 s; "
        "there is odom->base (9.000 s old), map->odom (0.100 s old)"
    )


def test_the_newest_common_time_interpolates_the_faster_frame():
    buffer = buffer_with(
        sample(1.0, x=10, parent="map", child="odom"),
        sample(0.5, x=0, parent="odom"),
        sample(1.5, x=2, parent="odom"),
    )
    found = buffer.lookup("map", "base")
    assert (found.stamp, found.translation[0]) == (1.0, 11.0)


def test_the_same_frame_is_the_identity_without_any_transform():
    assert TransformBuffer().lookup("map", "map", now=4.0, max_age=0.0).translation == (0.0, 0.0, 0.0)


def test_poses_paths_and_points_are_mapped_alike():
    buffer = buffer_with(sample(1.0, x=5, y=1, yaw=0.7, parent="map", child="odom"))
    pose = Pose.planar(1.0, 2.0, 0.3, frame_id="odom", stamp=9.0)
    mapped = buffer.transform_pose(pose, "map")
    path = buffer.transform_path(Path.from_poses([pose, pose]), "map")
    points = buffer.lookup("map", "odom").apply([pose.position])
    c, s = math.cos(0.7), math.sin(0.7)
    assert mapped.position == pytest.approx((5 + c - 2 * s, 1 + s + 2 * c, 0.0))
    assert (mapped.frame_id, mapped.stamp) == ("map", 9.0)
    assert mapped.yaw == pytest.approx(1.0)
    assert path[1].position == pytest.approx(mapped.position)
    assert path[1].orientation == pytest.approx(mapped.orientation)
    assert points[0] == pytest.approx(mapped.position)


def test_what_is_in_the_target_frame_already_is_returned_as_it_is():
    buffer, pose, path = TransformBuffer(), Pose.planar(1, 2), Path.from_points([[0, 0, 0], [1, 0, 0]], guidance="g")
    assert buffer.transform_pose(pose, "map") is pose
    assert buffer.transform_path(path, "map") is path


def test_frames_that_do_not_meet_cannot_be_multiplied():
    with pytest.raises(ValueError, match="map->base cannot be followed by map->base"):
        sample(0.0) @ sample(0.0)


unit = st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda q: np.linalg.norm(q) > 1e-2)
vector = st.tuples(*[st.floats(-100, 100)] * 3)


@given(unit, unit, vector, vector)
def test_transforms_multiply_and_invert_like_their_matrices(q1, q2, t1, t2):
    def make(t, q, parent, child):
        q = np.array(q) / np.linalg.norm(q)
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = rotation_matrix(q), t
        return Transform(t, tuple(q), parent, child), matrix

    (T_a_b, A), (T_b_c, B) = make(t1, q1, "a", "b"), make(t2, q2, "b", "c")
    point = np.array([1.0, -2.0, 3.0])
    assert (T_a_b @ T_b_c).apply([point])[0] == pytest.approx((A @ B @ [*point, 1.0])[:3], abs=1e-9)
    assert T_a_b.inverse().apply([point])[0] == pytest.approx((np.linalg.inv(A) @ [*point, 1.0])[:3], abs=1e-9)
    assert rotate(T_a_b.rotation, tuple(point)) == pytest.approx(A[:3, :3] @ point, abs=1e-12)


def test_many_threads_set_and_look_up_without_a_wrong_answer():
    buffer, wrong = buffer_with(sample(0.0)), []

    def write():
        for step in range(500):
            buffer.set(sample(step * 0.01, x=step * 0.01))

    def read():
        for _ in range(500):
            found = buffer.lookup("map", "base")
            if abs(found.translation[0] - found.stamp) > 1e-12:
                wrong.append(found)

    threads = [threading.Thread(target=work) for work in (write, read, read)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert wrong == []
