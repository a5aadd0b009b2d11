"""Trees of a user, named as ``module:function``: whatever is wrong with one is a message that names it."""

import py_trees
import pytest
from py_trees.common import Status

from mbf_abstract.config.findings import ConfigError
from mbf_abstract.executives.leaves import ExePath, GetPath
from mbf_abstract.geometry import Pose
from mbf_abstract.outcomes import MoveBaseOutcome
from mbf_abstract.testing.scripted_session import ScriptedSession
from terrain.session.executives import make_executive

GOAL = Pose.planar(3.0, 0.0)


def raising():
    raise ValueError("no idea")


def nothing(options):
    return None


def a_class(options):
    return py_trees.behaviours.Success


def without_options():
    return None


def broken(options):
    raising()


class Impatient(py_trees.behaviour.Behaviour):
    ticks = 0

    def update(self) -> Status:
        self.ticks += 1
        return Status.RUNNING if self.ticks < 20 else raising()


def raising_beside_a_drive(options):
    drive = py_trees.composites.Sequence("drive", memory=True, children=[GetPath(), ExePath()])
    policy = py_trees.common.ParallelPolicy.SuccessOnAll()
    return py_trees.composites.Parallel("both", policy, children=[drive, Impatient("watch")])


class Forgetful(py_trees.behaviour.Behaviour):
    def update(self) -> Status:
        pass


def without_status(options):
    return Forgetful("look")


@pytest.fixture
def drive_with():
    with ScriptedSession() as session:
        yield lambda tree: make_executive(f"{__name__}:{tree.__name__}", session.navigator).drive(GOAL)
        stopped_at = session.robot.pose
        session.clock.sleep(1.0)
        assert session.robot.pose.distance_to(stopped_at) < 0.01


@pytest.mark.parametrize(
    ("function", "text"),
    [
        (nothing, "expected a tree of py_trees, got .*:nothing made None"),
        (a_class, "expected a tree of py_trees, got .*:a_class made <class"),
        (without_options, "expected a function that makes a tree, got .*:without_options: TypeError"),
        (broken, "expected a function that makes a tree, got .*:broken: ValueError: no idea"),
    ],
)
def test_a_function_that_makes_no_tree_is_named(drive_with, function, text):
    with pytest.raises(ConfigError, match=text):
        drive_with(function)


def test_a_node_that_raises_ends_the_goal_and_is_named(drive_with):
    result = drive_with(raising_beside_a_drive)
    assert result.outcome == MoveBaseOutcome.INTERNAL_ERROR
    assert result.message == "tree 'both': node 'watch' raised ValueError: no idea"


def test_a_node_that_returns_no_status_is_a_failure_and_no_cancel(drive_with):
    result = drive_with(without_status)
    assert result.outcome == MoveBaseOutcome.INTERNAL_ERROR
    assert "'look' has no status: a node answered neither SUCCESS, FAILURE nor RUNNING" in result.message
