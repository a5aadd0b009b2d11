"""One behaviour tree, unchanged, on every backend in one story: the same goals end with the same codes in each."""

from py_trees.common import Status

from mbf_abstract.events import EventKind
from mbf_abstract.executives.reference_trees import TreeOptions, navigation_tree
from mbf_abstract.executives.tree_executive import TreeExecutive
from mbf_abstract.geometry import Pose
from mbf_abstract.outcomes import ExePathOutcome, outcome_name
from mbf_abstract.testing.conformance.rig import Box
from mbf_abstract.testing.conformance.site import site

GATE = Box(5.0, 1.0, 5.4, 7.0)
BLOCKED_AND_RECOVERED = [
    ("get_path", "SUCCESS"),
    ("exe_path", "BLOCKED_PATH"),
    ("recovery", "SUCCESS"),
    ("exe_path", "SUCCESS"),
]
CANCELED = [("get_path", "SUCCESS"), ("exe_path", "CANCELED")]
RESUMED_AND_REACHED = [("get_path", "SUCCESS"), ("exe_path", "SUCCESS")]


class Story:
    """A tree on a site: what happened since the last look, and what is to happen at which tick."""

    def __init__(self, made):
        self.made = made
        options = TreeOptions(clear="clear", out_of_collision="back_up", second_planner_pause=0.0)
        self.executive = TreeExecutive(navigation_tree(options), made.navigator)
        self._reported = 0

    def run(self, x, y, script):
        """Drive to a place while ``script(story)`` is called at every tick; status of the tree."""
        self.executive.on_tick[:] = [lambda _: script(self)]
        return self.executive.run(Pose.planar(x, y)).status

    def ended(self):
        """Actions and outcomes of all goals that have ended."""
        ends = self.made.rig.memory.of_kind(EventKind.GOAL_FINISHED)
        return [(end.source, outcome_name(end.data["outcome"])) for end in ends]

    def news(self):
        """Those since the last look."""
        ended = self.ended()
        new, self._reported = ended[self._reported :], len(ended)
        return new


class GateKeeper:
    """Opens the gate as soon as a robot has given up its path before it: an event sink."""

    def __init__(self, rig):
        self.rig = rig

    def write(self, event):
        if event.kind is EventKind.GOAL_FINISHED and event.data["outcome"] == ExePathOutcome.BLOCKED_PATH:
            self.rig.boxes = []

    def close(self):
        pass


def close_the_gate_on_the_way(story):
    rig = story.made.rig
    if rig.robot.pose.x > 2.5 and len(story.ended()) == 1:
        rig.boxes = [GATE]


def cancel_on_the_way(story):
    if story.made.rig.robot.pose.x < 5.5:
        story.executive.cancel("the operator has another errand")


def test_a_robot_is_blocked_recovers_is_canceled_and_reaches_a_new_goal(make_server):
    with site(make_server, controller_max_retries=0) as made:
        story = Story(made)
        made.rig.events.add_sink(GateKeeper(made.rig))

        status = story.run(6.5, 4.0, close_the_gate_on_the_way)
        assert (story.news(), status) == (BLOCKED_AND_RECOVERED, Status.SUCCESS)
        made.expect_near(6.5, 4.0, 0.3, "the gate was opened")

        assert story.run(3.0, 4.0, cancel_on_the_way) == Status.INVALID
        assert story.news() == CANCELED

        assert story.run(6.0, 6.0, lambda _: None) == Status.SUCCESS
        assert story.news() == RESUMED_AND_REACHED
        assert made.rig.robot.pose.distance_to(Pose.planar(6.0, 6.0)) < 0.3
        assert made.rig.robot.command.is_stopped()
