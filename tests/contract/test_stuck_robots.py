"""Robots that get stuck, with real planners, controllers and recoveries, on every backend: freed, or given up on."""

import re

import pytest

from mbf_abstract.events import EventKind
from mbf_abstract.executives.reference_trees import TreeOptions, navigation_tree
from mbf_abstract.executives.tree_executive import TreeExecutive
from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_types import MoveBaseGoal
from mbf_abstract.testing.conformance.rig import Box
from mbf_abstract.testing.conformance.site import site

pytestmark = pytest.mark.usefixtures("one_core")

WALL = Box(5.0, -0.5, 5.4, 8.5)  # across the whole floor
DOOR = [Box(5.0, -0.5, 5.4, 3.5), Box(5.0, 4.5, 5.4, 8.5)]  # 1 m wide; the robot has 0.6 m
SOMEBODY = Box(5.0, 3.5, 5.4, 4.5)
GOAL = Pose.planar(8.0, 4.0)
ESCALATION = ("wait", "back_up", "relax")
PARAMETERS = {
    "planner_patience": 0.5,
    "controller_max_retries": 3,
    "stuck_time": 2.0,
    "escalation_behaviors": ESCALATION,
}


def with_tree(made):
    options = TreeOptions(check_poses=False, clear="clear", out_of_collision="back_up", second_planner_pause=0.0)
    result = TreeExecutive(navigation_tree(options), made.navigator).run(GOAL)
    return result.success, result.message


def with_move_base(made):
    result = made.navigator.send(MoveBaseGoal(GOAL, recovery_behaviors=("clear",) * 6)).wait()
    return result.success, result.message


EXECUTIVES = {"tree": with_tree, "move_base": with_move_base}


class OpensWhenStuck:
    """Leaves only some boxes as soon as the robot counts as stuck: an event sink."""

    def __init__(self, rig, boxes=()):
        self.rig, self.boxes = rig, list(boxes)

    def write(self, event):
        if event.kind is EventKind.STUCK:
            self.rig.boxes = self.boxes

    def close(self):
        pass


def behaviours(made):
    return [event.data["plugin"] for event in made.rig.memory.of_kind(EventKind.RECOVERY)]


@pytest.mark.parametrize("executive", EXECUTIVES)
def test_a_robot_that_is_walled_in_and_freed_again_arrives(make_server, executive):
    with site(make_server, **PARAMETERS) as made:
        made.place(WALL)
        made.rig.events.add_sink(OpensWhenStuck(made.rig))
        success, message = EXECUTIVES[executive](made)
        assert success, message
        assert made.rig.robot.pose.distance_to(GOAL) < 0.3
        assert "wait" in behaviours(made)
        made.expect_no_contact()


@pytest.mark.parametrize("executive", EXECUTIVES)
def test_a_door_that_somebody_stands_in_is_passed_when_he_has_gone(make_server, executive):
    with site(make_server, **PARAMETERS) as made:
        made.place(*DOOR, SOMEBODY)
        made.rig.events.add_sink(OpensWhenStuck(made.rig, DOOR))
        success, message = EXECUTIVES[executive](made)
        assert success, message
        assert made.rig.robot.pose.distance_to(GOAL) < 0.3
        made.expect_no_contact()


@pytest.mark.parametrize("executive", EXECUTIVES)
def test_a_robot_that_stays_walled_in_gives_up_with_the_place_and_what_was_tried(make_server, executive):
    with site(make_server, **PARAMETERS) as made:
        made.place(WALL)
        success, message = EXECUTIVES[executive](made)
        assert not success
        x, y = re.search(r"; stuck at \(([0-9.]+), ([0-9.]+)", message).groups()
        assert made.rig.robot.pose.distance_to(Pose.planar(float(x), float(y))) < 1.5, "backed up at most twice"
        tried = message.split("tried ")[1]
        assert all(name in tried for name in ESCALATION), message
        reported = [event.data["message"] for event in made.rig.memory.of_kind(EventKind.STUCK)]
        assert any(f"({x}, {y}" in text for text in reported)
        assert made.rig.robot.command.is_stopped()
        made.expect_no_contact()
