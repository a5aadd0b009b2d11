"""Who gives way waits for a robot just ahead, and goes on as if nothing had been when it is gone."""

from dataclasses import dataclass

import pytest

from mbf_abstract.geometry import Pose
from terrain.physics.actors import RouteWalker
from terrain.physics.kinematic_robot import KinematicWorld
from terrain.physics.robot_models import TURTLEBOT, RobotSpec

ROUTE = [[0.0, 0.0], [10.0, 0.0]]


@dataclass
class Standing:
    """A robot that is put somewhere."""

    place: Pose
    spec: RobotSpec = TURTLEBOT

    def pose(self):
        return self.place


def walk(seconds, robot=None, gives_way=True, until=float("inf")):
    """Where somebody who starts at x = 0 with 1 m/s is after some seconds; the robot is gone at ``until``."""
    world = KinematicWorld()
    walker = RouteWalker(world, ROUTE, 1.0, gives_way=gives_way)
    if robot is not None:
        walker.meet((robot,))
    while world.time < seconds:
        world.step()
        if world.time >= until:
            robot.place = Pose.planar(100.0, 0.0)
    return walker.pose().x


def test_it_stops_a_step_before_the_robot():
    touching = 0.25 + TURTLEBOT.circumscribed_radius
    assert walk(8.0, Standing(Pose.planar(4.0, 0.0))) == pytest.approx(4.0 - touching - 0.3, abs=0.05)


def test_it_goes_on_from_there_when_the_robot_has_gone():
    stopped = walk(5.0, Standing(Pose.planar(4.0, 0.0)))
    assert walk(7.0, Standing(Pose.planar(4.0, 0.0)), until=5.0) == pytest.approx(stopped + 2.0, abs=0.05)


@pytest.mark.parametrize("place", [(4.0, 1.5), (-0.3, 0.0)], ids=["beside its way", "behind it"])
def test_a_robot_that_is_not_in_the_way_changes_nothing(place):
    assert walk(6.0, Standing(Pose.planar(*place))) == walk(6.0)


def test_one_that_does_not_look_walks_through():
    assert walk(6.0, Standing(Pose.planar(4.0, 0.0)), gives_way=False) == walk(6.0)
