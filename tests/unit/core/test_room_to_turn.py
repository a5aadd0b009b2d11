"""Making room to turn: what a controller drives where its own motion would swing the outline into something."""

import math

import pytest

from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.maps.room_to_turn import AHEAD, CREEPING, RoomToTurn, curves_ahead, wider_curves

HERE = Pose.planar(0, 0)
LEFT = Twist.planar(vx=0.4, wz=0.8)
MOTIONS = wider_curves(LEFT)


def blocks(*motions):
    """A world that blocks what ``motions`` say of a motion."""
    return lambda motion: "a wall" if any(test(motion) for test in motions) else ""


def turns(motion):
    return motion.wz != 0.0


def test_a_free_motion_is_driven_as_it_was_wanted():
    assert RoomToTurn().choose(HERE, 0.0, MOTIONS, 0.5, blocks()) == (LEFT, "")


def test_half_a_turn_is_tried_before_going_straight():
    motion, reason = RoomToTurn().choose(HERE, 0.0, MOTIONS, 0.5, blocks(lambda motion: motion.wz > 0.5))
    assert (motion, reason) == (Twist.planar(vx=0.4, wz=0.4), "")


def test_a_robot_that_cannot_turn_goes_straight_on_at_its_speed():
    assert RoomToTurn().choose(HERE, 0.0, MOTIONS, 0.5, blocks(turns)) == (Twist.planar(vx=0.4), "")


def test_where_all_is_blocked_the_reason_is_that_of_the_wanted_motion():
    result = RoomToTurn().choose(HERE, 0.0, MOTIONS, 0.5, lambda motion: f"wall at {motion.wz}")
    assert result == (None, "wall at 0.8")


def test_a_straight_motion_that_is_blocked_has_no_other():
    assert wider_curves(Twist.planar(vx=0.4)) == [Twist.planar(vx=0.4)]


def test_without_a_distance_no_room_is_made():
    assert RoomToTurn().choose(HERE, 0.0, MOTIONS, 0.0, blocks(turns)) == (None, "a wall")


@pytest.mark.parametrize(
    ("bearing", "backward", "last"),
    [(1.0, False, Twist.planar(CREEPING)), (-1.0, True, Twist.planar(-CREEPING)), (2.0, False, None)],
    ids=["ahead", "ahead of a robot that drives backward", "behind"],
)
def test_room_for_a_turn_on_the_spot_is_made_towards_what_lies_ahead_only(bearing, backward, last):
    turn = Twist.planar(wz=0.8)
    first, *others = curves_ahead(turn, bearing, backward)
    assert first == turn
    assert [motion.wz for motion in others] == sorted((motion.wz for motion in others), reverse=True)
    assert (others[-1] if others else None) == last


def test_it_ends_after_the_distance_whatever_becomes_free_in_between():
    room, x, driven = RoomToTurn(), 0.0, 0
    for cycle in range(100):
        motion, reason = room.choose(Pose.planar(x, 0), 0.0, MOTIONS, 0.5, blocks(turns) if cycle % 3 else blocks())
        if motion is None:
            assert "made no room to turn" in reason
            break
        driven += motion != LEFT
        x += 0.04 * (motion != LEFT)
    assert driven == math.ceil(0.5 / 0.04)


def test_progress_on_the_path_gives_back_the_distance():
    room = RoomToTurn()
    for step in range(40):
        motion, _ = room.choose(Pose.planar(0.04 * step, 0), 0.04 * step, MOTIONS, 0.1, blocks(turns))
        assert motion == Twist.planar(vx=0.4)
    assert AHEAD < 0.1
