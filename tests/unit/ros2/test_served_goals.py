"""Goals of an action server are counted while they run, and what is shown of them is of one instant."""

import sys
from types import ModuleType, SimpleNamespace

import pytest

from mbf_abstract.geometry import Pose
from mbf_abstract.goals.feedback_types import FollowWaypointsFeedback
from mbf_abstract.goals.goal_types import FollowWaypointsGoal
from mbf_abstract.outcomes import ExePathOutcome, MoveBaseOutcome
from mbf_ros.messages import mbf_actions
from mbf_ros.messages.geometry import MessageContext
from mbf_ros.messages.nav2 import waypoints as nav2_waypoints
from mbf_ros.ros2 import actions
from mbf_ros.ros2.actions import MAX_GOALS, ServedAction, Serving
from mbf_ros.ros2.nav2 import WaypointsAction


class GoalHandle:
    """A goal that was accepted, as rclpy hands it over."""

    begun = 0

    def execute(self):
        self.begun += 1


@pytest.fixture
def node():
    logger = SimpleNamespace(warning=lambda text: None)
    return SimpleNamespace(get_logger=lambda: logger)


@pytest.fixture
def callbacks(monkeypatch):
    """What action servers give to rclpy."""
    callbacks = {}
    rclpy_action = ModuleType("rclpy.action")
    rclpy_action.ActionServer = lambda node, kind, name, **given: callbacks.update(given)
    rclpy_action.GoalResponse = SimpleNamespace(ACCEPT="accept", REJECT="reject")
    rclpy_qos = ModuleType("rclpy.qos")
    rclpy_qos.QoSProfile = lambda depth: depth
    monkeypatch.setitem(sys.modules, "rclpy", ModuleType("rclpy"))
    monkeypatch.setitem(sys.modules, "rclpy.qos", rclpy_qos)
    monkeypatch.setitem(sys.modules, "rclpy.action", rclpy_action)
    monkeypatch.setattr(actions, "interface_class", lambda name: None)
    return callbacks


SERVING = Serving(None, MessageContext, lambda: "", None)


@pytest.fixture
def served(node, callbacks):
    """An action, and the callbacks that it has given to rclpy."""
    action = ServedAction(node, "~/exe_path", mbf_actions.EXE_PATH, ExePathOutcome, SERVING)
    return action, SimpleNamespace(**callbacks)


def test_a_goal_whose_client_never_hears_that_it_is_accepted_is_not_unfinished(served):
    action, callbacks = served
    for _ in range(MAX_GOALS + 1):
        assert callbacks.goal_callback(None) == "accept"
    assert action.unfinished == 0


def test_goals_that_run_are_counted_and_too_many_are_rejected(served):
    action, callbacks = served
    goals = [GoalHandle() for _ in range(MAX_GOALS)]
    for goal in goals:
        assert callbacks.goal_callback(None) == "accept"
        callbacks.handle_accepted_callback(goal)
    assert [goal.begun for goal in goals] == [1] * MAX_GOALS
    assert action.unfinished == MAX_GOALS
    assert callbacks.goal_callback(None) == "reject"


def test_feedback_about_waypoints_is_of_the_instant_that_is_published_though_a_newer_one_is_there(node, callbacks):
    server = SimpleNamespace(runtime=SimpleNamespace(clock=SimpleNamespace(now=lambda: 0.0)))
    mapping = nav2_waypoints.FOLLOW_WAYPOINTS
    served = node, "follow_waypoints", mapping, MoveBaseOutcome, SERVING
    action = WaypointsAction(server, SimpleNamespace(ended=0), *served)
    goal = FollowWaypointsGoal(tuple(Pose.planar(float(x), 0.0) for x in range(3)))
    older, newest = (FollowWaypointsFeedback(visit, visit, (), None) for visit in (0, 2))
    handle = SimpleNamespace(goal=goal, feedback=newest, result=None)
    more = action._observe(SimpleNamespace(request=None), handle)
    assert [more(one)["current_waypoint"] for one in (older, newest)] == [0, 2]
