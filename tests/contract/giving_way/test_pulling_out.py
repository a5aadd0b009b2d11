"""Giving way on each map: into bays, around corners, aside in halls, and nowhere if there is no place for it."""

import math

import numpy as np
import pytest

from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.maps.pull_out import find_pull_out, paths_to_keep_free
from mbf_abstract.maps.queries import PADDED, CellState, PlaceQuery
from mbf_abstract.maps.tracking.objects import Motion, TrackedObject
from mbf_abstract.outcomes import RecoveryOutcome
from mbf_costmap_nav.grid.costmap import Costmap
from mbf_costmap_nav.map.costmap_config import CostmapParameters, build_layered_costmap
from tests.contract.giving_way.conftest import RADIUS, START, bay, corner, corridor, hall


def backward(motion):
    return any(command.vx < 0.0 for command in motion.commands)


def somebody_passes(world, seen, stops, when_beside):
    """At each command: so far [m] beside its path it is surrounded once, then alone; where, is in ``stops``."""

    def look(pose):
        if not stops and abs(pose.y - 3.0) > when_beside:
            around = np.linspace(0.0, 2.0 * math.pi, 60)
            world.see(seen, *((pose.x + 0.45 * math.cos(a), pose.y + 0.45 * math.sin(a)) for a in around))
            stops.append(pose)
        elif stops:
            seen.clear()
            seen.update(pose, 0.0)

    return look


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
    assert "no place 0.8 m beside its path within a manoeuvre of 1.5 m" in result.message
    assert all(command.is_stopped() for command in motion.commands)


def test_the_path_it_came_along_is_no_place_to_stand(give_way):
    """Around the corner, on its own track, it would stand where the other one goes next."""
    track = [(3.0, 5.0 - 0.1 * k) for k in range(20)] + [(3.0 + 0.1 * k, 3.0) for k in range(10)]
    start = Pose.planar(4.0, 3.0)
    assert give_way(corner, start, reach=3.0)[0].outcome == RecoveryOutcome.SUCCESS
    assert give_way(corner, start, track, reach=3.0)[0].outcome == RecoveryOutcome.IMPASSABLE


def test_in_a_hall_it_steps_aside(give_way):
    result, motion = give_way(hall, distance=0.6)
    assert result.outcome == RecoveryOutcome.SUCCESS
    assert 0.5 < abs(motion.end.y - 3.0) < 1.1 and abs(motion.end.x - 4.5) < 1.5


def tracked(x, y, vx=0.0, motion=Motion.WAITING):
    return TrackedObject(1, motion, x, y, 0.0, vx, 0.0, 0.3, 5.0, 0.0, 3.0, 0.0, "map")


@pytest.mark.parametrize("aside", [-0.3, 0.3])
def test_it_steps_aside_from_the_way_of_who_is_tracked_ahead_too(give_way, world, aside):
    seen = world.sensing()
    seen.tracked_objects = lambda now: (tracked(5.6, 3.0 + aside),)
    result, motion = give_way(hall, distance=0.6, navigation_map=seen)
    assert result.outcome == RecoveryOutcome.SUCCESS, result.message
    assert abs(motion.end.y - 3.0 - aside) > 0.55 and abs(motion.end.y - 3.0) > 0.55


def test_it_waits_no_longer_than_until_who_was_on_its_way_has_passed(give_way, world):
    seen, asked = world.sensing(), []

    def passing(now):
        asked.append(now)
        return (tracked(5.2 - 0.3 * (now - asked[0]), 3.0, -0.3, Motion.MOVING),)

    seen.tracked_objects = passing
    result, motion = give_way(hall, distance=0.6, navigation_map=seen, wait=30.0, random_extra=0.0)
    assert result.success and motion.seconds < 15.0


def test_it_waits_for_nobody_who_has_passed_before_it_stands(give_way, world):
    """They come at 0.9 m/s; without anybody it waits its time, as whom it gives way to may be out of its sight."""
    seen, seconds = world.sensing(), []
    for anybody in (True, False):
        asked = []

        def passing(now, asked=asked, anybody=anybody):
            asked.append(now)
            return (tracked(5.2 - 0.9 * (now - asked[0]), 3.0, -0.9, Motion.MOVING),) if anybody else ()

        seen.tracked_objects = passing
        result, motion = give_way(hall, distance=0.6, navigation_map=seen, wait=30.0, random_extra=0.0)
        assert result.success and ("waited 0 s" in result.message) == anybody, result.message
        seconds.append(motion.seconds)
    assert seconds[0] < 15.0 < 30.0 < seconds[1]


def test_where_the_drive_to_the_place_is_not_free_any_more_another_place_is_searched(give_way, world):
    """On the side to which it steps aside a wall is seen that was not there when it set out."""
    seen, sides = world.sensing(), []

    def wall_appears(pose):
        if not sides and abs(pose.y - 3.0) > 0.1:
            sides.append(math.copysign(1.0, pose.y - 3.0))
            world.see(seen, *((x, 3.0 + 0.55 * sides[0]) for x in np.arange(2.0, 7.0, 0.05)))

    result, motion = give_way(hall, distance=0.6, navigation_map=seen, on_command=wall_appears)
    assert result.outcome == RecoveryOutcome.SUCCESS, result.message
    assert sides[0] * (motion.end.y - 3.0) < -0.5


def test_where_there_is_room_a_manoeuvre_keeps_off_the_walls(world):
    """So that small errors of the drive do not end it; in a corridor that leaves no room it goes all the same."""
    start = Pose.planar(4.5, 3.0)
    keep_free = paths_to_keep_free(start, np.zeros((0, 3)), [], 4.0)
    for half_width, keeps in ((0.4, 0.05), (0.25, 0.0)):

        def lethal(x, y, half_width=half_width):
            in_bay = (x > 2.0) & (x < 3.4) & (y >= 3.0) & (y < 4.6)
            return ((np.abs(y - 3.0) >= half_width) & ~in_bay) | (x > 7.7)

        navigation_map = world.map_of(lethal)
        steps = find_pull_out(navigation_map, start, keep_free, 0.8, 4.0)
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
    steps = find_pull_out(costmap, START, paths_to_keep_free(START, np.zeros((0, 3)), [], 4.0), 0.8, 5.0)
    check = costmap.pose_check(PlaceQuery(use_padded_footprint=True))
    poses = [Pose.planar(4.5 + x, 3.0 + y, yaw) for step in steps for x, y, yaw in step.poses]
    assert all(check(pose).state <= CellState.INSCRIBED for pose in poses)
    assert poses[-1].y > 3.8


def test_distances_on_a_slope_are_those_along_the_ground():
    pitch = 0.4
    on_slope = Pose((1.0, 2.0, 5.0), (0.0, math.sin(0.5 * pitch), 0.0, math.cos(0.5 * pitch)))
    ahead = on_slope.position + 3.0 * on_slope.rotation[:, 0]
    beyond = on_slope.position + np.array([3.0, 0.0, 0.0])  # more than a metre above the ground there
    keep_free = paths_to_keep_free(on_slope, np.zeros((0, 3)), [np.array([ahead, beyond])], 1.0)
    assert keep_free[-1] == pytest.approx([3.0, 0.0])


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
    assert motion.end.y > 3.6


def test_it_follows_a_path_that_is_not_along_x(give_way):
    def lethal(x, y):
        along, across = (
            (x - 4.0) * math.cos(0.6) + (y - 3.0) * math.sin(0.6),
            (y - 3.0) * math.cos(0.6) - (x - 4.0) * math.sin(0.6),
        )
        return (np.abs(across) > 0.4) & ~((np.abs(along + 1.2) < 0.5) & (across > 0.0) & (across < 1.7))

    result, motion = give_way(lethal, Pose.planar(4.0, 3.0, 0.6))
    assert result.outcome == RecoveryOutcome.SUCCESS, result.message
    assert motion.least_gap > RADIUS - 0.05


def test_what_it_drives_to_pull_out_is_no_path_that_it_keeps_free(give_way, world):
    """Somebody stops it when it is nearly there: then it stands far enough beside its path, and need not go on."""
    seen, stops = world.sensing(), []
    passes = somebody_passes(world, seen, stops, when_beside=0.65)
    result, motion = give_way(hall, distance=0.6, navigation_map=seen, on_command=passes)
    assert result.outcome == RecoveryOutcome.SUCCESS, result.message
    assert motion.end.distance_to(stops[0]) < 0.3


def test_the_way_of_who_is_tracked_ahead_stays_free_when_it_searches_anew(give_way, world):
    """It has turned by then, and the way of the other one still leads along its path, not where it looks now."""
    known, stops = world.map_of(bay(2.4, 5.4, True)), []
    known.tracked_objects = lambda now: (tracked(5.6, 3.3),)
    as_ever = known.obstacle_on_path

    def obstacle_on_path(pose, command, duration):
        if stops or abs(pose.yaw) < 0.8:
            return as_ever(pose, command, duration)
        stops.append(pose)
        return "somebody passes"

    known.obstacle_on_path = obstacle_on_path
    result, motion = give_way(bay(2.4, 5.4, True), distance=0.6, navigation_map=known)
    assert stops and result.outcome == RecoveryOutcome.SUCCESS, result.message
    assert motion.end.y - 3.3 > 0.55


def aisle(half_width):
    """A costmap of a corridor along y = 3, and an aisle off it ahead; the outline is 0.6 m long and 0.4 m wide."""
    x, y = np.meshgrid((np.arange(400) + 0.5) * 0.02, (np.arange(300) + 0.5) * 0.02)
    inside = (np.abs(y - 3.0) < 0.6) | ((np.abs(x - 5.5) < half_width) & (y > 3.0) & (y < 5.0))
    outline = [(0.3, 0.2), (0.3, -0.2), (-0.3, -0.2), (-0.3, 0.2)]
    layers = ({"name": "walls", "type": "static"},)
    parameters = CostmapParameters(resolution=0.02, footprint=outline, max_age=0.0, layers=layers)
    walls = Costmap(np.where(inside, 0, 254).astype(np.uint8), 0.02)
    costmap = build_layered_costmap(parameters, {}, static_map=walls)
    costmap.update(START, 0.0)
    return costmap


@pytest.mark.parametrize(("half_width", "goes_back"), [(0.33, True), (1.2, False)])
def test_from_where_it_cannot_turn_to_its_path_it_goes_back_the_way_it_came(give_way, half_width, goes_back):
    """It drives forward into an aisle in which it does not fit across. A robot on a mesh is a disc, which turns."""
    result, motion = give_way(hall, navigation_map=aisle(half_width))
    assert result.outcome == RecoveryOutcome.SUCCESS, result.message
    assert ("drove back" in result.message) == goes_back
    assert max(pose.y for pose in motion.poses) > 3.7
    assert (motion.end.y < 3.3) == goes_back


def test_a_drive_that_somebody_stops_goes_on_once_they_are_gone(give_way, world):
    """They surround the robot, and are gone when the robot stands."""
    seen, stops = world.sensing(), []
    passes = somebody_passes(world, seen, stops, when_beside=0.1)
    result, motion = give_way(hall, distance=0.6, navigation_map=seen, on_command=passes)
    assert stops
    assert result.outcome == RecoveryOutcome.SUCCESS, result.message
    assert abs(motion.end.y - 3.0) > 0.5


@pytest.mark.parametrize("aside", [0.03, 0.06, 0.09, 0.12])
def test_a_robot_at_the_edge_of_free_ground_finds_a_manoeuvre_that_it_may_drive(give_way, world, aside):
    """Beside the walls the ground of a mesh costs too much to be driven onto before the disc touches anything."""
    navigation_map = world.inflated(bay(2.4, 3.4, True))
    for start in (Pose.planar(4.5 + 0.03 * k, 3.0 - aside, 0.02 * k) for k in range(5)):
        if navigation_map.path_check(PADDED)(start).state <= CellState.INSCRIBED:
            result, motion = give_way(bay(2.4, 3.4, True), start, navigation_map=navigation_map)
            assert result.outcome == RecoveryOutcome.SUCCESS, result.message
            assert motion.end.y > 3.6
