"""Where a path leads through a gap that is hardly wider than the robot, controllers know it in time."""

import math

import numpy as np
import pytest

from mbf_abstract.execution.path_tracker import PathTracker
from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.maps.controllers.room_to_turn import SMALL_TURN
from mbf_abstract.maps.controllers.tight_places import (
    CLOSELY,
    KEPT,
    REACH,
    ROOM,
    SLIGHT_TURN,
    TightPlaces,
    is_driven_closely,
    least_turn,
)

LINE = [(0.1 * k, 0.0, 0.0) for k in range(41)]


def tracker_at(x, points=LINE):
    tracker = PathTracker(Path.from_points(points), dimensions=2)
    tracker.update((x, 0.0))
    return tracker


def gap(begin, end, left, right):
    """A robot fits between ``begin`` and ``end`` [m] along x if it is at most ``left`` and ``right`` [m] off y = 0."""
    return lambda x, y, yaw: not begin <= x <= end or -right <= y <= left


@pytest.mark.parametrize("x", [0.0, 0.45, 1.0])
def test_the_length_to_a_gap_without_room_to_either_side_is_known(x):
    assert TightPlaces().distance(tracker_at(x), True, gap(1.2, 2.0, 0.02, 0.03)) == pytest.approx(1.2 - x, abs=0.1)


def test_in_the_gap_it_is_zero_and_a_gap_beyond_the_reach_does_not_count():
    assert TightPlaces().distance(tracker_at(1.5), True, gap(1.2, 2.0, 0.02, 0.02)) == 0.0
    assert TightPlaces().distance(tracker_at(0.0), True, gap(REACH + 0.1, 2.0, 0.02, 0.02)) == math.inf


def test_who_needs_longer_to_brake_looks_farther():
    assert TightPlaces().distance(tracker_at(0.0), True, gap(2.5, 3.0, 0.02, 0.02), 3.0) == pytest.approx(2.5, abs=0.1)


@pytest.mark.parametrize(("left", "right"), [(0.0, 2 * ROOM), (2 * ROOM, 0.0), (2 * ROOM, 2 * ROOM)])
def test_room_to_one_side_is_room_as_along_a_wall(left, right):
    assert TightPlaces().distance(tracker_at(0.5), True, gap(1.0, 2.0, left, right)) == math.inf


@pytest.mark.parametrize(("left", "right"), [(1.4 * ROOM, 0.0), (0.0, 1.4 * ROOM), (1.2 * ROOM, 0.6 * ROOM)])
def test_a_path_along_one_side_of_a_narrow_gap_is_tight_although_there_is_some_room_to_the_other(left, right):
    assert TightPlaces().distance(tracker_at(0.5), True, gap(1.0, 2.0, left, right)) == pytest.approx(0.5, abs=0.1)


def test_what_stands_on_the_path_is_no_gap():
    assert TightPlaces().distance(tracker_at(0.5), True, lambda x, y, yaw: x < 1.0) == math.inf


def test_a_gap_behind_a_cusp_counts_and_each_stroke_is_looked_at_as_it_is_driven():
    yaws = []
    there, back = [(0.1 * k, 0.0) for k in range(11)], [(0.1 * k, 0.0) for k in range(9, -11, -1)]
    poses = [Pose.planar(x, y, 0.0) for x, y in there + back]
    tracker = PathTracker(Path.from_poses(poses), dimensions=2)
    tracker.update((0.7, 0.0))

    def fits(x, y, yaw):
        if x < 0.99:  # at the cusp it is asked whether the robot can turn
            yaws.append(yaw)
        return gap(0.0, 0.5, 0.02, 0.02)(x, y, yaw)

    assert TightPlaces().distance(tracker, True, fits) == pytest.approx(0.3 + 0.5, abs=0.11)
    assert np.allclose(np.cos(yaws), 1.0), "forward and backward, with the same heading"


def test_a_place_that_only_the_heading_of_the_plan_fits_is_no_obstacle():
    poses = [Pose.planar(x, y, 0.3 if x >= 1.0 else 0.0) for x, y, _ in LINE]
    tracker = PathTracker(Path.from_poses(poses), dimensions=2)
    tracker.update((0.0, 0.0))

    def slanted(x, y, yaw):
        return x < 1.0 or (abs(y) < 0.01 and yaw == pytest.approx(0.3))

    assert TightPlaces().distance(tracker, True, slanted) == pytest.approx(1.0, abs=0.1)


def test_what_stands_between_the_poses_of_a_sparse_path_is_an_obstacle():
    tracker = tracker_at(0.5, [(0.0, 0.0, 0.0), (4.0, 0.0, 0.0)])
    assert TightPlaces().distance(tracker, True, lambda x, y, yaw: not 1.0 <= x <= 1.2) == math.inf


def out_and_back(at):
    """A robot at ``at`` [m] on a path 1 m forward along x, and 2 m back."""
    points = [0.1 * k for k in range(11)] + [0.1 * k for k in range(9, -11, -1)]
    tracker = PathTracker(Path.from_poses([Pose.planar(x, 0.0, 0.0) for x in points]), dimensions=2)
    tracker.update((at, 0.0))
    return tracker


def test_a_cusp_where_the_robot_cannot_turn_is_tight_and_one_where_it_can_is_not():
    def lengthwise(x, y, yaw):
        return abs(math.sin(yaw)) < 0.5

    assert TightPlaces().distance(out_and_back(0.3), True, lengthwise) == pytest.approx(0.7, abs=0.01)
    assert TightPlaces().distance(out_and_back(0.3), True, lambda x, y, yaw: True) == math.inf


def test_the_end_of_a_path_is_not_tight_because_the_robot_cannot_turn_there():
    assert TightPlaces().distance(tracker_at(3.5), True, lambda x, y, yaw: abs(math.sin(yaw)) < 0.5) == math.inf


def test_an_answer_holds_until_the_robot_has_come_on():
    asked = []

    def fits(x, y, yaw):
        asked.append(x)
        return gap(1.2, 2.0, 0.0, 0.0)(x, y, yaw)

    places, tracker = TightPlaces(), tracker_at(0.5)
    assert places.distance(tracker, True, fits) == pytest.approx(0.7, abs=0.1)
    before = len(asked)
    tracker.update((0.5 + 0.6 * KEPT, 0.0))
    assert places.distance(tracker, True, fits) == pytest.approx(0.7 - 0.6 * KEPT, abs=0.1) and len(asked) == before
    tracker.update((0.5 + 1.1 * KEPT, 0.0))
    places.distance(tracker, True, fits)
    assert len(asked) > before


def test_a_robot_that_comes_back_to_its_path_from_beside_it_has_so_much_farther_to_a_tight_place():
    places, tracker = TightPlaces(), tracker_at(0.5)
    for beside, farther in ((1.4, 1.2), (0.15, 0.0)):
        tracker.update((0.5, beside))
        assert places.distance(tracker, True, gap(1.2, 2.0, 0.0, 0.0)) == pytest.approx(0.7 + farther, abs=0.1)


def test_while_it_comes_back_the_robot_sees_that_who_made_the_place_tight_has_gone():
    places, tracker = TightPlaces(), tracker_at(0.5)
    tracker.update((0.5, 1.4))
    assert places.distance(tracker, True, gap(0.6, 2.0, 0.0, 0.0)) < math.inf
    tracker.update((0.5, 1.4 - 1.1 * KEPT))
    assert places.distance(tracker, True, lambda x, y, yaw: True) == math.inf


WANTED, CURVE, TURN = Twist.planar(0.5, wz=0.3), Twist.planar(0.1, wz=0.2), Twist.planar(wz=0.4)


@pytest.mark.parametrize(("at", "is_tight"), [(2.9, False), (3.1, True)])
def test_once_the_way_was_blocked_near_its_end_the_rest_of_a_path_is_tight(at, is_tight):
    places, tracker = TightPlaces(), tracker_at(at)
    assert not places.drives_otherwise(tracker, WANTED, WANTED) and not places.drives_otherwise(tracker, WANTED, None)
    assert places.drives_otherwise(tracker, WANTED, CURVE) == is_tight
    assert not places.drives_otherwise(tracker, WANTED, CURVE), "it is said once"
    assert places.distance(tracker, True, lambda x, y, yaw: True) == (0.0 if is_tight else math.inf)


def test_a_way_that_was_blocked_before_a_cusp_or_a_turn_says_nothing_of_the_end():
    assert not TightPlaces().drives_otherwise(out_and_back(0.9), WANTED, CURVE)
    assert not TightPlaces().drives_otherwise(tracker_at(3.5), TURN, CURVE)


def test_a_robot_that_brakes_does_not_turn_to_its_path():
    places = TightPlaces()
    assert not places.drives_otherwise(tracker_at(1.0), WANTED, Twist()) and not places.is_close(tracker_at(1.0))


def test_a_robot_that_turns_to_its_path_keeps_to_it_closely_until_it_has_come_on():
    places, tracker = TightPlaces(), tracker_at(1.0)
    assert not places.drives_otherwise(tracker, WANTED, TURN)
    assert places.is_close(tracker) and places.distance(tracker, True, lambda x, y, yaw: True) == 0.0
    tracker.update((1.01 + KEPT, 0.0))
    assert not places.is_close(tracker) and places.distance(tracker, True, lambda x, y, yaw: True) == math.inf


def test_who_is_driven_closely_turns_to_the_path_by_less_than_others():
    tracker = tracker_at(0.5)
    assert not is_driven_closely(tracker) and least_turn(tracker) == SMALL_TURN
    tracker.cusp_reached = CLOSELY
    assert is_driven_closely(tracker) and least_turn(tracker) == SLIGHT_TURN < SMALL_TURN
