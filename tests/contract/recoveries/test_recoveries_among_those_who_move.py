"""Recoveries wait for who moves in their way, on each map, and drive no faster than is safe among them."""

import pytest

from mbf_abstract.geometry import Twist
from mbf_abstract.outcomes import RecoveryOutcome
from mbf_abstract.testing.contract.recovery import RigMotion
from tests.contract.recoveries.recovery_situations import MOVING, before_the_wall, nothing


@pytest.mark.parametrize("name", [*MOVING, "escape"])
def test_none_moves_where_it_could_not_stop_before_somebody(world, run, name):
    """Also not one that may drive over what stands, as ``escape`` does; it waits as long as the map allows."""
    navigation_map = world.map_of(lambda x, y: x > (2.6 if name == "escape" else 4.5))
    navigation_map.safe_share = lambda *asked: (0.0, "object 3 moves in the way", 0.5)
    result, motion = run(name, navigation_map)
    assert result.outcome == RecoveryOutcome.IMPASSABLE
    assert "object 3 moves in the way; waited 0.5 s for it" in result.message
    assert all(command.is_stopped() for command in motion.commands)
    assert name == "give_way" or motion.seconds == pytest.approx(0.5, abs=0.1), "that one plans anew"


def walks_by(until):
    """``safe_share`` of a map on which somebody is in the way until a time [s], and again for 0.4 s a second later."""

    def safe_share(pose, velocity, command, now):
        in_the_way = now < until or until + 1.0 < now < until + 1.4
        return (0.0, "object 3 moves in the way", 2.0) if in_the_way else (1.0, "", 0.0)

    return safe_share


@pytest.mark.parametrize("name", MOVING)
def test_who_walks_by_is_waited_for_each_time_anew(world, run, name):
    navigation_map = world.map_of(before_the_wall)
    navigation_map.safe_share = walks_by(1.8)
    result, motion = run(name, navigation_map)
    assert result.outcome == RecoveryOutcome.SUCCESS, result.message
    assert motion.seconds > 1.8 and motion.commands[0].is_stopped()


@pytest.mark.parametrize("name", MOVING)
def test_it_waits_no_longer_than_its_time(world, run, name):
    navigation_map = world.map_of(before_the_wall)
    navigation_map.safe_share = lambda *asked: (0.0, "object 3 moves in the way", 10.0)
    result, motion = run(name, navigation_map, time_limit=1)
    assert result.outcome == RecoveryOutcome.PAT_EXCEEDED
    assert "not done after 1 s: object 3 moves in the way" in result.message
    assert all(command.is_stopped() for command in motion.commands)


@pytest.mark.parametrize("name", MOVING)
def test_a_cancel_ends_its_waiting_at_once(world, run, name):
    navigation_map = world.map_of(before_the_wall)
    navigation_map.safe_share = walks_by(100.0)
    result, motion = run(name, navigation_map, cancel=0.3)
    assert result.outcome == RecoveryOutcome.CANCELED and "enough of this" in result.message
    assert motion.seconds <= 0.4


class RollingMotion(RigMotion):
    """The robot has not come to rest yet when the recovery begins."""

    def velocity(self):
        return Twist.planar(0.5)


def test_what_is_safe_is_asked_with_the_velocity_that_was_measured(world, run):
    navigation_map, asked = world.map_of(nothing), []
    navigation_map.safe_share = lambda pose, velocity, command, now: asked.append((velocity, command)) or (1.0, "", 0.0)
    result, _ = run("back_up", navigation_map, RollingMotion)
    assert result.success, result.message
    assert {velocity for velocity, _ in asked} == {Twist.planar(0.5)}
    assert all(command.vx < 0.0 for _, command in asked)


class UnmeasuredMotion(RigMotion):
    """A robot without odometry."""

    def velocity(self):
        return Twist()


def test_a_robot_without_odometry_counts_as_moving_as_it_was_told(world, run):
    navigation_map, asked = world.map_of(nothing), []
    navigation_map.safe_share = lambda pose, velocity, command, now: asked.append((velocity, command)) or (1.0, "", 0.0)
    run("back_up", navigation_map, UnmeasuredMotion)
    velocities, commands = zip(*asked, strict=True)
    assert velocities == (Twist(), *commands[:-1])


def test_one_drives_no_faster_than_is_safe_among_those_who_move(world, run):
    commands = []
    for share in (1.0, 0.25):
        navigation_map = world.map_of(nothing)
        navigation_map.safe_share = lambda *asked, share=share: (share, "object 3 moves in the way", 10.0)
        result, motion = run("back_up", navigation_map)
        assert result.success, result.message
        commands.append(min(command.vx for command in motion.commands))
    assert commands[1] == 0.25 * commands[0] < 0.0
