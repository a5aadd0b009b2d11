"""Giving way on each map: into bays, around corners, aside in halls, and nowhere if there is no place for it."""

import math
from dataclasses import replace

import numpy as np
import pytest

from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.maps.pull_out import find_pull_out, way_in_plane
from mbf_abstract.maps.queries import CellState, PlaceQuery
from mbf_abstract.maps.recoveries.give_way import GiveWayParameters, GiveWayRecovery
from mbf_abstract.outcomes import RecoveryOutcome
from mbf_abstract.plugins import RecoveryRequest
from mbf_abstract.testing.contract.recovery import RigMotion
from mbf_abstract.testing.contract.rig import rig
from mbf_abstract.time.cancel import CancelToken
from mbf_abstract.traffic.announcement import Announcement
from mbf_abstract.traffic.right_of_way import in_each_others_way, right_of_way
from mbf_abstract.traffic.traffic import SharedChannel, Traffic
from mbf_costmap_nav.grid.costmap import Costmap
from mbf_costmap_nav.map.costmap_config import CostmapParameters, build_layered_costmap

RADIUS = 0.2  # m, of the robot
START = Pose.planar(4.5, 3.0)


def corridor(x, y):
    """Wall but for a corridor of 0.8 m along y = 3."""
    return ~((np.abs(y - 3.0) < 0.4) & (x > 0.3) & (x < 7.7))


def bay(x0, x1, above):
    """The corridor with a bay between x0 and x1, above or below it."""

    def lethal(x, y):
        beside = (y >= 3.0) & (y < 4.6) if above else (y <= 3.0) & (y > 1.4)
        return corridor(x, y) & ~((x > x0) & (x < x1) & beside)

    return lethal


def corner(x, y):
    """The corridor ends at x = 3 and goes on along x = 3, upwards."""
    return (corridor(x, y) | (x < 2.6)) & ~((np.abs(x - 3.0) < 0.4) & (y > 2.6) & (y < 5.8))


def hall(x, y):
    return np.zeros_like(x, dtype=bool)


class Watched(RigMotion):
    """Notes how near the robot's centre comes to a wall [m]; ``on_the_way(pose)`` is called before each command."""

    least_gap = math.inf
    on_the_way = staticmethod(lambda pose: None)

    def send(self, command):
        pose = self.pose()
        self.on_the_way(pose)
        self.least_gap = min(self.least_gap, float(np.hypot(*(self.walls - (pose.x, pose.y)).T).min(initial=math.inf)))
        return super().send(command)


@pytest.fixture
def give_way(world):
    """``give_way(lethal, start, track, **parameters)`` -> result, motion with its end and seconds."""

    def run(lethal, start=START, track=(), traffic=None, navigation_map=None, on_the_way=None, **parameters):
        navigation_map = navigation_map or world.map_of(lethal)

        def make_context(base):
            return world.context(**vars(base), navigation_map=navigation_map)

        with rig(GiveWayRecovery, make_context, GiveWayParameters(**parameters), start) as made:
            made.plugin.robot._track = tuple((x, y, 0.0) for x, y in track)
            if traffic is not None:
                traffic._channel.clock = made.clock
            made.plugin.traffic = traffic or Traffic()
            token = CancelToken()
            motion = Watched(made, token, lambda pose: pose)
            motion.on_the_way = on_the_way or motion.on_the_way
            x, y = np.meshgrid(np.arange(81) * 0.1, np.arange(61) * 0.1)  # the vertices of the mesh
            motion.walls = np.column_stack([x[lethal(x, y)], y[lethal(x, y)]])
            result = made.plugin.run_behavior(RecoveryRequest(motion, token))
            motion.end, motion.seconds = made.robot.pose, made.clock.now()
            return result, motion

    return run


def backward(motion):
    return any(command.vx < 0.0 for command in motion.commands)


@pytest.mark.parametrize("above", [True, False])
@pytest.mark.parametrize(("x0", "x1"), [(2.4, 3.4), (5.4, 6.4)], ids=["behind", "ahead"])
def test_in_a_corridor_the_nearest_bay_is_taken(give_way, x0, x1, above):
    result, motion = give_way(bay(x0, x1, above))
    assert result.outcome == RecoveryOutcome.SUCCESS, result.message
    assert x0 < motion.end.x < x1
    assert (motion.end.y - 3.0 if above else 3.0 - motion.end.y) > 0.7
    assert motion.least_gap > RADIUS - 0.05
    assert backward(motion) == (x0 < 4.0)
    assert motion.commands[-1] == Twist()


def test_a_long_corridor_without_a_bay_is_left_as_it_is(give_way):
    result, motion = give_way(corridor, reach=1.5)
    assert result.outcome == RecoveryOutcome.IMPASSABLE
    assert "no place 0.8 m beside its way within a manoeuvre of 1.5 m" in result.message
    assert all(command.is_stopped() for command in motion.commands)


def test_the_way_it_came_is_way_too_and_not_a_place_to_stand(give_way):
    """Around the corner, on its own track, it would stand where the other one goes next."""
    track = [(3.0, 5.0 - 0.1 * k) for k in range(20)] + [(3.0 + 0.1 * k, 3.0) for k in range(10)]
    start = Pose.planar(4.0, 3.0)
    assert give_way(corner, start, reach=3.0)[0].outcome == RecoveryOutcome.SUCCESS
    assert give_way(corner, start, track, reach=3.0)[0].outcome == RecoveryOutcome.IMPASSABLE


def test_in_a_hall_it_steps_aside(give_way):
    result, motion = give_way(hall, distance=0.6)
    assert result.outcome == RecoveryOutcome.SUCCESS
    assert 0.5 < abs(motion.end.y - 3.0) < 1.1 and abs(motion.end.x - 4.5) < 1.5


def test_where_the_way_to_the_place_is_not_free_any_more_another_place_is_searched(give_way, world):
    """On the side to which it steps aside a wall is seen that was not there when it set out."""
    seen, sides = world.sensing(), []

    def wall_appears(pose):
        if not sides and abs(pose.y - 3.0) > 0.1:
            sides.append(math.copysign(1.0, pose.y - 3.0))
            world.see(seen, *((x, 3.0 + 0.55 * sides[0]) for x in np.arange(2.0, 7.0, 0.05)))

    result, motion = give_way(hall, distance=0.6, navigation_map=seen, on_the_way=wall_appears)
    assert result.outcome == RecoveryOutcome.SUCCESS, result.message
    assert sides[0] * (motion.end.y - 3.0) < -0.5


def test_where_there_is_room_a_manoeuvre_keeps_off_the_walls(world):
    """So that small errors of the drive do not end it; in a corridor that leaves no room it goes all the same."""
    start = Pose.planar(4.5, 3.0)
    way = way_in_plane(start, np.zeros((0, 3)), [], 4.0)
    for half_width, keeps in ((0.4, 0.05), (0.25, 0.0)):

        def lethal(x, y, half_width=half_width):
            in_bay = (x > 2.0) & (x < 3.4) & (y >= 3.0) & (y < 4.6)
            return ((np.abs(y - 3.0) >= half_width) & ~in_bay) | (x > 7.7)

        navigation_map = world.map_of(lethal)
        steps = find_pull_out(navigation_map, start, way, 0.8, 4.0)
        check = navigation_map.pose_check(PlaceQuery(use_padded_footprint=True, safety_dist=keeps))
        poses = [Pose.planar(4.5 + x, 3.0 + y, yaw) for step in steps for x, y, yaw in step.poses]
        assert all(check(pose).state <= CellState.INSCRIBED for pose in poses)
        assert poses[-1].y > 3.8


def test_a_rectangular_robot_beside_a_wall_is_not_turned_where_it_does_not_fit():
    """The outline is 0.6 m long, the corridor 0.48 m wide: the walls are nearer than the room that is asked for first.

    A robot on a mesh is a disc, which fits with any heading.
    """
    x, y = np.meshgrid((np.arange(400) + 0.5) * 0.02, (np.arange(300) + 0.5) * 0.02)
    in_bay = (x > 2.8) & (x < 4.4) & (y > 2.5) & (y < 4.8)
    cells = np.where((np.abs(y - 3.0) >= 0.24) & ~in_bay, 254, 0).astype(np.uint8)
    outline = [(0.3, 0.2), (0.3, -0.2), (-0.3, -0.2), (-0.3, 0.2)]
    layers = ({"name": "walls", "type": "static"},)
    parameters = CostmapParameters(resolution=0.02, footprint=outline, max_age=0.0, layers=layers)
    costmap = build_layered_costmap(parameters, {}, static_map=Costmap(cells, 0.02))
    costmap.update(START, 0.0)
    steps = find_pull_out(costmap, START, way_in_plane(START, np.zeros((0, 3)), [], 4.0), 0.8, 5.0)
    check = costmap.pose_check(PlaceQuery(use_padded_footprint=True))
    poses = [Pose.planar(4.5 + x, 3.0 + y, yaw) for step in steps for x, y, yaw in step.poses]
    assert all(check(pose).state <= CellState.INSCRIBED for pose in poses)
    assert poses[-1].y > 3.8


def test_distances_on_a_slope_are_those_along_the_ground():
    pitch = 0.4
    on_slope = Pose((1.0, 2.0, 5.0), (0.0, math.sin(0.5 * pitch), 0.0, math.cos(0.5 * pitch)))
    ahead = on_slope.position + 3.0 * on_slope.rotation[:, 0]
    beyond = on_slope.position + np.array([3.0, 0.0, 0.0])  # more than a metre above the ground there
    way = way_in_plane(on_slope, np.zeros((0, 3)), [np.array([ahead, beyond])], 1.0)
    assert way[-1] == pytest.approx([3.0, 0.0])


def test_it_waits_between_its_bounds_and_the_same_for_the_same_seed(give_way):
    times = [give_way(hall, wait=1.0, random_extra=2.0)[1].seconds for _ in range(2)]
    at_once = give_way(hall, wait=0.0, random_extra=0.0)[1].seconds
    assert times[0] == times[1]
    assert 1.0 < times[0] - at_once < 3.1


def test_a_robot_that_touches_what_stands_before_it_is_let_out(give_way):
    """Its front is 0.05 m inside a wall that was not there when it came."""
    closed = bay(2.4, 3.4, True)
    result, motion = give_way(lambda x, y: closed(x, y) | (x > 4.65))
    assert result.outcome == RecoveryOutcome.SUCCESS, result.message
    assert motion.end.y > 3.7


def test_it_follows_the_surface_where_the_way_is_not_along_x(give_way):
    def lethal(x, y):
        along, across = (
            (x - 4.0) * math.cos(0.6) + (y - 3.0) * math.sin(0.6),
            (y - 3.0) * math.cos(0.6) - (x - 4.0) * math.sin(0.6),
        )
        return (np.abs(across) > 0.4) & ~((np.abs(along + 1.2) < 0.5) & (across > 0.0) & (across < 1.7))

    result, motion = give_way(lethal, Pose.planar(4.0, 3.0, 0.6))
    assert result.outcome == RecoveryOutcome.SUCCESS, result.message
    assert motion.least_gap > RADIUS - 0.05


# ---------- among robots that announce their ways
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
        return replace(super().anew(one), way=one.way + back)


def test_the_robot_that_goes_first_waits_as_long_as_the_other_one_makes_room_and_does_not_move(give_way):
    traffic = head_on(9.0, BackingUp(until=12.0))  # heard of until 15 s
    result, motion = give_way(bay(2.4, 3.4, True), traffic=traffic, longest_wait=6.0)
    assert result.outcome == RecoveryOutcome.SUCCESS
    assert "has the right of way over ben; waited 15." in result.message
    assert all(command.is_stopped() for command in motion.commands)


def test_the_robot_that_goes_first_pulls_out_itself_when_the_other_one_stands_and_stands(give_way):
    traffic = head_on(remaining=9.0)
    result, motion = give_way(bay(2.4, 3.4, True), traffic=traffic, longest_wait=4.0)
    assert result.outcome == RecoveryOutcome.SUCCESS
    assert "has pulled out" in result.message and "for ben; waited 4" in result.message
    assert 2.4 < motion.end.x < 3.4 and motion.end.y > 3.7
    assert not right_of_way(traffic.own, traffic.others(motion.seconds)[0])


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
    assert not in_each_others_way(place, announced("ben", 5.3, 0.5, 1.0), distance, 5.0)


def into_the_bay(height):
    """Traffic of ``head_on``; the first one turns into the bay behind, or at a height [m] above the bay."""
    traffic = head_on(remaining=1.0)
    along = announced("ben", 5.3, 0.5, 1.0).way
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
    """Within its reach of 1 m the ways of both do not come near."""
    traffic = head_on(remaining=1.0)
    traffic._channel.publish(announced("ben", 7.6, 0.5, 1.0))
    result, _ = give_way(corridor, traffic=traffic, reach=1.0, longest_wait=1.0)
    assert "asks for the right of way over ben" in result.message
    assert traffic.own.cannot_yield


class Swaying(Radio):
    """The other robot drives to and fro, 0.3 m in 2 s."""

    def anew(self, one):
        off = (0.3 * (self.clock.now() // 2.0 % 2.0), 0.0, 0.0)
        return replace(super().anew(one), way=one.way + off)


def test_it_does_not_wait_for_ever_for_one_that_moves_and_makes_no_room(give_way):
    traffic = head_on(9.0, Swaying(until=300.0))
    result, motion = give_way(bay(2.4, 3.4, True), traffic=traffic, longest_wait=4.0)
    assert result.outcome == RecoveryOutcome.SUCCESS, result.message
    assert "has pulled out" in result.message and "waited 12.0 s" in result.message
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
    """Ben stands beside the way from 2 s on."""

    def anew(self, one):
        off = (0.0, 2.0, 0.0) if one.name == "ben" and self.clock.now() > 2.0 else (0.0, 0.0, 0.0)
        return replace(super().anew(one), way=one.way[:1] + off)


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


def test_a_drive_that_somebody_stops_goes_on_once_they_are_gone(give_way, world):
    """They close all ways out of the bay's mouth, and are gone when the robot stands."""
    seen, stops = world.sensing(), []

    def somebody_passes(pose):
        if not stops and abs(pose.y - 3.0) > 0.1:
            around = np.linspace(0.0, 2.0 * math.pi, 60)
            world.see(seen, *((pose.x + 0.45 * math.cos(a), pose.y + 0.45 * math.sin(a)) for a in around))
            stops.append(pose)
        elif stops:
            seen.clear()
            seen.update(pose, 0.0)

    result, motion = give_way(hall, distance=0.6, navigation_map=seen, on_the_way=somebody_passes)
    assert stops
    assert result.outcome == RecoveryOutcome.SUCCESS, result.message
    assert abs(motion.end.y - 3.0) > 0.5
