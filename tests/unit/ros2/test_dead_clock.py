"""A goal that is canceled ends although the robot's time stands still."""

import threading

import pytest

from mbf_abstract.drive.robot import Odometry
from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.geometry.transform import Transform
from mbf_abstract.goals.goal_status import GoalStatus
from mbf_abstract.goals.goal_types import MoveBaseGoal
from mbf_abstract.server.factory import read_config
from mbf_ros.ros2.clock import SimulatedRosClock
from mbf_ros.ros2.robot import Arrivals, Frames
from mbf_ros.ros2.robot_navigation import RobotNavigation
from tests.system.ros2.conftest import ROBOT

WITHIN = 30.0  # s; nothing waits that long unless it fails
STEP = 0.02  # s


class Topics(RobotNavigation):
    """A navigator whose robot and time a thread plays, until the time is to stop."""

    name, time_name = "navigator", "the robot's time"

    def __init__(self, file):
        super().__init__(max_silence=None, time_to_end=5.0)
        self._arrivals, self._frames = Arrivals(self._real_time.now), Frames("map", "base_link")
        self._clock, self._stopped = SimulatedRosClock(1000.0), threading.Event()
        self.moves, self.aborted = threading.Event(), []
        server_class, config = read_config(file)
        self._make_navigator(server_class, config, self, 1.0)
        self._closing.callback(self.stop_time)
        self._player = self._real_time.spawn(self._play, "robot and time")
        self._begin()

    def stop_time(self):
        self._stopped.set()
        assert self._player.join(WITHIN)

    def _play(self):
        ros_time = 1000.0
        while not self._stopped.wait(STEP):
            ros_time += STEP
            self._clock.follow(ros_time)
            now = self._clock.now()
            self._arrivals.hear("/clock")
            self._transforms.set(Transform((0.0, 0.0, 0.0), parent="map", child="base_link", stamp=now))
            self._robot.take_odometry(Odometry(Twist(), now))

    def publish(self, command):
        if not command.is_stopped():
            self.moves.set()

    def wait_until_sent(self, seconds):
        pass

    def _warn(self, text):
        pass

    def _begin_to_take_goals(self):
        pass

    def _forget_arrivals(self):
        pass

    def _abort_goals(self, text):
        self.aborted.append(text)

    def _wait_for_results(self):
        busy = any(action.busy for action in self.session.navigator.server.actions)
        return busy and not self._real_time.sleep(0.01)


@pytest.fixture
def driving(tmp_path):
    """A navigator that drives a goal, the goal, and what is set when that is done; its time then stops."""
    file = tmp_path / "navigation.yaml"
    file.write_text(ROBOT)
    navigator = Topics(file)
    try:
        assert navigator._ready.wait(2 * WITHIN)
        goal, done = navigator.go_to(MoveBaseGoal(Pose.planar(30.0, 0.0))), threading.Event()
        goal.add_done_callback(lambda _: done.set())
        assert navigator.moves.wait(WITHIN)
        navigator.stop_time()
        yield navigator, goal, done
    finally:
        navigator.close()


def test_a_canceled_goal_ends_although_time_stands_still(driving):
    _, goal, done = driving
    goal.cancel("enough")
    assert done.wait(WITHIN)
    assert (goal.status, goal.result.message) == (GoalStatus.CANCELED, "enough")


def test_goals_end_with_their_navigator_although_time_stands_still(driving):
    navigator, goal, done = driving
    navigator.close()
    assert done.wait(WITHIN)
    assert goal.status is GoalStatus.CANCELED


def test_a_goal_that_nobody_cancels_waits_as_long_as_time_stands_still(driving):
    navigator, goal, done = driving
    stood = navigator._clock.now()
    assert not done.wait(1.5)  # of real time, more than the longest silence
    assert navigator._clock.now() == stood and goal.status is GoalStatus.ACTIVE
