"""Fault table, row 33: servers started and stopped over and over, and shut down at awkward moments."""

import gc
import threading
import weakref

import pytest

from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_types import ExePathGoal, GetPathGoal, MoveBaseGoal
from mbf_abstract.goals.handle import GoalStatus
from mbf_abstract.testing.bench import Bench
from mbf_abstract.testing.faulty import Hang
from mbf_abstract.testing.promises import assert_ended_once


def start_plan_and_stop():
    """Run one server and return whether it planned, and a weak reference to it."""
    with Bench() as bench:
        return bench.navigator.get_path(Pose.planar(1.0, 0.0)).success, weakref.ref(bench.server)


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
    bench = Bench()
    bench.close()
    bench.close()
    assert bench.robot.command.is_stopped()


def test_shutdown_while_driving_stops_the_robot_and_ends_every_goal():
    with Bench() as bench:
        handles = [
            bench.navigator.send(MoveBaseGoal(Pose.planar(50.0, 0.0))),
            bench.navigator.send(GetPathGoal(Pose.planar(1.0, 0.0), concurrency_slot=5)),
        ]
        bench.clock.sleep(2.0)
        assert not bench.robot.command.is_stopped()
        bench.server.close()
        closed_at = bench.clock.now()
        bench.clock.sleep(3.0)
        assert not bench.robot.moved_after(closed_at)
        for handle in handles:
            assert_ended_once(bench, handle)


@pytest.mark.parametrize("goal", [GetPathGoal(Pose.planar(1.0, 0.0)), MoveBaseGoal(Pose.planar(1.0, 0.0))])
def test_a_goal_after_the_shutdown_is_rejected(goal):
    with Bench() as bench:
        bench.server.close()
        handle = bench.navigator.send(goal)
        assert handle.status is GoalStatus.REJECTED
        assert handle.result.message


def test_shutdown_with_a_hanging_controller_does_not_wait_for_it():
    with Bench() as bench:
        hang = Hang(bench.clock)
        bench.controller.play(hang)
        bench.navigator.send(ExePathGoal(bench.path_to(50.0)))
        bench.clock.sleep(0.5)
        before = bench.clock.now()
        bench.server.close()
        assert (hang.entered, bench.clock.now() - before) == (1, 0.0)
        assert bench.robot.command.is_stopped()
        hang.release()
