"""The tree that asks who is in the way, with real sensing, plans and drives, on every map that tracks objects.

Another robot comes along our path and stands as long as ours is just ahead, so both stand until one goes around.
"""

import pytest

from mbf_abstract.events import EventKind
from mbf_abstract.executives.reference_trees import TreeOptions, navigation_tree
from mbf_abstract.executives.tree_executive import TreeExecutive
from mbf_abstract.geometry import Pose
from mbf_abstract.testing.conformance.rig import ROBOT_RADIUS, Box
from mbf_abstract.testing.conformance.site import site
from mbf_abstract.time.clock import Priority

HALF, STEP, SPEED, COURTESY = 0.25, 0.05, 0.4, 1.2  # m, s, m/s, m
GOAL = Pose.planar(9.0, 4.0)


@pytest.fixture(params=["costmap", "mesh"])
def make_map_server(request, backends):
    return backends[request.param]


class Shuttle:
    """A box that drives along y = 4 m towards the robot, and stands while that one is just ahead of it."""

    def __init__(self, rig, x):
        self.rig, self.x, self.touched, self.over = rig, x, False, False
        rig.on_close(self.stop)
        self._place()
        rig.clock.spawn(self._drive, "shuttle", Priority.SIMULATOR)

    def stop(self):
        self.over = True

    def _place(self):
        self.rig.boxes = [Box(self.x - HALF, 4.0 - HALF, self.x + HALF, 4.0 + HALF)]

    def _drive(self):
        while not self.over and self.x > 1.0:
            robot = self.rig.robot.pose
            ahead = 0.0 < self.x - robot.x < COURTESY and abs(robot.y - 4.0) < HALF + ROBOT_RADIUS
            self.x -= 0.0 if ahead else SPEED * STEP
            self._place()
            self.touched = self.touched or self.rig.boxes[0].gap(robot.x, robot.y) < ROBOT_RADIUS
            self.rig.clock.sleep(STEP)


def test_one_that_waits_for_us_is_passed_once_both_stand(make_map_server):
    with site(make_map_server) as made:
        shuttle = Shuttle(made.rig, 8.0)
        options = TreeOptions(wait="wait", give_way="wait", move_away="move_away")
        result = TreeExecutive(navigation_tree(options), made.navigator).run(GOAL)
        assert result.success, result.message
        assert not shuttle.touched and shuttle.x < made.rig.robot.pose.x
        calls = [event.data["method"] for event in made.rig.memory.of_kind(EventKind.PLUGIN_CALL_STARTED)]
        assert calls.count("make_plan") <= 4, "one to the goal, and few around who stands"
        assert made.rig.clock.now() < 40.0
