"""The loopback robot, the scripted plugins and the session."""

import math

import pytest

from mbf_abstract.geometry import AckermannCommand, Pose, Twist
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.plugins import RefineResult
from mbf_abstract.server.plugin_host import ServerError
from mbf_abstract.testing.loopback import LoopbackRobot
from mbf_abstract.testing.scripted import ScriptedController, ScriptedPlanner
from mbf_abstract.testing.scripted_session import ScriptedSession
from mbf_abstract.time.sim_clock import SimClock
from promises import assert_stops


@pytest.fixture
def robot():
    clock = SimClock()
    robot = LoopbackRobot(clock, TransformBuffer(), Pose.planar(1.0, 2.0, math.pi / 2), wheelbase=0.5)
    robot.clock = clock
    yield robot
    robot.close()
    clock.sleep(0.1)


def test_the_robot_moves_as_commanded(robot):
    robot.send_command(Twist.planar(0.5, 0.1))
    robot.clock.sleep(2.0)
    assert robot.pose.position == pytest.approx((0.8, 3.0, 0.0))


@pytest.mark.parametrize(
    "command", [Twist.planar(0.5, wz=0.5 * math.tan(0.4) / 0.5), AckermannCommand(0.5, 0.4)], ids=["twist", "car"]
)
def test_on_a_circle_it_comes_back(robot, command):
    radius = 0.5 / math.tan(0.4)
    robot.send_command(command)
    robot.clock.sleep(math.pi * radius / 0.5)
    assert robot.pose.position == pytest.approx((1.0 - 2.0 * radius, 2.0, 0.0), abs=0.02)
    robot.clock.sleep(math.pi * radius / 0.5)
    assert robot.pose.position == pytest.approx((1.0, 2.0, 0.0), abs=0.04)


def test_a_stuck_robot_stays_and_says_so_by_its_odometry(robot):
    robot.stuck = True
    robot.send_command(Twist.planar(0.5))
    robot.clock.sleep(1.0)
    assert robot.pose.position == (1.0, 2.0, 0.0)
    assert robot.odometry().velocity == Twist()


def test_the_session_drives_to_a_goal_with_its_scripted_plugins():
    with ScriptedSession(start=Pose.planar(1.0, 1.0)) as session:
        assert session.navigator.go_to(Pose.planar(2.0, 2.0, 1.0)).success
        assert session.robot.pose.distance_to(Pose.planar(2.0, 2.0)) < 0.1


def test_answers_are_played_in_order_and_the_last_is_repeated():
    with ScriptedSession() as session:
        path = session.path_to(1.0)
        session.refiner.play(
            RefineResult(0, "first", path), lambda given: RefineResult(0, f"{len(given)} poses", given)
        )
        messages = [session.refiner.apply_refinement(path, None).message for _ in range(3)]
        assert messages == ["first", "11 poses", "11 poses"]
        assert len(session.refiner.requests) == 3


def test_a_plugin_of_the_session_is_found_by_name_and_class():
    with ScriptedSession() as session:
        assert session.plugin("planner", ScriptedPlanner) is session.planner
        with pytest.raises(KeyError, match="no ScriptedController named 'planner'"):
            session.plugin("planner", ScriptedController)


def test_a_session_whose_server_cannot_be_made_leaves_no_thread():
    class Broken(ScriptedPlanner):
        def __init__(self, context):
            raise ValueError("no planner today")

    clock = SimClock()
    with pytest.raises(ServerError, match="no planner today"):
        ScriptedSession({"broken": Broken}, clock=clock)

    assert list(clock.thread_names) == ["main"]


def test_the_stop_promise_is_checked_in_earnest():
    with ScriptedSession() as session:
        session.robot.send_command(Twist.planar(1.0))
        with pytest.raises(AssertionError, match="the robot still does"):
            assert_stops(session, 0.0)
        session.clock.sleep(3.0)
        session.robot.send_command(Twist.planar(1.0))
        with pytest.raises(AssertionError, match="commands after the fault"):
            assert_stops(session, 0.0)
        session.robot.send_command(Twist())
