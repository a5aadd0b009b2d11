"""A new plan that begins along the old one goes on where that was; another one begins anew."""

import math

import pytest

from mbf_abstract.execution.path_tracker import PathTracker
from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.maps.controllers.continued_path import carried_over, shift_between
from mbf_abstract.maps.controllers.room_to_turn import AHEAD, RoomToTurn
from mbf_abstract.maps.controllers.tight_places import KEPT, TightPlaces

LINE = [(0.1 * k, 0.0) for k in range(31)]
WANTED, TURN, CURVE = Twist.planar(0.5, wz=0.3), Twist.planar(wz=0.4), Twist.planar(0.1, wz=0.2)


def tracked(points, at=None, frame_id="map", yaw=None):
    if yaw is None:
        path = Path.from_points([(*point, 0.0) for point in points], frame_id=frame_id)
    else:
        path = Path.from_poses([Pose.planar(*point, yaw) for point in points])
    tracker = PathTracker(path, dimensions=2)
    if at is not None:
        tracker.update(at)
    return tracker


@pytest.fixture
def old():
    return tracked(LINE, at=(1.23, 0.0))


def test_lengths_are_shifted_by_where_the_robot_is_on_both(old):
    assert shift_between(old, tracked([(1.2, 0.02), *LINE[13:]])) == pytest.approx(0.03 - 1.23, abs=2e-3)
    assert shift_between(old, tracked(LINE)) == pytest.approx(0.0)


@pytest.mark.parametrize(
    "points",
    [
        [(1.23, 0.1 * k) for k in range(20)],
        [(1.23 - 0.1 * k, 0.0) for k in range(20)],
        [(x, 1.0) for x, _ in LINE],
        [(1.23, 0.0)],
    ],
    ids=["off to the side", "back", "elsewhere", "no length"],
)
def test_a_path_that_leads_elsewhere_goes_on_with_nothing(old, points):
    assert shift_between(old, tracked(points)) is None


def test_neither_does_one_in_the_other_gear_nor_in_another_frame(old):
    assert shift_between(old, tracked(LINE[12:], yaw=math.pi)) is None
    assert shift_between(tracked(LINE, at=(1.23, 0.0), yaw=math.pi), tracked(LINE[12:], yaw=math.pi)) is not None
    assert shift_between(old, tracked(LINE, frame_id="odom")) is None


def test_a_robot_that_turns_to_its_path_still_does_so_after_a_new_plan(old):
    places = TightPlaces()
    places.drives_otherwise(old, WANTED, TURN)
    new = tracked(LINE[12:], at=(1.23, 0.0))
    _, kept = carried_over(RoomToTurn(), places, old, new)
    assert kept.is_close(new)
    new.update((1.24 + KEPT, 0.0))
    assert not kept.is_close(new)
    assert not carried_over(RoomToTurn(), places, old, tracked(LINE, frame_id="odom"))[1].is_close(new)


@pytest.mark.parametrize(("end", "is_close"), [(2.0, True), (3.0, False)])
def test_that_the_way_to_the_end_is_tight_holds_for_an_end_as_near(end, is_close):
    places, old = TightPlaces(), tracked(LINE[:21], at=(1.3, 0.0))
    assert places.drives_otherwise(old, WANTED, CURVE)
    new = tracked([point for point in LINE[13:] if point[0] < end + 0.05], at=(1.3, 0.0))
    assert carried_over(RoomToTurn(), places, old, new)[1].is_close(new) == is_close


def make_room(room, tracker, x):
    """One cycle in which a turn on the spot is blocked, and a curve is driven."""
    tracker.update((x, 0.0))
    return room.choose(
        Pose.planar(x, 0.0), tracker.progress, [TURN, CURVE], 0.3, lambda motion: "" if motion.vx else "x"
    )


def test_making_room_is_counted_over_all_plans():
    room, tracker = RoomToTurn(), tracked(LINE)
    for x in (0.0, 0.2, 0.0, 0.2):  # to and fro, not ahead on the path
        command, reason = make_room(room, tracker, x)
        new = tracked([(0.0, 0.0), *LINE[1:]])
        room, _ = carried_over(room, TightPlaces(), tracker, new)
        tracker = new
    assert command is None and "of driving on" in reason


def test_a_robot_that_comes_ahead_over_many_short_plans_makes_room_as_long_as_it_has_to():
    room, tracker = RoomToTurn(), tracked(LINE)
    for k in range(40):
        x = 0.8 * AHEAD * k
        assert make_room(room, tracker, x)[0] is CURVE
        new = tracked([(x, 0.0), *(point for point in LINE if point[0] > x + 1e-6), (4.0, 0.0)])
        room, _ = carried_over(room, TightPlaces(), tracker, new)
        tracker = new
