"""Fault table, row 33: servers started and stopped over and over, and shut down at awkward moments."""

import gc
import threading
import weakref

import pytest

from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_status import GoalStatus
from mbf_abstract.goals.goal_types import ExePathGoal, GetPathGoal, MoveBaseGoal
from mbf_abstract.testing.faulty import Hang
from mbf_abstract.testing.scripted_session import ScriptedSession
from promises import assert_ended_once


def start_plan_and_stop():
    """Run one server and return whether it planned, and a weak reference to it."""
    with ScriptedSession() as session:
        return session.navigator.get_path(Pose.planar(1.0, 0.0)).success, weakref.ref(session.server)


def test_100_starts_and_stops_leave_nothing_behind():
    start_plan_and_stop()
    before = set(threading.enumerate())
    runs = [start_plan_and_stop() for _ in range(100)]
    for thread in set(threading.enumerate()) - before:
        thread.join(10.0)  # it has left the lockstep; the operating system may still be ending it
        assert not thread.is_alive(), thread.name
    gc.collect()
    assert all(planned for planned, _ in runs)
    assert sum(server() is not None for _, server in runs) == 0


def test_closing_twice_changes_nothing():
    session = ScriptedSession()
    session.close()
    session.close()
    assert session.robot.command.is_stopped()


def test_shutdown_while_driving_stops_the_robot_and_ends_every_goal():
    with ScriptedSession() as session:
        handles = [
            session.navigator.send(MoveBaseGoal(Pose.planar(50.0, 0.0))),
            session.navigator.send(GetPathGoal(Pose.planar(1.0, 0.0), concurrency_slot=5)),
        ]
        session.clock.sleep(2.0)
        assert not session.robot.command.is_stopped()
        session.server.close()
        closed_at = session.clock.now()
        session.clock.sleep(3.0)
        assert not session.robot.moved_after(closed_at)
        for handle in handles:
            assert_ended_once(session, handle)


@pytest.mark.parametrize("goal", [GetPathGoal(Pose.planar(1.0, 0.0)), MoveBaseGoal(Pose.planar(1.0, 0.0))])
def test_a_goal_after_the_shutdown_is_rejected(goal):
    with ScriptedSession() as session:
        session.server.close()
        handle = session.navigator.send(goal)
        assert handle.status is GoalStatus.REJECTED
        assert handle.result.message


def test_shutdown_with_a_hanging_controller_does_not_wait_for_it():
    with ScriptedSession() as session:
        hang = Hang(session.clock)
        session.controller.play(hang)
        session.navigator.send(ExePathGoal(session.path_to(50.0)))
        session.clock.sleep(0.5)
        before = session.clock.now()
        session.server.close()
        assert (hang.entered, session.clock.now() - before) == (1, 0.0)
        assert session.robot.command.is_stopped()
        hang.release()
