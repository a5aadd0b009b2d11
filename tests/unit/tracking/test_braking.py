"""What a robot may do until it stands, against a naive twin in small steps, and that none of it ends in a contact."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.maps.tracking.braking import Decelerations, motions_to_standstill
from mbf_abstract.maps.tracking.contact import safe_share
from mbf_abstract.maps.tracking.contact_parameters import ContactParameters
from mbf_abstract.maps.tracking.objects import Motion, TrackedObject
from mbf_abstract.maps.tracking.robot_box import RobotBox

LIMITS = Decelerations(driving=0.5, turning=1.0, reaction_time=0.3)
CARRIER = RobotBox(-0.35, 0.35, -0.25, 0.25, 0.0)
DT = 0.002

speeds = st.floats(-0.8, 0.8)
twists = st.builds(Twist.planar, speeds, st.sampled_from([0.0, 0.0, 0.3, -0.4]), st.floats(-1.5, 1.5))
commands = twists.filter(lambda twist: twist.speed > 0.01 and abs(twist.wz) > 0.01)
shares = st.sampled_from([1.0, 0.5, 0.25])


def towards(now, wanted, most):
    """The velocity (x, y) after a step in which it changes by ``most`` at most."""
    dx, dy = wanted[0] - now[0], wanted[1] - now[1]
    part = min(1.0, most / max(math.hypot(dx, dy), 1e-12))
    return now[0] + part * dx, now[1] + part * dy


def grown(now, wanted):
    """The wanted velocity where that is faster and not backward."""
    faster = math.hypot(*wanted) > math.hypot(*now) and now[0] * wanted[0] + now[1] * wanted[1] >= 0.0
    return wanted if faster else now


def small_steps(velocity, command, share, at_once, limits=LIMITS):
    """Times and poses of a robot with a mass; it takes up what is faster ``at_once``, or at its limits."""
    wanted = (share * command.vx, share * command.vy), (share * command.wz, 0.0)
    driving, turning = (velocity.vx, velocity.vy), (velocity.wz, 0.0)
    if at_once:
        driving, turning = grown(driving, wanted[0]), grown(turning, wanted[1])
    x = y = yaw = time = 0.0
    found = []
    while time < limits.reaction_time or math.hypot(*driving) + abs(turning[0]) > 1e-9:
        x += (driving[0] * math.cos(yaw) - driving[1] * math.sin(yaw)) * DT
        y += (driving[0] * math.sin(yaw) + driving[1] * math.cos(yaw)) * DT
        yaw, time = yaw + turning[0] * DT, time + DT
        targets = wanted if time < limits.reaction_time else ((0.0, 0.0), (0.0, 0.0))
        driving = towards(driving, targets[0], limits.driving * DT)
        turning = towards(turning, targets[1], limits.turning * DT)
        found.append((time, x, y, yaw))
    return found


@given(twists, commands, shares)
@settings(max_examples=60, deadline=None)
def test_motions_are_those_of_the_naive_twin(velocity, command, share):
    _, *changing = motions_to_standstill(Pose.planar(0.0, 0.0), velocity, command, share, LIMITS)
    for at_once, (times, poses) in zip((False, True), changing, strict=False):
        twin = small_steps(velocity, command, share, at_once)
        assert times[-1] == pytest.approx(twin[-1][0], abs=0.02)
        for time, pose in zip(times, poses, strict=True):
            expected = twin[min(round(time / DT), len(twin)) - 1][1:]
            assert pose == pytest.approx(expected, abs=0.02), f"{time:.2f} s"


@given(commands)
@settings(max_examples=30, deadline=None)
def test_a_robot_that_does_as_commanded_already_takes_up_nothing_at_once(command):
    assert len(list(motions_to_standstill(Pose.planar(0.0, 0.0), command, command, 1.0, LIMITS))) == 2
    assert len(list(motions_to_standstill(Pose.planar(0.0, 0.0), Twist(), command, 1.0, LIMITS))) == 3


@pytest.mark.parametrize("command", [Twist.planar(0.6), Twist.planar(-0.6, wz=0.3), Twist.planar(wz=-0.9)])
@pytest.mark.parametrize("share", [1.0, 0.5, 0.25])
def test_on_the_arc_it_brakes_from_the_share_that_it_drives_of_the_command(command, share):
    """It is never taken to be faster than the command, nor to go back."""
    brakes = LIMITS.driving / command.speed if command.speed else LIMITS.turning / abs(command.wz)  # shares a second
    for now in (-0.5, 0.0, 0.4, 1.0, 1.5):
        measured = Twist.planar(now * command.vx, wz=now * command.wz)
        times, poses = next(motions_to_standstill(Pose.planar(0.0, 0.0), measured, command, share, LIMITS))
        pace = max(share, min(max(now, 0.0), 1.0) - 0.3 * brakes)
        reacting = 0.3 * max(share, 0.5 * (min(max(now, 0.0), 1.0) + pace))
        assert times[-1] == pytest.approx(0.3 + pace / brakes)
        assert poses[-1][2] == pytest.approx(command.wz * (reacting + 0.5 * pace * pace / brakes))


def test_a_robot_that_stands_and_follows_at_once_is_looked_at_where_it_is():
    at_once = LIMITS._replace(reaction_time=0.0)
    for _, poses in motions_to_standstill(Pose.planar(1.0, 2.0, 0.3), Twist(), Twist.planar(0.5), 0.0, at_once):
        assert poses.tolist() == [[1.0, 2.0, pytest.approx(0.3)]]


places = st.floats(-2.0, 2.0)


@given(twists, commands, places, places, speeds, speeds, st.booleans())
@settings(max_examples=150, deadline=None)
def test_a_robot_with_a_mass_stands_before_any_contact(velocity, command, x, y, vx, vy, at_once):
    """Whatever it did before: the safe share is one with which it stands from its measured velocity."""
    limits = ContactParameters(
        turning_time=0.0,
        reaction_time=LIMITS.reaction_time,
        decel_lim_x=LIMITS.driving,
        decel_lim_theta=LIMITS.turning,
    )
    known = TrackedObject(1, Motion.MOVING, x, y, 0.0, vx, vy, 0.25, 5.0, 0.0, 0.0, 0.0, "map")
    share, _ = safe_share(CARRIER, Pose.planar(0.0, 0.0), velocity, command, [known], limits)
    if share == 0.0:
        return
    for time, px, py, yaw in small_steps(velocity, command, share, at_once)[::10]:
        ahead, aside = x + vx * time - px, y + vy * time - py
        c, s = math.cos(yaw), math.sin(yaw)
        beyond = max(abs(c * ahead + s * aside) - 0.35, 0.0), max(abs(c * aside - s * ahead) - 0.25, 0.0)
        assert math.hypot(*beyond) > 0.25, f"share {share}: touched after {time:.2f} s"
