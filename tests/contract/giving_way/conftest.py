"""A robot that gives way in a corridor of 0.8 m, a bay beside it, a corner or a hall, on each map."""

import math

import numpy as np
import pytest

from mbf_abstract.geometry import Pose
from mbf_abstract.maps.recoveries.give_way import GiveWayParameters, GiveWayRecovery
from mbf_abstract.plugins import RecoveryRequest
from mbf_abstract.testing.contract.recovery import RigMotion
from mbf_abstract.testing.contract.rig import rig
from mbf_abstract.time.cancel import CancelToken
from mbf_abstract.traffic.traffic import Traffic

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
    """Notes how near the robot's centre comes to a wall [m]; ``on_command(pose)`` is called before each command."""

    least_gap = math.inf
    on_command = staticmethod(lambda pose: None)

    def send(self, command):
        pose = self.pose()
        self.poses.append(pose)
        self.robot._extend_track(pose.position)
        self.on_command(pose)
        self.least_gap = min(self.least_gap, float(np.hypot(*(self.walls - (pose.x, pose.y)).T).min(initial=math.inf)))
        return super().send(command)


@pytest.fixture
def give_way(world):
    """``give_way(lethal, start, track, **parameters)`` -> result, motion with its end and seconds."""

    def run(lethal, start=START, track=(), traffic=None, navigation_map=None, on_command=None, **parameters):
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
            motion.on_command, motion.poses = on_command or motion.on_command, []
            motion.robot = made.plugin.robot
            x, y = np.meshgrid(np.arange(81) * 0.1, np.arange(61) * 0.1)  # the vertices of the mesh
            motion.walls = np.column_stack([x[lethal(x, y)], y[lethal(x, y)]])
            result = made.plugin.run_behavior(RecoveryRequest(motion, token))
            motion.end, motion.seconds = made.robot.pose, made.clock.now()
            return result, motion

    return run
