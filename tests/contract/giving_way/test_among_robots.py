"""Giving way among robots that announce their paths: who waits, who pulls out, and who asks for the right of way."""

import math
from dataclasses import replace

import numpy as np
import pytest

from mbf_abstract.outcomes import RecoveryOutcome
from mbf_abstract.traffic.announcement import Announcement
from mbf_abstract.traffic.right_of_way import paths_conflict, right_of_way
from mbf_abstract.traffic.traffic import SharedChannel, Traffic
from tests.contract.giving_way.conftest import RADIUS, bay, corridor, hall


def announced(name, x_from, x_to, remaining):
    """A robot that goes along the corridor."""
    x = np.linspace(x_from, x_to, 20)
    return Announcement(name, 0.0, np.column_stack([x, np.full(20, 3.0), np.zeros(20)]), remaining, radius=0.3)


class Radio(SharedChannel):
    """Other robots announce the same anew all the time, up to a time [s]; ``give_way`` sets the clock."""

    clock = None

    def __init__(self, until):
        super().__init__()
        self.until = until

    def latest(self):
        return tuple(one if one.name == "anna" else self.anew(one) for one in super().latest())

    def anew(self, one):
        return replace(one, stamp=min(self.clock.now(), self.until))


def head_on(remaining, channel=None):
    """Traffic of the robot at ``START``, which has 3 m to go, with another one head on that has ``remaining``."""
    channel, traffic = channel or Radio(until=100.0), Traffic()
    traffic.connect("anna", channel)
    traffic.announce(announced("", 4.5, 7.5, 3.0))
    channel.publish(announced("ben", 5.3, 0.5, remaining))
    return traffic


class BackingUp(Radio):
    """The other robot drives back at 0.1 m/s."""

    def anew(self, one):
        back = (0.1 * min(self.clock.now(), self.until), 0.0, 0.0)
        return replace(super().anew(one), path=one.path + back)


def test_the_robot_that_goes_first_waits_as_long_as_the_other_one_makes_room_and_does_not_move(give_way):
    traffic = head_on(9.0, BackingUp(until=12.0))  # heard of until 15 s
    result, motion = give_way(bay(2.4, 3.4, True), traffic=traffic, longest_wait=6.0)
    assert result.outcome == RecoveryOutcome.SUCCESS
    assert "has the right of way over ben; waited 15." in result.message
    assert all(command.is_stopped() for command in motion.commands)


def test_a_slow_one_is_waited_for_as_long_as_it_comes_on(give_way):
    traffic = head_on(9.0, BackingUp(until=30.0))  # three times the wait are 18 s
    result, motion = give_way(bay(2.4, 3.4, True), traffic=traffic, longest_wait=6.0)
    assert "has the right of way over ben; waited 33." in result.message
    assert all(command.is_stopped() for command in motion.commands)


def test_the_robot_that_goes_first_pulls_out_itself_when_the_other_one_stands_and_stands(give_way):
    traffic = head_on(remaining=9.0)
    result, motion = give_way(bay(2.4, 3.4, True), traffic=traffic, longest_wait=4.0)
    assert result.outcome == RecoveryOutcome.SUCCESS
    assert "has pulled out" in result.message and "for ben; waited 4" in result.message
    assert 2.4 < motion.end.x < 3.4 and motion.end.y > 3.7
    assert not right_of_way(traffic.own, traffic.others(motion.seconds)[0])


class Standing(Radio):
    """Ben stands without a goal, and drives off by 2 m as soon as he is asked, unless he is ``stubborn``."""

    stubborn, asked = False, False

    def anew(self, one):
        self.asked = self.asked or any(other.asks for other in SharedChannel.latest(self))
        off = (0.0, 2.0 * (self.asked and not self.stubborn), 0.0)
        return replace(super().anew(one), path=one.path[:1] + off, remaining=0.0, makes_room=True)


def test_one_that_stands_in_the_way_without_a_goal_is_asked_for_room_and_waited_for(give_way):
    traffic = head_on(0.0, Standing(until=100.0))
    result, motion = give_way(corridor, traffic=traffic, longest_wait=6.0)
    assert result.outcome == RecoveryOutcome.SUCCESS, result.message
    assert "has the right of way over ben" in result.message
    assert traffic._channel.asked and not traffic.own.asks
    assert motion.seconds < 2.0 and all(command.is_stopped() for command in motion.commands)


def test_one_that_makes_no_room_all_the_same_is_not_pulled_out_for(give_way):
    channel = Standing(until=100.0)
    channel.stubborn = True
    result, motion = give_way(bay(2.4, 3.4, True), traffic=head_on(0.0, channel), longest_wait=6.0)
    assert result.outcome == RecoveryOutcome.IMPASSABLE
    assert motion.seconds == pytest.approx(6.0, abs=0.6) and motion.end.x == 4.5


def stands_idle(*others):
    """Traffic of the robot at ``START``, which has no goal, among others."""
    channel, traffic = Radio(until=100.0), Traffic()
    traffic.connect("anna", channel)
    traffic.announce(Announcement("", 0.0, np.array([(4.5, 3.0, 0.0)]), 0.0, makes_room=True))
    for other in others:
        channel.publish(other)
    return traffic


def test_one_without_a_goal_pulls_out_of_the_path_of_the_one_that_asks_and_does_not_wait(give_way):
    asking = replace(announced("ben", 6.5, 0.5, 9.0), asks=True)
    result, motion = give_way(bay(2.4, 3.4, True), traffic=stands_idle(asking), longest_wait=60.0)
    assert result.outcome == RecoveryOutcome.SUCCESS, result.message
    assert "makes room for ben" in result.message
    assert 2.4 < motion.end.x < 3.4 and motion.end.y > 3.7
    assert motion.seconds < 30.0 and motion.least_gap > RADIUS


def test_it_keeps_clear_of_those_that_do_not_ask_where_it_can_and_only_there(give_way):
    asking, passing = replace(announced("ben", 6.5, 0.5, 9.0), asks=True), announced("carl", 0.5, 6.5, 9.0)
    above = replace(passing, path=np.add(passing.path, (0.0, 1.0, 0.0)))
    _, motion = give_way(hall, traffic=stands_idle(asking, above))
    assert motion.end.y < 3.0 - 0.8
    both = replace(above, path=np.concatenate([above.path, np.subtract(above.path, (0.0, 2.0, 0.0))]))
    result, motion = give_way(hall, traffic=stands_idle(asking, both), reach=1.5)
    assert result.outcome == RecoveryOutcome.SUCCESS, result.message
    assert abs(motion.end.y - 3.0) > 0.8


def test_without_a_place_it_says_so_at_once(give_way):
    asking = replace(announced("ben", 6.5, 0.5, 9.0), asks=True)
    result, motion = give_way(corridor, traffic=stands_idle(asking), reach=1.5)
    assert result.outcome == RecoveryOutcome.IMPASSABLE
    assert "no place 0.8 m beside the paths of others" in result.message
    assert motion.seconds == 0.0


def test_two_that_can_neither_yield_nor_wait_for_each_other_give_up(give_way):
    traffic = head_on(remaining=9.0)
    result, motion = give_way(corridor, traffic=traffic, reach=1.5, longest_wait=4.0)
    assert result.outcome == RecoveryOutcome.IMPASSABLE
    assert traffic.own.cannot_yield
    assert motion.seconds < 10.0


def test_it_waits_no_longer_for_a_robot_that_is_silent(give_way):
    result, motion = give_way(corridor, traffic=head_on(9.0, Radio(until=0.0)), longest_wait=60.0)
    assert result.outcome == RecoveryOutcome.SUCCESS
    assert 3.0 < motion.seconds < 4.0


def test_the_other_one_pulls_out_and_waits_until_the_first_has_passed(give_way):
    traffic = head_on(1.0, Radio(until=20.0))  # heard of until 23 s
    result, motion = give_way(bay(2.4, 3.4, True), traffic=traffic, longest_wait=60.0)
    assert result.outcome == RecoveryOutcome.SUCCESS, result.message
    assert "for ben" in result.message
    assert 2.4 < motion.end.x < 3.4 and motion.end.y > 3.7
    assert 22.5 < motion.seconds < 24.0
    assert not traffic.yields


@pytest.mark.parametrize("distance", [0.4, 0.55, 0.7, 0.85])
def test_a_robot_that_has_pulled_out_is_not_in_the_way_of_the_first_one(give_way, distance):
    result, motion = give_way(hall, traffic=head_on(remaining=1.0), distance=distance, longest_wait=1.0)
    assert result.outcome == RecoveryOutcome.SUCCESS, result.message
    place = Announcement("anna", 0.0, np.array([motion.end.position]), 3.0)
    assert not paths_conflict(place, announced("ben", 5.3, 0.5, 1.0), distance, 5.0)


@pytest.mark.parametrize(("others", "expected"), [(1.6, 1.2), (0.4, 0.6), (0.0, 0.8)])
def test_it_stands_as_far_off_as_it_and_the_first_one_need_and_no_farther(give_way, others, expected):
    """Among robots like itself it keeps 0.8 m; the first one is larger, smaller, or does not say."""
    traffic = head_on(remaining=1.0)
    traffic._channel.publish(replace(announced("ben", 5.3, 0.5, 1.0), distance=others))
    result, motion = give_way(hall, traffic=traffic, longest_wait=1.0)
    assert result.outcome == RecoveryOutcome.SUCCESS, result.message
    assert expected < abs(motion.end.y - 3.0) < expected + 0.2


def into_the_bay(height):
    """Traffic of ``head_on``; the first one turns into the bay behind, or at a height [m] above the bay."""
    traffic = head_on(remaining=1.0)
    along = announced("ben", 5.3, 0.5, 1.0).path
    turning = np.concatenate([along[along[:, 0] > 2.9], [(2.9, y, height) for y in np.linspace(3.0, 4.6, 9)]])
    traffic._channel.publish(Announcement("ben", 0.0, turning, 1.0))
    return traffic


def test_one_that_goes_over_the_bay_on_another_storey_does_not_need_it(give_way):
    result, motion = give_way(bay(2.4, 3.4, True), traffic=into_the_bay(3.0), reach=7.0, longest_wait=1.0)
    assert result.outcome == RecoveryOutcome.SUCCESS, result.message
    assert 2.4 < motion.end.x < 3.4 and motion.end.y > 3.7


def test_it_does_not_pull_out_to_where_the_first_one_goes(give_way):
    traffic = into_the_bay(0.0)
    result, _ = give_way(bay(2.4, 3.4, True), traffic=traffic, reach=2.5, longest_wait=1.0)
    assert result.outcome == RecoveryOutcome.IMPASSABLE
    assert "asks for the right of way over ben" in result.message
    assert traffic.own.cannot_yield


def test_a_robot_that_follows_is_neither_waited_for_nor_pulled_out_for(give_way):
    traffic = head_on(remaining=1.0)
    traffic._channel.publish(announced("ben", 3.9, 7.5, 9.0))
    result, _ = give_way(bay(2.4, 3.4, True), traffic=traffic, wait=1.0, random_extra=0.0)
    assert result.outcome == RecoveryOutcome.SUCCESS, result.message
    assert "ben" not in result.message
    assert not traffic.own.waits


def test_one_that_does_not_get_there_in_time_announces_that_it_cannot_yield(give_way):
    traffic = head_on(remaining=1.0)
    result, _ = give_way(bay(2.4, 3.4, True), traffic=traffic, time_limit=1.0, longest_wait=2.0)
    assert result.outcome == RecoveryOutcome.PAT_EXCEEDED
    assert "asks for the right of way over ben" in result.message
    assert traffic.own.cannot_yield


def test_it_sees_others_as_far_as_the_server_that_runs_it_where_robots_meet(give_way):
    """Within its reach of 1 m the paths of both do not come near."""
    traffic = head_on(remaining=1.0)
    traffic._channel.publish(announced("ben", 7.6, 0.5, 1.0))
    result, _ = give_way(corridor, traffic=traffic, reach=1.0, longest_wait=1.0)
    assert "asks for the right of way over ben" in result.message
    assert traffic.own.cannot_yield


class Swaying(Radio):
    """The other robot drives to and fro, 0.3 m in 2 s."""

    def anew(self, one):
        off = (0.3 * (self.clock.now() // 2.0 % 2.0), 0.0, 0.0)
        return replace(super().anew(one), path=one.path + off)


def test_it_does_not_wait_for_ever_for_one_that_moves_and_makes_no_room(give_way):
    traffic = head_on(9.0, Swaying(until=300.0))
    result, motion = give_way(bay(2.4, 3.4, True), traffic=traffic, longest_wait=4.0)
    assert result.outcome == RecoveryOutcome.SUCCESS, result.message
    assert "has pulled out" in result.message and "waited 12.5 s" in result.message
    assert traffic.own.waits == 1
    assert 2.4 < motion.end.x < 3.4 and motion.end.y > 3.7


class Pleading(Radio):
    """The other robot finds at 2 s that it cannot yield."""

    def anew(self, one):
        return replace(super().anew(one), cannot_yield=self.clock.now() > 2.0)


def test_a_robot_that_waits_pulls_out_as_soon_as_the_other_one_cannot_yield(give_way):
    traffic = head_on(9.0, Pleading(until=20.0))
    result, motion = give_way(bay(2.4, 3.4, True), traffic=traffic, longest_wait=60.0)
    assert result.outcome == RecoveryOutcome.SUCCESS, result.message
    assert "has pulled out" in result.message
    assert 2.4 < motion.end.x < 3.4 and motion.end.y > 3.7


class PullingOut(Radio):
    """Ben stands beside the path from 2 s on."""

    def anew(self, one):
        off = (0.0, 2.0, 0.0) if one.name == "ben" and self.clock.now() > 2.0 else (0.0, 0.0, 0.0)
        return replace(super().anew(one), path=one.path[:1] + off)


@pytest.mark.parametrize(
    ("channel", "parked_at", "is_forgotten"),
    [(PullingOut, 7.0, True), (PullingOut, 5.4, False), (Radio, 7.0, False)],
    ids=["ben leaves", "ben leaves, another one is there", "ben stays"],
)
def test_the_maps_forget_where_robots_met_that_have_left(give_way, world, channel, parked_at, is_forgotten):
    """No ray passes the cells on which one was seen: nothing is sensed anew. What stands beside it is kept."""
    seen = world.sensing()
    world.see(seen, (5.25, 3.0), (5.1, 3.35), height=0.7)
    traffic = head_on(9.0, channel(until=100.0))
    traffic._channel.publish(Announcement("carl", 0.0, np.array([[parked_at, 3.0, 0.0]]), 0.0, radius=0.3))
    result, _ = give_way(hall, traffic=traffic, navigation_map=seen, longest_wait=4.0)
    assert result.outcome == RecoveryOutcome.SUCCESS, result.message
    assert math.isfinite(world.cost_at(seen, 5.25, 3.0)) == is_forgotten
    assert math.isinf(world.cost_at(seen, 5.1, 3.35))
