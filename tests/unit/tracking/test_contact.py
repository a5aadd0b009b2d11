"""Stopping in time before what moves: against a naive twin, and the rule that a robot that stands is never at fault."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mbf_abstract.geometry import AckermannCommand, Pose, Twist
from mbf_abstract.maps.tracking.contact import SHARES, in_the_way, safe_share
from mbf_abstract.maps.tracking.contact_guard import ContactGuard
from mbf_abstract.maps.tracking.contact_parameters import ContactParameters
from mbf_abstract.maps.tracking.objects import Motion, TrackedObject
from mbf_abstract.maps.tracking.robot_box import RobotBox
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.plugins import ControlResult

LIMITS = ContactParameters(contact_margin=0.1, reaction_time=0.2, turning_time=0.0, decel_lim_x=0.5)
TURNING = LIMITS.model_copy(update={"turning_time": 0.5})
DISC = RobotBox.disc(0.3)
CARRIER = RobotBox(-0.35, 0.35, -0.25, 0.25, 0.0)
HERE = Pose.planar(0.0, 0.0)
AHEAD = Twist.planar(0.6)


def moving(x, y, vx=0.0, vy=0.0, radius=0.25, motion=Motion.MOVING, z=0.0):
    return TrackedObject(1, motion, x, y, z, vx, vy, radius, 5.0, 0.0, 0.0, 0.0, "map")


def share_of(command, *objects, box=DISC, velocity=None, limits=LIMITS, pose=HERE):
    return safe_share(box, pose, command if velocity is None else velocity, command, objects, limits)[0]


def test_on_a_free_way_the_whole_command_is_safe():
    assert share_of(AHEAD) == 1.0
    assert share_of(AHEAD, moving(5.0, 0.0, -0.5)) == 1.0
    assert share_of(AHEAD, moving(0.0, 3.0, 0.0, 0.5)) == 1.0


def test_the_robot_stops_before_who_comes_towards_it():
    found = [share_of(AHEAD, moving(x, 0.0, -0.8)) for x in (1.2, 1.7, 2.2, 3.5)]
    assert found[0] == 0.0 and found[-1] == 1.0
    assert found == sorted(found)


def test_it_slows_down_behind_who_is_slower():
    assert share_of(AHEAD, moving(0.75, 0.0, 0.3)) < 1.0
    assert share_of(AHEAD, moving(0.75, 0.0, 0.8)) == 1.0


def test_who_crosses_in_front_is_let_by():
    assert share_of(AHEAD, moving(0.9, -0.6, 0.0, 0.8)) == 0.0
    assert share_of(AHEAD, moving(0.9, 0.8, 0.0, 0.8)) == 1.0, "it has passed"


def test_the_robot_stands_while_somebody_passes_within_the_margin():
    beside = moving(0.6, 0.0, 0.0, 0.02)
    assert share_of(Twist.planar(-0.3), beside) == 0.0 == share_of(Twist.planar(0.3), beside)


def test_a_robot_that_is_caught_up_anyway_stands():
    assert share_of(Twist.planar(-0.3), moving(0.75, 0.0, -0.8)) == 0.0
    assert share_of(Twist.planar(-0.6), moving(0.75, 0.0, -0.3)) == 1.0, "it gets away"


def behind(gap, speed, aside=0.0):
    """Somebody behind the disc, so far [m] away, who comes at a speed [m/s]."""
    return moving(-0.55 - gap, aside, speed)


@pytest.mark.parametrize(
    ("gap", "speed", "share"), [(0.25, 0.6, 1.0), (0.25, 0.9, 0.0), (0.11, 0.9, 0.0), (0.05, 0.6, 0.0)]
)
def test_the_robot_brakes_for_nobody_who_follows_it_no_faster_than_it_goes(gap, speed, share):
    """The last one is nearer than the margin."""
    assert share_of(AHEAD, behind(gap, speed), limits=TURNING) == share


def test_who_follows_too_near_to_notice_a_stop_is_let_by():
    """In half a second this one comes 0.33 m, the robot gets away by 0.3 m."""
    assert share_of(AHEAD, behind(0.03, 0.65), limits=TURNING.model_copy(update={"contact_margin": 0.0})) == 0.0


def test_a_robot_that_sets_off_does_not_leave_anybody_behind_yet():
    assert share_of(AHEAD, behind(0.3, 0.6), velocity=Twist(), limits=TURNING) == 0.0
    assert share_of(AHEAD, behind(0.3, 0.05), velocity=Twist(), limits=TURNING) == 1.0


def test_who_follows_does_not_hide_who_comes():
    assert share_of(AHEAD, behind(0.25, 0.6), moving(1.2, 0.0, -0.8), limits=TURNING) == 0.0


def test_a_robot_that_turns_off_or_backs_up_leaves_nobody_behind():
    assert share_of(Twist.planar(-0.6), behind(0.25, 0.6), limits=TURNING) == 0.0
    assert share_of(AHEAD, behind(0.25, 0.6), pose=Pose.planar(0.0, 0.0, 1.5), limits=TURNING) == 0.0


def waiting(x, y, pace=0.15, motion=Motion.WAITING, z=0.0):
    """Somebody who stands and may set off."""
    return replace(moving(x, y, motion=motion, z=z), pace=pace)


def test_what_stands_for_good_is_the_business_of_the_obstacle_layers():
    assert share_of(AHEAD, waiting(0.8, 0.0, motion=Motion.PARKED)) == 1.0
    assert share_of(AHEAD, waiting(0.8, 0.0, pace=0.0)) == 1.0, "as a tracker would that notices all motion"
    assert share_of(AHEAD, waiting(0.8, 0.0, z=3.0)) == 1.0, "on another storey"


def test_who_waits_is_passed_as_slowly_as_it_takes_to_stand_before_them():
    found = [share_of(AHEAD, waiting(0.4, y)) for y in (0.56, 0.8, 0.84, 1.0)]
    assert found == [0.5, 0.5, 0.75, 1.0], "never below the passing speed of 0.3 m/s"
    assert share_of(AHEAD, waiting(0.4, 0.8), limits=LIMITS.model_copy(update={"passing_speed": 0.6})) == 1.0


def test_a_slower_command_is_followed_beside_who_waits():
    for command in (Twist.planar(0.3), Twist.planar(0.1, 0.0, 0.5), Twist.planar(wz=1.0)):
        assert share_of(command, waiting(0.4, 0.56), box=CARRIER) == 1.0


def test_a_robot_that_gets_away_from_who_waits_does_so_at_its_speed():
    assert share_of(Twist.planar(-0.6), waiting(0.7, 0.0)) == 1.0
    assert share_of(AHEAD, waiting(0.7, 0.0)) == 0.5


def test_beside_who_waits_a_long_robot_is_slow_as_long_as_it_is_beside_them():
    """Its side comes no nearer while it passes; they may."""
    assert [share_of(AHEAD, waiting(x, 0.7), box=CARRIER) for x in (0.35, 0.0, -0.2, -0.7)] == [0.5, 0.5, 0.5, 1.0]


def test_who_moves_stops_the_robot_beside_who_waits():
    assert share_of(AHEAD, waiting(0.4, 0.56), moving(1.2, 0.0, -0.8)) == 0.0
    share, touched = safe_share(DISC, HERE, AHEAD, AHEAD, [moving(1.3, 0.0, -0.2), waiting(0.4, 0.56)], LIMITS)
    assert share == 0.5 and touched.motion is Motion.MOVING


def test_who_waits_is_named():
    _, touched = safe_share(DISC, HERE, AHEAD, AHEAD, [waiting(0.4, 0.56)], LIMITS)
    assert in_the_way(touched) == "object 1 waits beside the way, at (0.40, 0.56)"


def test_who_is_on_another_storey_does_not_count():
    assert share_of(AHEAD, moving(0.8, 0.0, z=3.0)) == 1.0


def test_a_standing_robot_and_a_command_of_zero_are_never_at_fault():
    assert share_of(Twist(), moving(0.5, 0.0, -1.0)) == 1.0


def test_corners_count_in_a_turn_on_the_spot():
    turn = Twist.planar(wz=1.0)
    beside = moving(0.0, 0.68, 0.01, 0.0)
    assert share_of(turn, beside, box=RobotBox.disc(0.25)) == 1.0
    assert share_of(turn, beside, box=CARRIER) < 1.0


def test_what_would_be_touched_first_is_named():
    near, far = replace(moving(1.0, 0.0, -0.5), number=7), replace(moving(1.3, 0.0, -0.5), number=8)
    assert safe_share(DISC, HERE, AHEAD, AHEAD, [far, near], LIMITS)[1] is near


speeds = st.floats(-1.0, 1.0)


@given(st.floats(0.05, 1.0), st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), speeds, speeds, st.floats(-1.0, 1.0))
@settings(max_examples=150, deadline=None)
def test_with_the_share_that_is_safe_the_robot_stands_before_any_contact(v, x, y, vx, vy, wz):
    """The naive twin integrates robot and object in small steps, with the rule of braking that the docs state."""
    command, known = Twist.planar(v, 0.0, wz), moving(x, y, vx, vy)
    share = share_of(command, known, box=CARRIER)
    if share == 0.0:
        return
    px = py = yaw = time = 0.0
    pace, dt = 1.0, 0.01
    react = 0.0
    worst = math.inf
    while pace > 0.0:
        px, py = px + pace * v * dt * math.cos(yaw), py + pace * v * dt * math.sin(yaw)
        yaw, time = yaw + pace * wz * dt, time + dt
        slowed = LIMITS.decel_lim_x / v * dt
        react += dt
        pace = max(share, pace - slowed) if react <= LIMITS.reaction_time else pace - slowed
        place = np.array([[[x + vx * time, y + vy * time]]])
        radii = np.array([0.25])
        gap = CARRIER.gaps(np.array([[px, py, yaw]]), place, radii)[0, 0]
        worst = min(worst, gap)
    assert worst > 0.0, f"share {share}: it comes to {worst:.3f} m although {LIMITS.contact_margin} m are kept"


@given(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), st.floats(-3.2, 3.2), st.floats(-2.0, 2.0), st.floats(-2.0, 2.0))
@settings(max_examples=60, deadline=None)
def test_gaps_are_distances_from_a_box(x, y, yaw, px, py):
    found = CARRIER.gaps(np.array([[x, y, yaw]]), np.array([[[px, py]]]), np.array([0.2]))[0, 0]
    edge = [(a, b) for a in np.linspace(-0.35, 0.35, 141) for b in (-0.25, 0.25)]
    edge += [(a, b) for a in (-0.35, 0.35) for b in np.linspace(-0.25, 0.25, 101)]
    c, s = math.cos(yaw), math.sin(yaw)
    nearest = min(math.hypot(x + c * a - s * b - px, y + s * a + c * b - py) for a, b in edge)
    ahead, aside = c * (px - x) + s * (py - y), c * (py - y) - s * (px - x)
    inside = abs(ahead) <= 0.35 and abs(aside) <= 0.25
    assert found == pytest.approx(-0.2 if inside else nearest - 0.2, abs=0.005)


def test_beside_somebody_who_could_turn_to_it_the_robot_is_slower_or_stands():
    passing = [moving(0.0, y, -0.8) for y in (0.7, 0.9, 1.2, 2.0)]
    assert [share_of(AHEAD, one) for one in passing] == [1.0] * 4
    found = [share_of(AHEAD, one, limits=TURNING) for one in passing]
    assert found[0] == 0.0 and found[-1] == 1.0
    assert found == sorted(found)


def test_who_turns_round_may_be_wherever_the_pace_of_before_leads():
    turning = moving(1.3, 0.0, -0.05)
    assert share_of(AHEAD, turning, limits=TURNING) == 1.0
    assert share_of(AHEAD, replace(turning, pace=1.2), limits=TURNING) < 1.0
    assert share_of(AHEAD, replace(turning, pace=1.2)) == 1.0, "nobody turns"


def test_a_robot_does_not_drive_up_close_to_whom_it_follows():
    assert share_of(AHEAD, moving(0.75, 0.0, 0.8), limits=TURNING) == 0.0
    assert share_of(AHEAD, moving(1.6, 0.0, 0.8), limits=TURNING) == 1.0


@given(st.floats(0.05, 1.0), st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), speeds, speeds, st.floats(-3.2, 3.2))
@settings(max_examples=100, deadline=None)
def test_with_the_share_that_is_safe_nobody_who_turns_is_touched_before_that_is_noticed(v, x, y, vx, vy, towards):
    """The naive twin lets the object turn now, and stop as soon as the robot has noticed."""
    share = share_of(Twist.planar(v), moving(x, y, vx, vy), limits=TURNING)
    if share == 0.0:
        return
    speed, driven, pace, dt = math.hypot(vx, vy), 0.0, 1.0, 0.01
    for step in range(1, 1000):
        slowed = LIMITS.decel_lim_x / v * dt
        pace = max(share if step * dt <= LIMITS.reaction_time else 0.0, pace - slowed)
        driven += pace * v * dt
        walked = speed * min(step * dt, TURNING.turning_time)
        there = x + walked * math.cos(towards), y + walked * math.sin(towards)
        assert math.hypot(there[0] - driven, there[1]) > 0.3 + 0.25
        if pace == 0.0:
            return


def braked(share, v, wz):
    """Times [s] and poses (1, 3) of a robot that follows a share of a command and brakes, by a naive twin."""
    px = py = yaw = time = 0.0
    kept, dt = 1.0, 0.01
    while kept > 0.0:
        px, py = px + kept * v * dt * math.cos(yaw), py + kept * v * dt * math.sin(yaw)
        yaw, time = yaw + kept * wz * dt, time + dt
        kept = max(share if time <= LIMITS.reaction_time else 0.0, kept - LIMITS.decel_lim_x / v * dt)
        yield time, np.array([[px, py, yaw]])


@given(st.floats(0.31, 1.0), st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), st.floats(0.01, 0.3), st.floats(-1.0, 1.0))
@settings(max_examples=150, deadline=None)
def test_above_the_passing_speed_nobody_who_sets_off_is_touched(v, x, y, pace, wz):
    """The naive twin lets them come straight at the robot, which brakes in small steps."""
    share = share_of(Twist.planar(v, 0.0, wz), waiting(x, y, pace), box=CARRIER)
    assert share * v >= 0.3 - 1e-9
    if share * v <= 0.3 + 1e-9:
        return
    for time, pose in braked(share, v, wz):
        gap = float(CARRIER.gaps(pose, np.array([[[x, y]]]), np.array([0.25]))[0, 0])
        assert gap > pace * time, f"share {share}: they reach it after {time:.2f} s"


@given(st.floats(0.31, 1.0), st.floats(-1.5, 1.5), st.floats(-1.5, 1.5), st.floats(0.1, 0.6), st.floats(-1.0, 1.0))
@settings(max_examples=150, deadline=None)
def test_above_the_passing_speed_nobody_who_turns_on_the_spot_first_is_touched(v, x, y, half_length, wz):
    """They are known by half of their length; their corners sweep a circle larger by no more than the margin."""
    known, circle = replace(waiting(x, y), radius=half_length), np.array([half_length + LIMITS.contact_margin])
    share = share_of(Twist.planar(v, 0.0, wz), known, box=CARRIER)
    if share * v <= 0.3 + 1e-9:
        return
    for time, pose in braked(share, v, wz):
        gap = float(CARRIER.gaps(pose, np.array([[[x, y]]]), circle)[0, 0])
        assert gap > 0.0, f"share {share}: a corner reaches it after {time:.2f} s"


def test_the_same_question_has_the_same_answer():
    crowd = [moving(0.3 * k, 1.0 - 0.1 * k, -0.4, 0.05 * k) for k in range(6)]
    assert len({safe_share(CARRIER, HERE, AHEAD, AHEAD, crowd, LIMITS) for _ in range(3)}) == 1
    assert share_of(AHEAD, *crowd, box=CARRIER) in (*SHARES, 0.0)


class Answering:
    """A map that answers always alike."""

    def __init__(self, share, reason="object 1 moves in the way", max_wait=2.0):
        self.answer, self.max_wait = (share, reason, max_wait), max_wait

    def safe_share(self, pose, velocity, command, now):
        return self.answer


def judged(guard, share, command, now=0.0, hindered_by="", **answer):
    return guard.judge(Answering(share, **answer), HERE, Twist(), ControlResult(0, "", command, hindered_by), now)


def test_the_guard_slows_down_along_the_same_arc():
    guard = ContactGuard()
    assert judged(guard, 1.0, Twist.planar(0.6, 0.0, 0.4), reason="") == ControlResult(
        0, "", Twist.planar(0.6, 0.0, 0.4)
    )
    slow = judged(guard, 0.5, Twist.planar(0.6, 0.0, 0.4))
    assert slow.command == Twist.planar(0.3, 0.0, 0.2) and slow.success and "moves in the way" in slow.message
    assert judged(guard, 0.25, AckermannCommand(0.8, 0.3)).command == AckermannCommand(0.2, 0.3)


def test_the_guard_waits_and_then_calls_the_path_blocked():
    guard = ContactGuard()
    for step in range(40):
        answer = judged(guard, 0.0, AHEAD, now=0.05 * step)
        assert answer.success and answer.command == Twist()
    late = judged(guard, 0.0, AHEAD, now=2.1)
    assert late.outcome == ExePathOutcome.BLOCKED_PATH and "waited 2.1 s for it" in late.message
    again = judged(guard, 0.0, AHEAD, now=10.0)
    assert again.success, "a new wait"


@pytest.mark.parametrize("command", [Twist(), Twist.planar(0.02, 0.0, 0.5), AckermannCommand(-0.02, 0.3)])
def test_a_controller_that_waits_by_itself_is_named_and_bounded_too(command):
    guard = ContactGuard()
    for step in range(40):
        answer = judged(guard, 1.0, command, now=0.05 * step, hindered_by="object 7 moves in the way")
        assert answer.success and answer.command == command and answer.message == "object 7 moves in the way"
    late = judged(guard, 1.0, command, now=2.1, hindered_by="object 7 moves in the way")
    assert late.outcome == ExePathOutcome.BLOCKED_PATH
    assert late.message == "object 7 moves in the way; waited 2.1 s for it"


def test_who_drives_on_or_stands_for_another_reason_does_not_wait():
    guard = ContactGuard()
    for step in range(100):
        drives = judged(guard, 1.0, AHEAD, now=0.05 * step, hindered_by="object 7 moves in the way")
        assert drives.command == AHEAD and drives.message == ""
        assert judged(guard, 1.0, Twist(), now=0.05 * step).message == ""


def test_waits_of_guard_and_controller_are_one_wait():
    guard = ContactGuard()
    for step in range(40):
        judged(guard, 0.0 if step % 2 else 1.0, Twist.planar(0.03), 0.05 * step, hindered_by="object 7")
    assert judged(guard, 1.0, Twist(), 2.1, hindered_by="object 7").outcome == ExePathOutcome.BLOCKED_PATH


def test_a_wait_goes_on_over_short_moments_of_driving():
    guard = ContactGuard()
    for step in range(60):
        judged(guard, 0.0 if step % 3 else 1.0, AHEAD, now=0.05 * step)
    assert judged(guard, 0.0, AHEAD, now=3.0).outcome == ExePathOutcome.BLOCKED_PATH
