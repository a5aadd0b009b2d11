"""What blocks a path, and what the event log says of tracked objects."""

from dataclasses import replace

import pytest

from mbf_abstract.geometry import Path
from mbf_abstract.maps.tracking.blocking import blockages
from mbf_abstract.maps.tracking.objects import MOST_REPORTS, Motion, MotionChanges, TrackedObject
from mbf_abstract.maps.tracking.robot_box import RobotBox

DISC = RobotBox.disc(0.3)
STRAIGHT = Path.from_points([(0.1 * step, 0.0, 0.0) for step in range(81)])


def known(number=1, x=4.0, y=0.0, vx=0.0, vy=0.0, motion=Motion.PARKED, z=0.0):
    return TrackedObject(number, motion, x, y, z, vx, vy, 0.25, 5.0, 0.0, 0.0, 0.0, "map")


def found(*objects, within_time=2.0, path=STRAIGHT):
    return [(blockage.by.number, blockage.pose) for blockage in blockages(DISC, path, objects, within_time)]


def test_a_free_path_is_blocked_by_nobody():
    assert found() == [] == found(known(y=0.6), known(y=-3.0, vy=0.5, motion=Motion.MOVING))


@pytest.mark.parametrize("motion", Motion)
def test_what_is_on_the_path_blocks_it_with_what_it_does(motion):
    (blockage,) = blockages(DISC, STRAIGHT, [known(motion=motion)], 2.0)
    assert blockage.by.motion is motion
    assert blockage.pose == 35 and blockage.distance == pytest.approx(3.5)


def test_who_comes_onto_the_path_in_time_blocks_it():
    comes = known(y=-1.6, vy=0.8, motion=Motion.MOVING)
    assert [number for number, _ in found(comes)] == [1]
    assert found(comes, within_time=1.0) == [] == found(comes, within_time=0.0)


def test_the_first_along_the_path_comes_first():
    assert [number for number, _ in found(known(1, x=6.0), known(2, x=2.0), known(3, x=4.0))] == [2, 3, 1]


@pytest.mark.parametrize(
    ("course", "along"), [((0.3, 0.0), 1.0), ((-0.3, 0.0), -1.0), ((0.0, 0.3), 0.0), ((0, 0), 0.0)]
)
def test_it_is_known_whether_who_stands_came_along_the_path(course, along):
    stands = replace(known(motion=Motion.WAITING), course=course)
    assert blockages(DISC, STRAIGHT, [stands], 2.0)[0].along == pytest.approx(along)


@pytest.mark.parametrize(("x", "ahead"), [(0.4, 0.4), (-0.1, -0.1), (4.0, 4.0)])
def test_it_is_known_how_far_ahead_somebody_is(x, ahead):
    (blockage,) = blockages(DISC, STRAIGHT, [known(x=x, motion=Motion.WAITING)], 2.0)
    assert blockage.ahead == pytest.approx(ahead)


def test_who_is_ahead_of_a_robot_that_is_going_to_turn_round_is_behind_its_path():
    back = Path.from_points([(-0.1 * step, 0.0, 0.0) for step in range(81)])
    (blockage,) = blockages(DISC, back, [known(x=0.4, motion=Motion.WAITING)], 2.0)
    assert blockage.ahead == pytest.approx(-0.4)


@pytest.mark.parametrize(("x", "vx", "blocks"), [(-0.6, 0.4, []), (0.6, 0.4, [1]), (0.6, -0.4, [1]), (-0.2, -0.4, [1])])
def test_who_follows_is_not_in_the_way(x, vx, blocks):
    """Behind the robot and on; ahead of it, on or back; beside it, back."""
    moves = replace(known(x=x, vx=vx, motion=Motion.MOVING), course=(vx, 0.0))
    assert [number for number, _ in found(moves)] == blocks


def test_other_storeys_do_not_block():
    assert found(known(z=3.0)) == []


def test_changes_of_motion_are_reported_once():
    changes = MotionChanges()
    stands, walks = known(motion=Motion.WAITING), known(motion=Motion.MOVING, vx=0.5)
    reported = [[event["motion"] for event in changes.changes(objects)] for objects in (
        [stands], [walks], [walks], [stands], [replace(stands, motion=Motion.PARKED)], [], [],
    )]  # fmt: skip
    assert reported == [[], ["moving"], [], ["waiting"], ["parked"], ["gone"], []]


def test_an_update_reports_a_bounded_number_of_changes_and_the_next_one_the_others():
    changes = MotionChanges()
    crowd = [known(number, motion=Motion.MOVING) for number in range(1, MOST_REPORTS + 6)]
    assert [len(list(changes.changes(crowd))) for _ in range(3)] == [MOST_REPORTS, 5, 0]
    assert [len(list(changes.changes([]))) for _ in range(3)] == [MOST_REPORTS, 5, 0]


def test_an_event_names_the_place_the_velocity_and_the_size_of_an_object():
    walks = known(3, x=4.0, y=-1.0, vx=0.5, vy=0.1, motion=Motion.MOVING, z=0.2)
    assert walks.to_data() == {
        "number": 3,
        "motion": "moving",
        "position": [4.0, -1.0, 0.2],
        "velocity": [0.5, 0.1],
        "radius": 0.25,
    }
