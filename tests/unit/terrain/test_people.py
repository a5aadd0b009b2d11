"""People who yield: they get on, keep to the right, and never walk into a robot that stands."""

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from mbf_abstract.geometry import Pose, Twist
from terrain.physics.actors import COURTESY, RouteWalker
from terrain.physics.kinematic_world import KinematicWorld
from terrain.physics.people import Person, distance_to_meeting
from terrain.physics.robot_models import HUSKY, TURTLEBOT, RobotSpec
from terrain.worlds.occupancy import OccupancyGrid
from terrain.worlds.wall_clearance import Walls

ROUTE = [[0.0, 0.0], [12.0, 0.0]]
FAR = Pose.planar(100.0, 0.0)


@dataclass
class Machine:
    """A robot that drives straight on from somewhere."""

    start: Pose
    speed: float = 0.0
    spec: RobotSpec = TURTLEBOT
    world: KinematicWorld | None = None

    def pose(self) -> Pose:
        along = self.speed * (self.world.time if self.world else 0.0)
        yaw = self.start.yaw
        return Pose.planar(self.start.x + along * math.cos(yaw), self.start.y + along * math.sin(yaw), yaw)

    def velocity(self) -> Twist:
        return Twist.planar(self.speed)


def corridor(width, length=12.0):
    """A corridor along x, its middle at y = 0."""
    occupied = np.zeros((80, round((length + 4.0) / 0.05)), dtype=bool)
    y = (np.arange(80) + 0.5) * 0.05 - 2.0
    occupied[np.abs(y) > 0.5 * width] = True
    return OccupancyGrid(occupied, ~occupied, 0.05, -2.0, -2.0)


def walk(robot, seconds, route=ROUTE, speed=1.0, walls=None, others=()):
    """Poses of a person, step by step."""
    world = KinematicWorld()
    robot.world = world
    person = Person(world, route, speed, walls=walls)
    person.meet((robot,), others)
    poses = []
    while world.time < seconds:
        world.step()
        poses.append(person.pose())
    return poses


def apart(poses, robot_pose, spec=TURTLEBOT):
    """Least distance of the person's outline from a circle around a robot."""
    return min(math.hypot(p.x - robot_pose.x, p.y - robot_pose.y) for p in poses) - 0.25 - spec.circumscribed_radius


def test_who_meets_nobody_walks_straight_on_at_its_speed():
    poses = walk(Machine(FAR), 6.0)

    assert max(abs(pose.y) for pose in poses) < 1e-9
    assert poses[-1].x == pytest.approx(6.0, abs=0.5)  # it had to start walking


def test_it_goes_round_its_route_again_and_again():
    poses = walk(Machine(FAR), 40.0, [[0.0, 0.0], [3.0, 0.0], [3.0, 3.0]])

    for corner in ((0.0, 0.0), (3.0, 0.0), (3.0, 3.0)):
        near = [math.hypot(pose.x - corner[0], pose.y - corner[1]) < 0.4 for pose in poses]
        assert sum(now and not before for before, now in pairwise(near)) >= 2


def test_it_steps_aside_to_the_right_of_a_robot_in_its_way_and_comes_back():
    standing = Pose.planar(5.0, 0.0)
    poses = walk(Machine(standing), 11.0)

    assert min(pose.y for pose in poses) < -0.5 and max(pose.y for pose in poses) < 0.1
    assert apart(poses, standing) >= COURTESY - 0.02
    assert poses[-1].x > 8.5 and abs(poses[-1].y) < 0.2


def test_it_steps_to_the_left_where_a_wall_is_on_the_right():
    grid = corridor(3.0)
    grid.occupied[(np.arange(80) + 0.5) * 0.05 - 2.0 < -0.5] = True
    poses = walk(Machine(Pose.planar(5.0, 0.0)), 11.0, walls=Walls(grid))

    assert max(pose.y for pose in poses) > 0.5 and poses[-1].x > 8.5
    assert min(Walls(grid).clearance(pose.x, pose.y) for pose in poses) > 0.2


def test_it_makes_room_for_a_robot_that_comes_towards_it():
    coming = Machine(Pose.planar(10.0, 0.0, math.pi), speed=0.5)
    poses = walk(coming, 10.0)

    gaps = [
        math.hypot(pose.x - (10.0 - 0.5 * step / 60.0), pose.y) - 0.25 - TURTLEBOT.circumscribed_radius
        for step, pose in enumerate(poses, 1)
    ]
    assert min(gaps) > 0.2 and poses[-1].x > 8.0


def test_where_it_cannot_pass_it_waits():
    standing = Pose.planar(5.0, 0.0)
    poses = walk(Machine(standing, spec=HUSKY), 20.0, walls=Walls(corridor(1.2)))

    assert poses[-1].x == poses[-60].x < 5.0
    assert apart(poses, standing, HUSKY) > 0.2


def test_two_who_meet_pass_each_other_on_the_right():
    world = KinematicWorld()
    one, two = Person(world, ROUTE, 1.0), Person(world, ROUTE, 0.8, start=12.0)
    for person in (one, two):
        person.meet((Machine(FAR),), (one, two))
    beside = []
    while world.time < 9.0:
        world.step()
        beside.append((one.pose(), two.pose()))

    assert min(math.hypot(a.x - b.x, a.y - b.y) for a, b in beside) > 0.5
    passing = min(beside, key=lambda pair: abs(pair[0].x - pair[1].x))
    assert passing[0].y < passing[1].y, "each has the other on its left"


@settings(max_examples=40, deadline=None)
@given(
    st.floats(-1.0, 13.0), st.floats(-1.5, 1.5), st.floats(-3.0, 3.0), st.floats(0.1, 2.0), st.sampled_from([0.0, 1.4])
)
def test_nobody_walks_into_a_robot_that_stands(x, y, yaw, speed, width):
    robot = Machine(Pose.planar(x, y, yaw), spec=HUSKY)
    first = math.hypot(x, y) - 0.25 - HUSKY.circumscribed_radius
    poses = walk(robot, 14.0, speed=speed, walls=Walls(corridor(width)) if width else None)

    assert apart(poses, robot.pose(), HUSKY) >= min(first, COURTESY) - 1e-6


@settings(max_examples=40, deadline=None)
@given(st.floats(-1.0, 13.0), st.floats(-1.0, 1.0), st.floats(0.1, 2.0))
def test_nobody_walks_into_a_wall(x, y, speed):
    walls = Walls(corridor(1.6))
    poses = walk(Machine(Pose.planar(x, y)), 14.0, speed=speed, walls=walls)

    assert min(walls.clearance(pose.x, pose.y) for pose in poses) >= 0.25


offset, speeds = st.floats(-4.0, 4.0), st.floats(-1.5, 1.5)


@given(offset, offset, speeds, speeds, st.floats(-math.pi, math.pi), st.floats(0.2, 2.0))
@example(1.5, 0.0, 0.0, 0.0, 0.0, 1.0)  # stands in its way
@example(1.5, 1.5, 0.0, 0.0, 0.0, 1.0)  # stands beside it
def test_the_way_to_a_meeting_is_that_of_small_steps(px, py, vx, vy, heading, speed):
    reach, direction = 0.6, (math.cos(heading), math.sin(heading))

    way = distance_to_meeting((px, py), (vx, vy), direction, speed, reach)

    if px * direction[0] + py * direction[1] <= 0.0:
        assert way == math.inf
        return
    times = np.arange(0.0, 10.0, 0.002)
    gaps = np.hypot(px + (vx - speed * direction[0]) * times, py + (vy - speed * direction[1]) * times)
    meets = np.flatnonzero(gaps <= reach)
    assert gaps.min() >= reach - 0.02 or way == pytest.approx(speed * times[meets[0]], abs=0.02)
    assert gaps.min() <= reach + 0.02 or way > speed * 9.9


def test_the_same_world_gives_the_same_walk_bit_for_bit():
    robot = Pose.planar(5.0, 0.3)
    assert walk(Machine(robot), 8.0) == walk(Machine(robot), 8.0)


def test_a_run_begins_where_the_route_says_however_long_the_robot_settled():
    world = KinematicWorld()
    person = Person(world, ROUTE, 1.0, start=2.0)
    for _ in range(100):
        world.step()
    assert person.pose().x == 2.0
    person.meet((Machine(FAR),))
    assert (person.pose().x, person.velocity()) == (2.0, (0.0, 0.0))


def test_without_a_speed_or_a_route_it_stands():
    for poses in (walk(Machine(FAR), 2.0, speed=0.0), walk(Machine(FAR), 2.0, [[1.0, 1.0]])):
        assert poses[0] == poses[-1]


@pytest.mark.parametrize("looks", [True, False], ids=["one that waits", "one that does not look"])
def test_people_go_round_other_robots_too(looks):
    world = KinematicWorld()
    other = RouteWalker(world, [[5.0, 0.0]], 0.0, gives_way=looks)
    person = Person(world, ROUTE, 1.0)
    person.meet((Machine(FAR),), (person, other))
    gaps = []
    while world.time < 10.0:
        world.step()
        gaps.append(math.hypot(person.pose().x - 5.0, person.pose().y) - 0.5)
    assert min(gaps) > 0.05 and person.pose().x > 8.0
