"""Commands that a robot with inertia can reach, turns that end in time, and slowly into bends."""

import math
from itertools import pairwise

import numpy as np
import pytest

from mbf_abstract.execution.path_tracker import PathTracker
from mbf_abstract.geometry import AckermannCommand, Path, Pose, Twist
from mbf_abstract.maps.controllers.braking import LastFreeArc
from mbf_abstract.maps.controllers.inertia import (
    OFF_ARC,
    InertiaParameters,
    braking_distance,
    reached,
    speed_before_bends,
    speed_on_path,
    stopping_speed,
)
from mbf_abstract.maps.controllers.room_to_turn import CREEPING, along_path
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.plugins import ControlResult

AT_ONCE = InertiaParameters()
SLOW = InertiaParameters(acc_lim_x=0.5, acc_lim_theta=0.5, control_period=0.1)


def planar(command):
    return command.vx, command.vy, command.wz


def test_a_robot_that_follows_at_once_is_commanded_as_it_is_wanted():
    for command in (Twist.planar(0.5, 0.1, 0.3), Twist.planar(-0.5), Twist.planar(wz=2.0)):
        assert AT_ONCE.reachable(command, Twist.planar(3.0, wz=-3.0)) == command
    assert AT_ONCE.turn_rate(1.7, 0.01) == 1.7
    assert AT_ONCE.reaction_time == 0.0


# measured, wanted: commanded
@pytest.mark.parametrize(
    ("measured", "wanted", "expected"),
    [
        ((0.5, 0.0, 0.5), (0.1, 0.0, 0.1), (0.45, 0.0, 0.45)),  # it keeps to the circle while it brakes
        ((0.2, 0.0, 0.1), (0.5, 0.0, 0.25), (0.25, 0.0, 0.125)),
        ((0.5, 0.0, 0.0), (-0.1, 0.0, 0.0), (0.45, 0.0, 0.0)),
        ((0.5, 0.0, 0.0), (0.0, 0.0, 1.0), (0.45, 0.0, 0.0)),  # straight on until it creeps
        ((0.1, 0.0, 0.0), (0.0, 0.0, 1.0), (0.05, 0.0, 0.05)),
        ((0.2, 0.0, 0.0), (0.2, 0.0, 0.4), (0.2, 0.0, 0.05)),
    ],
)
def test_a_command_changes_by_what_the_robot_can_reach(measured, wanted, expected):
    command = SLOW.reachable(Twist.planar(*wanted), Twist.planar(*measured))
    assert planar(command) == pytest.approx(expected)


@pytest.mark.parametrize("reaction_time", [0.0, 0.1, 0.4])
def test_from_the_stopping_speed_a_robot_that_reacts_late_stops_where_it_should(reaction_time):
    speed = stopping_speed(0.7, 0.5, reaction_time)
    assert speed * reaction_time + speed**2 / (2.0 * 0.5) == pytest.approx(0.7)
    assert stopping_speed(-0.1, 0.5, reaction_time) == 0.0
    assert stopping_speed(0.7, math.inf, reaction_time) == math.inf


def test_a_robot_that_creeps_does_not_roll_on():
    assert braking_distance(CREEPING, 0.5) == braking_distance(-0.05, 0.5) == 0.0
    assert braking_distance(0.5, math.inf) == 0.0
    assert braking_distance(-0.6, 0.5) == pytest.approx(0.35)


@pytest.mark.parametrize("acc_lim_theta", [0.3, 1.0, 4.0])
@pytest.mark.parametrize("period", [0.03, 0.2])
def test_a_turn_in_proportion_to_the_angle_does_not_overshoot(acc_lim_theta, period):
    p = InertiaParameters(acc_lim_x=1.0, acc_lim_theta=acc_lim_theta, control_period=period)
    angle, rate, least = 2.5, 0.0, math.inf
    for _ in range(round(30.0 / period)):
        wanted = p.turn_rate(min(2.0 * angle, 1.5), angle)
        rate = p.reachable(Twist.planar(wz=wanted), Twist.planar(wz=rate)).wz
        angle -= rate * period
        least = min(least, angle)
    assert abs(angle) < 0.05
    assert least > -0.05


@pytest.mark.parametrize("acc_lim_theta", [0.3, 1.0, 4.0])
@pytest.mark.parametrize(("curvature", "turning"), [(3.0, 0.0), (0.8, 0.2), (-1.5, 0.3), (-3.0, -0.4)])
def test_a_robot_takes_up_an_arc_no_faster_than_its_heading_follows(acc_lim_theta, curvature, turning):
    p, step = InertiaParameters(acc_lim_x=1.0, acc_lim_theta=acc_lim_theta), 0.001
    speed, behind = p.speed_on_arc(curvature, turning), 0.0
    while abs(speed * curvature - turning) > acc_lim_theta * step:
        behind += (speed * curvature - turning) * step
        turning += math.copysign(acc_lim_theta * step, curvature)
    assert abs(behind) == pytest.approx(OFF_ARC, rel=0.02) or speed == CREEPING
    assert AT_ONCE.speed_on_arc(curvature, 0.0) == p.speed_on_arc(0.0, 0.4) == math.inf


def test_a_robot_that_turns_slowly_turns_to_its_path_before_it_drives():
    still, drives = Twist(), Twist.planar(0.3)
    assert SLOW.turns_first(0.6, still, 1.0) and not SLOW.turns_first(0.6, drives, 1.0)
    assert not SLOW.turns_first(0.2, still, 1.0) and SLOW.turns_first(0.2, still, 0.1)
    assert not AT_ONCE.turns_first(3.0, still, 1.0)
    assert SLOW.turns_after(-0.5, 9.0) == pytest.approx(2.0)


def path_with_a_bend(turn):
    along = np.arange(0.0, 2.01, 0.05)
    after = along[1:, None] * [math.cos(turn), math.sin(turn)] + [2.0, 0.0]
    points = np.concatenate([np.column_stack([along, np.zeros_like(along)]), after])
    return Path.from_points(np.column_stack([points, np.zeros(len(points))]), Pose.planar(0.0, 0.0, turn).orientation)


def test_a_robot_comes_to_a_bend_as_slowly_as_it_can_turn_there():
    fast = InertiaParameters(acc_lim_x=0.5, acc_lim_theta=1.0)
    straight, bent = PathTracker(path_with_a_bend(0.0)), PathTracker(path_with_a_bend(1.5))
    limit = 0.5 / (4.0 * 0.05)
    assert speed_on_path(straight, 1.5, 0.5, fast, 1.0) == pytest.approx(limit)
    speeds = []
    for x in np.arange(0.0, 1.6, 0.1):
        bent.update((x, 0.0, 0.0))
        speeds.append(speed_on_path(bent, 1.5, 0.5, fast, 1.0))
    in_bend = 0.5 / (2.0 * math.sqrt(1.5))
    assert speeds[-1] == pytest.approx(in_bend, rel=0.15)
    assert all(later <= earlier + 1e-9 for earlier, later in pairwise(speeds))
    for earlier, later in pairwise(speeds):
        assert earlier**2 - later**2 <= 2.0 * 0.5 * 0.1 * 1.3  # no harder than it can brake
    assert speed_on_path(bent, 1.5, 0.5, AT_ONCE, 1.0) == math.inf


def test_the_end_of_a_path_is_no_bend():
    points = np.column_stack([np.minimum(np.arange(0.0, 1.0, 0.1), 0.45), np.zeros(10)])
    assert speed_before_bends(points, 0.1, SLOW, 1.0) > 10.0
    assert speed_before_bends(points[:3], 0.1, SLOW, 1.0) == math.inf


@pytest.mark.parametrize("arc", [(0.6, 0.0, 0.4), (0.3, 0.0, -1.5), (-0.4, 0.0, 0.2), (0.3, 0.2, 0.1)])
def test_an_arc_is_braked_by_what_takes_longer_and_kept(arc):
    command, seconds = Twist.planar(*arc), 0.0
    while command != Twist():
        slower = SLOW.braked(command, command)
        assert np.cross(np.array(planar(slower)), np.array(arc)) == pytest.approx(np.zeros(3))
        assert math.hypot(command.vx - slower.vx, command.vy - slower.vy) <= 0.5 * 0.1 + 1e-9
        assert abs(command.wz - slower.wz) <= 0.5 * 0.1 + 1e-9
        command, seconds = slower, seconds + 0.1
    assert seconds == pytest.approx(SLOW.stops_after(Twist.planar(*arc)), abs=0.1 + 1e-9)


def test_a_robot_that_is_slower_than_its_command_brakes_from_what_it_does():
    assert planar(SLOW.braked(Twist.planar(0.6, wz=0.3), Twist.planar(0.3))) == pytest.approx((0.25, 0.0, 0.125))
    for measured in (Twist(), Twist.planar(-0.3), Twist.planar(0.04)):
        assert SLOW.braked(Twist.planar(0.6, wz=0.3), measured) == Twist()


def test_there_is_no_arc_to_brake_along_for_one_that_turns_on_the_spot_or_follows_at_once():
    assert SLOW.braked(Twist.planar(wz=1.0), Twist.planar(wz=1.0)) == Twist()
    assert AT_ONCE.braked(Twist.planar(0.6), Twist.planar(0.6)) == Twist()
    assert AT_ONCE.time_on_arc(Twist.planar(0.6, wz=2.0)) == 0.0


def test_what_comes_of_a_command_is_what_both_directions_can_change_together():
    command = reached(Twist.planar(1.0, 1.0, 2.0), Twist.planar(0.5), (0.3, 0.4, 0.1))
    assert math.hypot((command.vx - 0.5) / 0.3, command.vy / 0.4) == pytest.approx(1.0)
    assert (command.vx - 0.5) / command.vy == pytest.approx(0.5) and command.wz == 0.1
    near = Twist.planar(0.6, 0.1, 0.05)
    assert planar(reached(near, Twist.planar(0.5), (0.3, 0.4, 0.1))) == pytest.approx(planar(near))


def refused(outcome=ExePathOutcome.BLOCKED_PATH):
    return ControlResult(outcome, "a box")


def test_a_refusal_is_braking_along_the_last_arc_until_the_robot_stands():
    last_arc, arc = LastFreeArc(), Twist.planar(0.4, wz=0.2)
    last_arc.keep(arc, 0.0)
    speeds, measured = [], arc
    while (answer := last_arc.answer(refused(), measured, SLOW)).success:
        assert answer.message == "it brakes: a box"
        assert answer.command.wz == pytest.approx(0.5 * answer.command.vx)
        measured = answer.command
        speeds.append(measured.vx)
    assert speeds == pytest.approx([0.35, 0.3, 0.25, 0.2, 0.15, 0.1, 0.05])
    assert answer == refused()


def test_the_arc_is_that_of_the_command_however_the_robot_is_measured_to_turn():
    """It was looked at; what is measured only says how much of it is still driven."""
    last_arc = LastFreeArc()
    last_arc.keep(Twist.planar(0.4, wz=0.2), 0.0)
    answer = last_arc.answer(refused(), Twist.planar(0.36, wz=-0.5), SLOW)
    assert planar(answer.command) == pytest.approx(planar(Twist.planar(0.31, wz=0.155)))


def test_it_ends_even_where_the_robot_is_measured_to_go_on():
    last_arc, cycles = LastFreeArc(), 0
    last_arc.keep(Twist.planar(0.4), 0.0)
    while last_arc.answer(refused(), Twist.planar(0.4), SLOW).success:
        cycles += 1
    assert cycles <= 8


def test_nothing_is_braked_by_what_is_known_no_more_and_cars_have_no_arc():
    last_arc = LastFreeArc()
    last_arc.keep(Twist.planar(0.4), 0.0)
    stale = refused(ExePathOutcome.MAP_ERROR)
    assert last_arc.answer(stale, Twist.planar(0.4), SLOW) == stale
    last_arc.keep(AckermannCommand(0.4, 0.1), 0.0)
    assert last_arc.answer(refused(), Twist.planar(0.4), SLOW) == refused()


@pytest.mark.parametrize("share", [1.0, 0.6])
def test_a_robot_that_does_only_a_share_of_what_it_is_commanded_is_brought_up_to_its_speed(share):
    """Wheels that slip: counted from what is measured, 0.15 m/s would be commanded for ever, or little more."""
    last_arc, wanted, gains = LastFreeArc(), Twist.planar(3.0, wz=0.4), (0.15, 0.15, 0.2)
    measured, commanded = Twist(), [0.0]
    for cycle in range(30):
        now = 0.05 * cycle
        command = reached(wanted, last_arc.begins_at(wanted, measured, now), gains)
        assert command.vx <= commanded[-1] + 0.15 + 1e-9
        last_arc.keep(command, now)
        commanded.append(command.vx)
        measured = Twist.planar(share * command.vx, wz=share * command.wz)
    assert command == wanted


def test_a_command_of_long_ago_is_no_beginning():
    last_arc = LastFreeArc()
    last_arc.keep(Twist.planar(1.0), 10.0)
    assert last_arc.begins_at(Twist.planar(2.0), Twist(), 10.1) == Twist.planar(1.0)
    assert last_arc.begins_at(Twist.planar(2.0), Twist(), 11.0) == Twist()


def test_a_robot_that_is_faster_than_its_last_command_goes_on_from_what_is_measured():
    last_arc = LastFreeArc()
    last_arc.keep(Twist.planar(0.2, wz=0.5), 0.0)
    assert last_arc.begins_at(Twist.planar(1.0, wz=-0.5), Twist.planar(0.6, wz=0.1), 0.05) == Twist.planar(0.6, wz=0.1)


def test_after_braking_a_robot_goes_on_from_what_it_was_slowed_down_to():
    last_arc = LastFreeArc()
    last_arc.keep(Twist.planar(0.4), 0.0)
    braked = last_arc.answer(refused(), Twist.planar(0.3), SLOW).command
    assert 0.0 < braked.vx < 0.3
    assert last_arc.begins_at(Twist.planar(0.5), Twist.planar(0.3), 0.05) == Twist.planar(0.3)
    assert last_arc.begins_at(Twist(), Twist.planar(0.3), 0.05) == braked


@pytest.mark.parametrize("rate", [1e-9, -3e-17, 0.0])
def test_a_robot_that_is_on_its_path_but_for_rounding_is_not_stopped_for_it(rate):
    tracker = PathTracker(Path.from_points([(0.0, 0.0, 0.0), (2.0, 0.0, 0.0)]), dimensions=2)
    assert SLOW.turn_rate(rate, 10.0 * rate) == rate
    for y in (0.0, 1e-17, -1e-12):
        near = along_path(tracker, Pose.planar(0.0, y), turn_rate=SLOW.turn_rate)[0]
        assert near.vx == pytest.approx(CREEPING) and abs(near.wz) < 1e-9
