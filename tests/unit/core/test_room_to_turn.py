"""Making room to turn: what a controller drives where its own motion would swing the outline into something."""

import math

import pytest

from mbf_abstract.execution.path_tracker import PathTracker
from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.geometry.arcs import arc_poses
from mbf_abstract.maps.controllers.room_to_turn import (
    AHEAD,
    CREEPING,
    RoomToTurn,
    along_path,
    angle_to_path,
    curves_ahead,
    poses_ahead,
    wider_curves,
)

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
    [
        (1.0, False, Twist.planar(CREEPING)),
        (-1.0, True, Twist.planar(-CREEPING)),
        (1.6, False, Twist.planar(CREEPING)),
        (2.4, False, None),
    ],
    ids=["ahead", "ahead of a robot that drives backward", "abeam", "behind"],
)
def test_room_for_a_turn_on_the_spot_is_made_to_all_but_what_lies_behind(bearing, backward, last):
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
            assert "there is still no room to turn" in reason
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


def test_motions_along_the_path_are_tried_before_those_that_leave_it():
    along = Twist.planar(CREEPING, wz=0.01)
    assert RoomToTurn().choose(HERE, 0.0, MOTIONS, 0.5, blocks(lambda motion: motion.wz > 0.5), lambda: [along]) == (
        along,
        "",
    )
    assert RoomToTurn().choose(HERE, 0.0, MOTIONS, 0.0, blocks(turns), lambda: [along]) == (None, "a wall")


def quarter_circle(backward):
    """A path of radius 0.5 m to the left of where it is driven to, with poses that look along or against it."""
    angles = [0.02 * step for step in range(79)]
    points = [(0.5 * math.sin(a), 0.5 - 0.5 * math.cos(a), a) for a in angles]
    yaws = [a + (math.pi if backward else 0.0) for a in angles]
    poses = [Pose.planar(x, y, yaw) for (x, y, _), yaw in zip(points, yaws, strict=True)]
    return PathTracker(Path.from_poses(poses), dimensions=2)


@pytest.mark.parametrize("backward", [False, True])
def test_a_robot_that_keeps_close_to_its_path_stays_on_it(backward):
    tracker = quarter_circle(backward)
    state = [0.0, 0.0, math.pi if backward else 0.0]
    for _ in range(140):
        tracker.update(state[:2])
        nearest = along_path(tracker, Pose.planar(*state), backward)[-1]
        assert math.copysign(1.0, nearest.vx) == (-1.0 if backward else 1.0)
        state = arc_poses(tuple(state), nearest.vx, 0.0, nearest.wz, 0.05, 0.05)[-1].tolist()
        assert abs(math.hypot(state[0], state[1] - 0.5) - 0.5) < 0.01


@pytest.mark.parametrize("backward", [False, True])
def test_the_poses_ahead_are_those_of_a_robot_on_the_path(backward):
    tracker = quarter_circle(backward)
    tracker.update((0.0, 0.0))
    poses = poses_ahead(tracker, 0.4, backward)
    assert len(poses) == 9 and poses[-1, :2] == pytest.approx(tracker.point_at(0.4))
    assert poses[6, 2] == pytest.approx(0.6 + (math.pi if backward else 0.0), abs=0.02)
    tracker.update(tracker.point_at(tracker.length))
    assert len(poses_ahead(tracker, 0.4, backward)) == 1


def test_a_robot_that_still_rolls_steers_to_points_beyond_where_it_creeps():
    tracker = PathTracker(Path.from_points([(0.0, 0.1, 0.0), (3.0, 0.1, 0.0)]), dimensions=2)
    tracker.update((0.0, 0.0))
    for near, far in zip(along_path(tracker, HERE), along_path(tracker, HERE, rolls_on=0.4), strict=True):
        assert 0.0 < far.wz < 0.5 * near.wz


def test_a_robot_that_looks_elsewhere_does_not_creep_along_its_path():
    assert along_path(quarter_circle(False), Pose.planar(0.0, 0.0, 2.0)) == []


@pytest.mark.parametrize("backward", [False, True])
def test_the_angle_to_the_path_is_that_to_a_point_close_ahead_not_round_the_corner(backward):
    points = [(0.05 * k, 0.0) for k in range(3)] + [(0.1, 0.05 * k) for k in range(1, 20)]
    along = [0.0, 0.0, 0.5 * math.pi, *[0.5 * math.pi] * 19]
    poses = [Pose.planar(x, y, yaw + math.pi * backward) for (x, y), yaw in zip(points, along, strict=True)]
    tracker = PathTracker(Path.from_poses(poses), dimensions=2)
    tracker.update((0.0, 0.0))
    here = Pose.planar(0.0, 0.0, 0.4 + math.pi * backward)
    assert angle_to_path(tracker, here, backward) == pytest.approx(-0.4)


def test_who_has_turned_once_round_without_getting_ahead_finds_no_room():
    room = RoomToTurn()
    for turn in range(12):
        motion, reason = room.choose(
            Pose.planar(0.0, 0.0, 0.6 * turn), 0.0, [LEFT, Twist.planar(wz=0.6)], 0.5, blocks(lambda one: one.vx != 0.0)
        )
        assert (motion is None) == (turn == 11), reason
    assert reason == "a wall; after turning by 6.6 rad in all nothing is free"
    assert room.choose(HERE, 2.0 * AHEAD, [LEFT, Twist.planar(wz=0.6)], 0.5, blocks(lambda one: one.vx != 0.0))[0]
