"""A place that is worse than the map says: plans lead around it, on every backend but tiles, which ignore it."""

import math

import pytest

from mbf_abstract.events import EventKind
from mbf_abstract.executives.reference_trees import TreeOptions, navigation_tree
from mbf_abstract.executives.tree_executive import TreeExecutive
from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.goals.goal_types import MoveBaseGoal
from mbf_abstract.maps.avoided_places import AvoidedPlace
from mbf_abstract.testing.conformance.rig import Box
from mbf_abstract.testing.conformance.site import site

pytestmark = pytest.mark.usefixtures("one_core")

MIRE = Pose.planar(5.0, 4.0)
PLACE = AvoidedPlace(MIRE, 0.6)
GOAL = Pose.planar(8.0, 4.0)
TREE = TreeOptions(
    check_poses=False, reuse_path=False, clear="clear", out_of_collision="back_up", second_planner_pause=0.0
)


@pytest.fixture(params=["costmap", "mesh", "elevation_grid", "occupancy_octree"])
def make_avoiding(request, backends):
    return backends[request.param]


@pytest.mark.parametrize("backend", ["costmap", "mesh"])
def test_what_stands_on_a_path_is_named_and_poses_off_a_map_are_nothing(backends, backend):
    with site(backends[backend]) as made:
        obstacle_along = made.server.obstacle_along
        made.place(Box(3.0, 3.5, 3.5, 4.5))
        assert obstacle_along(made.path((2.0, 4.0), (2.4, 4.0), (2.4, 7.0))) == ""
        assert obstacle_along(made.path((2.0, 4.0), (4.0, 4.0))) == "pose 7 of the path (2.70, 4.00, 0.00) is blocked"
        assert obstacle_along(made.path((2.0, 4.0), (-40.0, 4.0))) == ""


def least_distance(path):
    return min(math.hypot(x - MIRE.x, y - MIRE.y) for x, y, _ in path.positions.tolist())


def hold_in_the_mire(robot):
    """Let the wheels find no hold in the mire; backward they do."""
    commanded = robot._velocity

    def velocity():
        command = commanded()
        inside = math.hypot(robot.pose.x - MIRE.x, robot.pose.y - MIRE.y) < 0.3
        return Twist() if inside and not command.vx < 0.0 else command

    robot._velocity = velocity


def test_plans_lead_around_a_closed_place_until_it_is_open_again(make_avoiding):
    with site(make_avoiding) as made:
        made.server.avoid([PLACE])
        assert least_distance(made.navigator.get_path(GOAL).path) > 0.5
        made.server.avoid([])
        assert least_distance(made.navigator.get_path(GOAL).path) < 0.2


def test_clearing_the_map_opens_no_closed_place(make_avoiding):
    with site(make_avoiding) as made:
        made.server.avoid([PLACE])
        made.navigator.recover("clear")
        made.rig.clock.sleep(1.0)
        assert least_distance(made.navigator.get_path(GOAL).path) > 0.5


@pytest.mark.parametrize("executive", ["move_base", "tree"])
def test_a_robot_that_found_no_hold_drives_around_and_leaves_nothing_behind(make_avoiding, executive):
    with site(make_avoiding, cmd_vel_ignored_tolerance=1.0) as made:
        hold_in_the_mire(made.rig.robot)
        if executive == "move_base":
            result = made.navigator.send(MoveBaseGoal(GOAL, recovery_behaviors=("back_up",) * 3)).wait()
        else:
            result = TreeExecutive(navigation_tree(TREE), made.navigator).run(GOAL)
        assert result.success, result.message
        assert made.rig.robot.pose.distance_to(GOAL) < 0.3
        said = [event.data["message"] for event in made.rig.memory.of_kind(EventKind.CUSTOM)]
        assert "plans avoid 1 place(s) at which the robot was stuck" in said
        assert least_distance(made.navigator.get_path(Pose.planar(2.0, 4.0)).path) < 0.2
