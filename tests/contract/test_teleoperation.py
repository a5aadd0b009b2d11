"""Driving by hand: a deadman's switch, through the velocity gate, and with the map's guards, on both maps."""

import pytest

from mbf_abstract.drive.teleoperation import DECELERATION, OWNER, REACTION_TIME, Teleoperation
from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Twist
from mbf_abstract.testing.conformance.rig import ROBOT_RADIUS, Box
from mbf_abstract.testing.conformance.site import site

PERIOD = 0.1  # s between two reports of a stick that is held
LIMITS = {"max_vel_x": 0.6, "min_vel_x": -0.3, "max_vel_theta": 1.0, "command_timeout": 0.5}
FORWARD, BACK, LEFT = Twist.planar(0.5), Twist.planar(-0.3), Twist.planar(wz=0.8)


@pytest.fixture(params=["costmap", "mesh"])
def driven(request, backends):
    with site(backends[request.param], **LIMITS) as made:
        yield made, Teleoperation(made.server.runtime)


def hold(driven, command, seconds):
    made, stick = driven
    for _ in range(round(seconds / PERIOD)):
        stick.hold(command)
        made.rig.clock.sleep(PERIOD)


def stops(made):
    return [event.data["reason"] for event in made.rig.memory.of_kind(EventKind.ROBOT_STOPPED)]


def test_the_robot_follows_the_stick_and_stands_as_soon_as_it_is_released(driven):
    made, stick = driven
    before = made.rig.robot.pose
    hold(driven, FORWARD, 1.0)
    assert made.rig.robot.pose.distance_to(before) == pytest.approx(0.5, abs=0.1)
    hold(driven, LEFT, 1.0)
    assert made.rig.robot.pose.angle_to(before) == pytest.approx(0.8, abs=0.15)
    stick.release()
    now = made.rig.clock.now()
    made.rig.clock.sleep(1.0)
    assert not stick.is_held and made.rig.robot.command.is_stopped()
    assert not made.rig.robot.moved_after(now + 0.05)
    assert stops(made) == ["the stick was released"]


def test_a_stick_that_nobody_reports_is_not_held(driven):
    made, stick = driven
    hold(driven, FORWARD, 0.5)
    silent_since = made.rig.clock.now()
    made.rig.clock.sleep(1.5)
    assert not stick.is_held and not made.rig.robot.moved_after(silent_since + LIMITS["command_timeout"] + PERIOD)
    hold(driven, FORWARD, 0.5)
    assert stick.is_held and not made.rig.robot.command.is_stopped()


def test_commands_pass_the_gate_and_its_limits(driven):
    made, _ = driven
    hold(driven, Twist.planar(9.0, wz=3.0), 0.5)
    fastest = max(command.vx for _, command in made.rig.robot.commands)
    assert 0.0 < fastest <= LIMITS["max_vel_x"]
    assert made.server.runtime.gate.holder == OWNER


def test_it_stops_before_an_obstacle_and_drives_away_from_it(driven):
    made, stick = driven
    pose = made.rig.robot.pose
    made.rig.boxes = [Box(pose.x + 1.2, pose.y - 1.0, pose.x + 1.7, pose.y + 1.0)]
    made.rig.clock.sleep(0.5)
    hold(driven, FORWARD, 5.0)
    assert made.rig.robot.command.is_stopped() and stick.problem
    assert made.rig.least_gap() > ROBOT_RADIUS
    stopped_at = made.rig.robot.pose
    assert stopped_at.distance_to(pose) > 0.2, "it came nearer before"
    hold(driven, BACK, 1.0)
    assert stick.problem == "" and made.rig.robot.pose.x < stopped_at.x - 0.15


def test_it_slows_down_where_it_must_to_stop_in_time(driven):
    made, _ = driven
    pose, gap = made.rig.robot.pose, 1.2
    made.rig.boxes = [Box(pose.x + gap, pose.y - 1.0, pose.x + 1.7, pose.y + 1.0)]
    made.rig.clock.sleep(0.5)
    hold(driven, FORWARD, PERIOD)
    while made.rig.robot.command.vx > 0.9 * FORWARD.vx:
        gap = pose.x + 1.2 - made.rig.robot.pose.x - ROBOT_RADIUS
        hold(driven, FORWARD, PERIOD)
    needed = FORWARD.vx * REACTION_TIME + FORWARD.vx**2 / (2.0 * DECELERATION)
    assert needed - 0.1 < gap < needed + 0.4, "what a mesh forbids begins up to a face before the obstacle"


def test_a_goal_does_not_drive_while_somebody_does_and_may_afterwards(driven):
    made, stick = driven
    path = made.path((2.0, 4.0), (4.0, 4.0))
    hold(driven, LEFT, 0.3)
    result = made.navigator.exe_path(path)
    assert not result.success and f"the robot is driven by {OWNER}" in result.message
    stick.release()
    made.rig.clock.sleep(0.3)
    assert made.navigator.exe_path(path).success


def test_it_waits_for_a_gate_that_another_drives_through(driven):
    made, stick = driven
    lease = made.server.runtime.gate.acquire("somebody")
    hold(driven, FORWARD, 0.5)
    assert stick.problem == "the robot is driven by somebody" and not made.rig.robot.moved_after(0.0)
    lease.release()
    hold(driven, FORWARD, 0.5)
    assert stick.problem == "" and made.rig.robot.moved_after(0.0)


@pytest.mark.parametrize("lost", ["the scans", "the pose"])
def test_a_stale_map_or_a_lost_pose_holds_the_robot_until_it_is_over(driven, lost):
    made, stick = driven

    def publish(comes):
        if lost == "the scans":
            made.rig.sensing = comes
        else:
            made.rig.robot.publishes_pose = comes

    publish(False)
    made.rig.clock.sleep(1.5)
    hold(driven, FORWARD, 0.5)
    assert stick.problem and made.rig.robot.command.is_stopped()
    publish(True)
    made.rig.clock.sleep(0.5)
    hold(driven, FORWARD, 0.5)
    assert stick.problem == "" and not made.rig.robot.command.is_stopped()


def test_an_error_of_the_map_stops_the_robot_until_the_stick_is_taken_anew(driven):
    made, stick = driven

    def raising(pose, command, duration):
        raise RuntimeError("no obstacles today")

    made.server.obstacle_ahead, whole = raising, made.server.obstacle_ahead
    hold(driven, FORWARD, 0.5)
    assert stick.problem == "RuntimeError: no obstacles today" and not made.rig.robot.moved_after(0.0)
    made.server.obstacle_ahead = whole
    hold(driven, FORWARD, 0.5)
    assert not made.rig.robot.moved_after(0.0)
    stick.release()
    hold(driven, FORWARD, 0.5)
    assert stick.problem == "" and made.rig.robot.moved_after(0.0)
