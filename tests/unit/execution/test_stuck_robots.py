"""Robots that ignore their commands, tip over, or move without getting anywhere; every test ends standing."""

import math

import pytest

from mbf_abstract.drive.robot import Odometry
from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.geometry.transform import Transform
from mbf_abstract.goals.goal_types import ExePathGoal
from mbf_abstract.outcomes import ExePathOutcome as Outcome
from mbf_abstract.plugins import ControlResult
from mbf_abstract.testing.faulty import drive, slow


def end_state(states, session):
    return states(session, "controller_execution")[-1]


def test_a_robot_that_ignores_its_commands_is_stuck(make_session, states):
    session = make_session(cmd_vel_ignored_tolerance=2.0)
    session.robot.stuck = True
    result = session.navigator.exe_path(session.path_to(3.0))
    assert result.outcome == Outcome.ROBOT_STUCK
    assert end_state(states, session) == "robot_disabled"
    assert 2.0 < session.clock.now() < 2.2


@pytest.mark.parametrize("command", [Twist.planar(0.5), Twist.planar(0.0, wz=0.5)], ids=["straight", "turning"])
@pytest.mark.parametrize(("share", "stuck"), [(0.05, True), (0.2, False)])
def test_a_robot_that_hardly_carries_out_its_commands_ignores_them(make_session, command, share, stuck):
    session = make_session(cmd_vel_ignored_tolerance=2.0)
    measured = Twist.planar(share * command.vx, wz=share * command.wz)
    session.robot.odometry = lambda: Odometry(measured, session.clock.now())
    session.controller.play(ControlResult(0, "", command))
    handle = session.navigator.send(ExePathGoal(session.path_to(30.0)))
    session.clock.sleep(4.0)
    assert handle.done is stuck
    handle.cancel()
    assert handle.wait().outcome == (Outcome.ROBOT_STUCK if stuck else Outcome.CANCELED)


def test_while_the_controller_computes_no_command_is_ignored(make_session):
    session = make_session(cmd_vel_ignored_tolerance=2.0)
    real, first_cycles = session.robot.odometry, 3

    def odometry_of_a_robot_that_sets_off_late():
        nonlocal first_cycles
        first_cycles -= not session.robot.command.is_stopped()
        return Odometry(Twist(), session.clock.now()) if first_cycles > 0 else real()

    session.robot.odometry = odometry_of_a_robot_that_sets_off_late
    session.controller.play(slow(session.clock, 3.0, session.controller.follow), session.controller.follow)
    assert session.navigator.exe_path(session.path_to(2.0)).success


@pytest.mark.parametrize("tolerance", [0.0, -1.0])
def test_a_tolerance_of_zero_or_less_lets_the_robot_ignore_commands_for_ever(make_session, tolerance):
    session = make_session(cmd_vel_ignored_tolerance=tolerance)
    session.robot.stuck = True
    handle = session.navigator.send(ExePathGoal(session.path_to(3.0)))
    session.clock.sleep(60.0)
    assert not handle.done
    handle.cancel()
    handle.wait()


def tilted_frame(angle):
    """Where odom lies in map once the ground under the robot is steeper than thought."""
    return Transform((0.0, 0.0, 0.0), (math.sin(0.5 * angle), 0.0, 0.0, math.cos(0.5 * angle)), "map", "odom")


def test_a_robot_that_tilts_too_far_stops_before_it_tips_over(make_session, states):
    session = make_session(max_tilt=0.5)
    handle = session.navigator.send(ExePathGoal(session.path_to(30.0)))
    session.clock.sleep(2.0)
    session.robot.T_map_odom = tilted_frame(0.45)
    session.clock.sleep(2.0)
    assert not handle.done
    session.robot.T_map_odom, tilted_at = tilted_frame(0.6), session.clock.now()
    result = handle.wait()
    assert result.outcome == Outcome.ROBOT_STUCK
    assert "tilts by 34.4 degrees, allowed are 28.6" in result.message
    assert session.clock.now() - tilted_at < 0.2 and session.robot.command.is_stopped()
    assert end_state(states, session) == "robot_disabled"


def test_without_max_tilt_a_robot_may_lean_as_far_as_it_will(make_session):
    session = make_session()
    session.robot.T_map_odom = tilted_frame(0.6)
    handle = session.navigator.send(ExePathGoal(session.path_to(30.0)))
    session.clock.sleep(2.0)
    assert not handle.done
    handle.cancel()
    handle.wait()


def test_a_robot_without_odometry_is_never_called_stuck(make_session):
    session = make_session(cmd_vel_ignored_tolerance=1.0)
    session.robot.odometry = lambda: None
    assert session.navigator.exe_path(session.path_to(2.0)).success


def test_what_is_safe_for_a_robot_without_odometry_is_asked_as_if_it_moved_as_it_was_told(make_session, monkeypatch):
    session, asked = make_session(), []
    session.robot.odometry = lambda: None
    session.controller.play(*[drive(0.1 * cycle) for cycle in range(1, 4)])

    def avoid_contact(pose, velocity, answer):
        asked.append((velocity, answer.command))
        return answer

    monkeypatch.setattr(session.navigator.server.runtime.map_hooks, "avoid_contact", avoid_contact)
    assert session.navigator.exe_path(session.path_to(2.0)).success
    velocities, commands = zip(*asked, strict=True)
    assert velocities == (Twist(), *commands[:-1]) and len({*commands}) == 3


def test_a_robot_that_moves_without_getting_anywhere_oscillates(make_session, states):
    session = make_session(oscillation_timeout=3.0, oscillation_distance=0.5)
    session.controller.play(*[drive(0.3 if i // 10 % 2 else -0.3) for i in range(400)])
    result = session.navigator.exe_path(session.path_to(30.0))
    assert result.outcome == Outcome.OSCILLATION
    assert "has neither moved 0.5 m nor turned 3.14 rad in 3 s" in result.message
    assert end_state(states, session) == "oscillating"


def test_turning_far_enough_is_progress(make_session):
    session = make_session(oscillation_timeout=3.0, oscillation_angle=1.0)
    session.controller.play(drive(0.0, 0.5))
    handle = session.navigator.send(ExePathGoal(session.path_to(30.0)))
    session.clock.sleep(20.0)
    assert not handle.done
    handle.cancel()
    handle.wait()


@pytest.mark.parametrize(("end_heading", "ends"), [(3.0, False), (0.0, True)])
def test_at_the_end_of_its_path_only_a_turn_to_the_goals_heading_is_progress(make_session, end_heading, ends):
    session = make_session(progress_timeout=3.0, dist_tolerance=0.1, angle_tolerance=0.05)
    session.controller.play(drive(0.0, 0.2))
    goal = Pose.planar(0.2, 0.0, end_heading)
    handle = session.navigator.send(ExePathGoal(Path.from_poses([Pose.planar(0.0, 0.0), goal])))
    session.clock.sleep(10.0)
    assert handle.done is ends
    handle.cancel()
    assert handle.wait().outcome == (Outcome.OSCILLATION if ends else Outcome.CANCELED)
