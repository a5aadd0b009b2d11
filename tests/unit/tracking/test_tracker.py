"""The tracker against objects whose motion is known."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mbf_abstract.geometry.transform import Transform
from mbf_abstract.maps.tracking.objects import Motion
from mbf_abstract.maps.tracking.tracker import MAX_POINTS, Tracker, TrackingParameters

SENSOR = np.array([0.0, 0.0, 0.3])
PERIOD = 0.1


def disc(x, y, radius=0.25, count=24):
    """Points on the side of an upright cylinder that faces the sensor at (0, 0)."""
    towards = math.atan2(-y, -x)
    angles = towards + np.linspace(-1.4, 1.4, count)
    return np.column_stack([x + radius * np.cos(angles), y + radius * np.sin(angles), np.zeros(count)])


def follow(places, tracker=None, period=PERIOD):
    """A tracker that has seen a person at each of the places (x, y), None where it is hidden."""
    tracker = tracker or Tracker(TrackingParameters(), "map")
    for step, place in enumerate(places):
        points = np.zeros((0, 3)) if place is None else disc(*place)
        tracker.insert(points, SENSOR, step * period)
    return tracker, (len(places) - 1) * period


def walk(x, y, vx, vy, scans):
    return [(x + vx * step * PERIOD, y + vy * step * PERIOD) for step in range(scans)]


def test_a_person_who_walks_has_a_place_and_a_velocity():
    tracker, now = follow(walk(2.0, -1.0, 0.3, 0.8, 20))
    (person,) = tracker.objects(now)
    assert person.motion is Motion.MOVING
    assert (person.vx, person.vy) == pytest.approx((0.3, 0.8), abs=0.1)
    assert (person.x, person.y) == pytest.approx(
        (2.0 + 0.3 * now, -1.0 + 0.8 * now), abs=0.15
    )  # its far side is hidden
    assert person.radius == pytest.approx(0.25, abs=0.03)
    assert person.age == pytest.approx(now) and person.standing == 0.0


def noisy(places, seed):
    """Places that are off by 1.5 cm each, as of a lidar."""
    return [
        tuple(place) for place in np.asarray(places) + np.random.default_rng(seed).normal(0.0, 0.015, (len(places), 2))
    ]


@pytest.mark.parametrize(("vx", "vy"), [(0.8, 0.0), (-0.8, 0.0), (0.0, -0.8)])
def test_a_turn_is_known_two_scans_later(vx, vy):
    """At every of these times, with noise: by then the estimate is nearer to the new velocity than to the old one."""
    for seed in range(10):
        before = walk(2.5, -1.0, 0.0, 0.8, 20)
        after = walk(*before[-1], vx, vy, 3)[1:]
        tracker, now = follow(noisy(before + after, seed))
        (person,) = tracker.objects(now)
        error = math.hypot(person.vx - vx, person.vy - vy)
        assert error < math.hypot(person.vx, person.vy - 0.8), f"seed {seed}: {person.vx:.2f}, {person.vy:.2f}"


def test_who_turns_round_keeps_most_of_the_pace_although_the_estimated_velocity_falls():
    there = walk(2.5, -1.0, 0.0, 1.1, 20)
    places = there + walk(*there[-1], 0.0, -1.1, 8)[1:]
    tracker, speeds, paces = Tracker(TrackingParameters(), "map"), [], []
    for step, place in enumerate(places):
        tracker.insert(disc(*place), SENSOR, step * PERIOD)
        for person in tracker.objects(step * PERIOD)[:1] if step >= len(there) else ():
            speeds.append(person.speed)
            paces.append(person.pace)
    assert min(speeds) < 0.7 and min(paces) > 0.75


def test_who_slows_down_gently_is_as_fast_as_estimated():
    speed = np.clip(1.2 - 0.5 * PERIOD * np.arange(20), 0.0, None)
    tracker, now = follow([(2.5, y) for y in np.cumsum(PERIOD * speed) - 1.0])
    (person,) = tracker.objects(now)
    assert person.pace == person.speed


def test_noticing_turns_costs_no_accuracy_of_those_who_walk_straight_on():
    def error(turning_deviation):
        errors = []
        for seed in range(10):
            tracker = Tracker(TrackingParameters(turning_deviation=turning_deviation), "map")
            tracker, now = follow(noisy(walk(2.5, -1.2, 0.0, 0.8, 30), seed), tracker)
            (person,) = tracker.objects(now)
            errors.append(math.hypot(person.vx, person.vy - 0.8))
        return np.mean(errors)

    assert error(0.5) < 1.25 * error(0.0) + 0.01


def test_a_moving_object_is_where_it_will_be_at_the_time_it_is_asked_for():
    tracker, now = follow(walk(2.0, -1.0, 0.0, 0.8, 20))
    (here,), (later,) = tracker.objects(now), tracker.objects(now + 0.5)
    assert (later.x, later.y) == pytest.approx(here.position_in(0.5))
    assert later.unseen == pytest.approx(0.5)


def test_a_person_who_stops_waits_and_is_parked_in_the_end():
    settings_ = TrackingParameters(parked_time=4.0)
    places = [*walk(2.0, 0.0, 0.0, 0.8, 15), *[(2.0, 1.2)] * 80]
    tracker = Tracker(settings_, "map")
    motions = []
    for step, place in enumerate(places):
        tracker.insert(disc(*place), SENSOR, step * PERIOD)
        motions += [known.motion for known in tracker.objects(step * PERIOD)]
    assert [motions[0], *(b for a, b in pairwise(motions) if a is not b)] == [
        Motion.WAITING,
        Motion.MOVING,
        Motion.WAITING,
        Motion.PARKED,
    ]
    (person,) = tracker.objects((len(places) - 1) * PERIOD)
    assert (person.vx, person.vy) == (0.0, 0.0) and person.standing > 4.0
    assert person.course[1] > 0.2 and abs(person.course[0]) < 0.1, "it is known which way the person came"


def test_the_sensor_that_drives_past_a_box_sees_it_stand():
    """More and more of its far side comes into view; that is no motion."""
    tracker = Tracker(TrackingParameters(), "map")
    side = np.linspace(0.0, 0.7, 15)
    near = np.column_stack([2.0 + side, np.full(15, 1.0), np.zeros(15)])
    for step in range(40):
        shown = near[: 4 + step // 3]
        tracker.insert(shown, np.array([0.05 * step - 1.0, -0.5, 0.3]), step * PERIOD)
        assert all(known.motion is not Motion.MOVING for known in tracker.objects(step * PERIOD))


def test_a_hidden_person_is_followed_for_a_while_and_then_forgotten():
    tracker, now = follow([*walk(2.0, -1.0, 0.0, 0.8, 20), *[None] * 8])
    (person,) = tracker.objects(now)
    assert (person.x, person.y) == pytest.approx((2.0, -1.0 + 0.8 * now), abs=0.15)
    assert tracker.objects(now + 0.5) == ()
    tracker, now = follow([*walk(2.0, -1.0, 0.0, 0.8, 20), *[None] * 15])
    assert len(tracker) == 0


def test_two_people_who_pass_each_other_keep_their_numbers():
    tracker = Tracker(TrackingParameters(), "map")
    for step in range(30):
        one, other = disc(2.0, -1.2 + 0.08 * step), disc(3.2, 1.2 - 0.08 * step)
        tracker.insert(np.concatenate([one, other]), SENSOR, step * PERIOD)
    first, second = tracker.objects(2.9)
    assert (first.number, second.number) == (1, 2)
    assert first.vy == pytest.approx(0.8, abs=0.1) and second.vy == pytest.approx(-0.8, abs=0.1)


def test_walls_and_single_points_are_no_objects():
    wall = np.column_stack([np.full(60, 3.0), np.linspace(-2.0, 2.0, 60), np.zeros(60)])
    speckle = np.array([[1.0, 1.0, 0.0]])
    tracker = Tracker(TrackingParameters(), "map")
    for step in range(10):
        found = tracker.insert(np.concatenate([wall, speckle]), SENSOR, step * PERIOD)
    assert len(tracker) == 0 and not found.any()


def test_points_name_the_object_they_belong_to():
    tracker = Tracker(TrackingParameters(), "map")
    for step in range(5):
        points = np.concatenate([disc(2.0, 0.05 * step), [[0.0, -4.0, 0.0]]])
        found = tracker.insert(points, SENSOR, step * PERIOD)
    assert set(found[:-1].tolist()) == {1} and found[-1] == 0


def test_there_are_never_more_objects_than_allowed():
    tracker = Tracker(TrackingParameters(max_objects=3), "map")
    crowd = np.concatenate([disc(2.0, y) for y in (-3.0, -1.5, 0.0, 1.5, 3.0)])
    for step in range(5):
        tracker.insert(crowd, SENSOR, step * PERIOD)
    assert len(tracker.objects(0.4)) == 3


def test_a_late_scan_changes_nothing():
    tracker, now = follow(walk(2.0, 0.0, 0.0, 0.8, 10))
    before = tracker.objects(now)
    tracker.insert(disc(4.0, 1.0), SENSOR, 0.2)
    assert tracker.objects(now) == before


def test_a_cloud_of_any_size_is_thinned_to_a_bounded_number_of_points():
    many = np.column_stack(
        [np.full(5 * MAX_POINTS, 2.0), np.linspace(0.0, 0.5, 5 * MAX_POINTS), np.zeros(5 * MAX_POINTS)]
    )
    tracker = Tracker(TrackingParameters(), "map")
    for step in range(4):
        tracker.insert(many, SENSOR, step * PERIOD)
    assert len(tracker.objects(0.3)) == 1


def test_who_was_cleared_is_hidden_until_seen_again_and_still_the_same_with_the_same_velocity():
    tracker, now = follow(walk(2.0, 0.0, 0.0, 0.8, 10))
    (before,) = tracker.objects(now)
    tracker.clear()
    assert tracker.objects(now) == () and tracker.objects(now, guarded=True) == (before,)
    tracker.insert(disc(2.0, 0.8), SENSOR, now + PERIOD)
    (again,) = tracker.objects(now + PERIOD)
    assert again.number == before.number and again.motion is Motion.MOVING
    assert again.vy == pytest.approx(0.8, abs=0.1)


def test_who_was_cleared_and_is_not_seen_again_is_forgotten_and_numbers_are_not_used_again():
    tracker, now = follow(walk(2.0, 0.0, 0.0, 0.8, 10))
    tracker.clear(lambda places: places[:, 0] > 1.0)
    tracker.clear(lambda places: places[:, 0] > 9.0)  # who is cleared stays it
    assert tracker.objects(now) == ()
    for step in range(10, 25):
        tracker.insert(np.zeros((0, 3)), SENSOR, step * PERIOD)
    assert len(tracker) == 0 and tracker.objects(2.4, guarded=True) == ()
    for step in range(25, 30):
        tracker.insert(disc(2.0, 0.8), SENSOR, step * PERIOD)
    assert [known.number for known in tracker.objects(2.9)] == [2]


@pytest.mark.parametrize(("speed", "motion"), [(0.5, Motion.MOVING), (0.0, Motion.WAITING)])
def test_who_is_new_and_fast_moves_for_the_guard_before_it_has_come_far(speed, motion):
    """Coming out from behind a corner; all others wait until it has moved, as what is new may be part of a wall."""
    tracker, now = follow(walk(2.0, 0.0, 0.0, -speed, 5))
    (known,), (guarded,) = tracker.objects(now), tracker.objects(now, guarded=True)
    assert known.motion is Motion.WAITING and guarded.motion is motion
    assert guarded.vy == pytest.approx(-speed, abs=0.2)


@pytest.mark.parametrize(
    ("offsets", "motion"),
    [((0.03, 0.08, 0.15), Motion.MOVING), ((0.1, 0.0, 0.1, 0.0), Motion.WAITING), ((0.01, 0.02, 0.03), Motion.WAITING)],
)
def test_who_has_been_seen_for_long_and_not_moved_moves_for_the_guard_once_it_sets_off(offsets, motion):
    """A shelf that a wrong pose of the robot shifts to and fro, or that it sees more of, does not."""
    tracker, now = follow([(2.0, 0.0)] * 25 + [(2.0, -offset) for offset in offsets])
    (known,), (guarded,) = tracker.objects(now), tracker.objects(now, guarded=True)
    assert known.motion is Motion.WAITING and guarded.motion is motion


def test_who_waits_may_have_the_speed_that_does_not_show_and_who_is_parked_has_none():
    p = TrackingParameters(parked_time=4.0)
    for scans, pace in ((25, p.moving_distance / p.standing_time), (60, 0.0)):
        tracker = Tracker(p, "map")
        for step in range(scans):
            tracker.insert(disc(2.0, 0.0), SENSOR, step * PERIOD)
        (known,) = tracker.objects((scans - 1) * PERIOD)
        assert known.pace == pace


def test_who_has_moved_waits_and_goes_on_moves_for_the_guard_before_coming_far():
    """A shuttle that waited for somebody. Its first 0.1 m count; while it waits it stands for the guard too."""
    waits = [*walk(2.0, 0.0, 0.0, -0.5, 15), *[(2.0, -0.7)] * 40]
    tracker, now = follow(waits)
    assert tracker.objects(now, guarded=True)[0].motion is Motion.WAITING
    tracker, now = follow([*waits, *walk(2.0, -0.7, 0.0, -0.5, 3)])
    (known,), (guarded,) = tracker.objects(now), tracker.objects(now, guarded=True)
    assert known.motion is Motion.WAITING and guarded.motion is Motion.MOVING
    assert guarded.vy == pytest.approx(-0.5, abs=0.2)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=10, deadline=None)
def test_the_same_scans_give_the_same_objects(seed):
    def run():
        rng = np.random.default_rng(seed)
        tracker = Tracker(TrackingParameters(), "map")
        for step in range(12):
            tracker.insert(rng.uniform(-3.0, 3.0, (200, 3)) * (1.0, 1.0, 0.0), SENSOR, step * PERIOD)
        return tracker.objects(1.2)

    assert run() == run()


def test_an_object_is_expressed_in_another_frame():
    tracker, now = follow(walk(2.0, -1.0, 0.0, 0.8, 20))
    (person,) = tracker.objects(now)
    quarter = math.sqrt(0.5)
    there = person.seen_from(Transform((1.0, 0.0, 0.0), (0.0, 0.0, quarter, quarter), "odom", "map"))
    assert there.frame_id == "odom"
    assert (there.x, there.y) == pytest.approx((1.0 - person.y, person.x))
    assert (there.vx, there.vy) == pytest.approx((-person.vy, person.vx))
    assert there.course == pytest.approx((-person.course[1], person.course[0])) and there.course[0] < -0.2


def test_who_is_seen_in_few_scans_is_forgotten_in_half_the_time():
    for scans, hidden, known in ((2, 4, 1), (2, 7, 0), (5, 7, 1), (5, 12, 0)):
        tracker, _ = follow([*walk(2.0, -1.0, 0.0, 0.5, scans), *[None] * hidden])
        assert len(tracker) == known, f"{scans} scans, then hidden for {hidden * PERIOD:.1f} s"


def test_points_of_who_stops_are_no_longer_those_of_someone_who_moves():
    places = [*walk(2.0, 0.0, 0.0, 0.8, 15), *[(2.0, 1.2)] * 25]
    tracker, moving = Tracker(TrackingParameters(), "map"), []
    for step, place in enumerate(places):
        numbers = tracker.insert(disc(*place), SENSOR, step * PERIOD)
        moving.append(bool(tracker.are_moving(numbers).any()))
    assert moving[10] and moving[20] and not moving[-1]


def test_two_scans_of_one_moment_are_both_taken_in_and_an_older_one_is_not():
    tracker = Tracker(TrackingParameters(), "map")
    for step in range(10):
        for y in (-1.0, 1.0):  # what two sensors see
            tracker.insert(disc(2.0, y), SENSOR, step * PERIOD)
        late = tracker.insert(disc(-2.0, 1.0), SENSOR, (step - 1) * PERIOD)
        assert not late.any()
    assert [(round(one.x), round(one.y)) for one in tracker.objects(9 * PERIOD)] == [(2, -1), (2, 1)]


def test_who_is_forgotten_leaves_every_other_one_there_once():
    tracker = Tracker(TrackingParameters(), "map")
    for step in range(25):
        leaves = [disc(2.0, -1.0)] if step < 10 else []
        tracker.insert(np.concatenate([*leaves, disc(2.0, 1.0)]), SENSOR, step * PERIOD)
        numbers = [known.number for known in tracker.objects(step * PERIOD)]
        assert len(set(numbers)) == len(numbers)
    assert numbers == [2]


def test_asked_for_a_time_before_the_last_scan_everybody_is_where_they_were_seen_last():
    tracker, now = follow(walk(2.0, -1.0, 0.0, 0.8, 20))
    (last,), (before,) = tracker.objects(now), tracker.objects(now - 1.0)
    assert (before.x, before.y) == (last.x, last.y) and before.unseen == 0.0
    tracker, _ = follow([(2.0, -1.0)] * 5)
    assert tracker.objects(-1.0)[0].standing == 0.0
