"""Threads of the user's own beside a SimClock: an error where they would hang, and nothing left of a closed server."""

import gc
import sys
import threading
import weakref
from concurrent.futures import ThreadPoolExecutor

import pytest

from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_types import GetPathGoal
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.testing.scripted import straight_plan
from mbf_abstract.testing.scripted_session import ScriptedSession
from mbf_abstract.time.clock import WallClock
from mbf_abstract.time.participant import frames_of_threads
from mbf_abstract.time.sim_clock import ClockDeadlock, SimClock

NAMES_THE_WAY_OUT = r"waits on the clock for thread 'main'.*with clock\.outside\(\)"


def test_a_pool_that_waits_on_the_clock_while_its_owner_waits_for_the_pool_is_an_error():
    clock = SimClock(hang_guard=0.2)
    with ThreadPoolExecutor(1) as pool, pytest.raises(ClockDeadlock, match=NAMES_THE_WAY_OUT):
        pool.submit(clock.sleep, 1.0).result(20.0)
    clock.sleep(2.0)
    assert clock.now() == 2.0


def test_a_plain_thread_that_is_joined_while_it_waits_on_a_condition_is_an_error():
    clock, errors = SimClock(hang_guard=0.2), []
    condition = clock.condition()

    def wait():
        try:
            with condition:
                condition.wait(1.0)
        except ClockDeadlock as error:
            errors.append(str(error))

    thread = threading.Thread(target=wait, name="plain")
    thread.start()
    thread.join(20.0)
    assert len(errors) == 1 and "thread 'plain' waits" in errors[0]
    assert condition.waiters == []


def test_outside_is_the_way_out():
    clock = SimClock(hang_guard=0.2)
    with ThreadPoolExecutor(1) as pool, clock.outside():
        pool.submit(clock.sleep, 1000.0).result(20.0)
    assert clock.now() == 1000.0


def test_a_plugin_that_waits_for_a_pool_of_its_own_is_reported_too():
    with ScriptedSession(hang_guard=2.0) as session, ThreadPoolExecutor(1) as pool:

        def plan(request):
            pool.submit(session.clock.sleep, 0.1).result(20.0)
            return straight_plan(request)

        session.planner.play(plan)
        result = session.navigator.send(GetPathGoal(Pose.planar(2.0, 0.0))).wait()
        assert result.outcome == GetPathOutcome.INTERNAL_ERROR
        assert "with clock.outside()" in result.message


def test_who_computes_for_long_stalls_nobody():
    clock = SimClock(hang_guard=0.1)
    slept = threading.Event()

    def sleep():
        clock.sleep(1.0)
        slept.set()

    threading.Thread(target=sleep).start()
    wall, total = WallClock(), 0
    while wall.now() < 0.4:
        total += 1
    clock.sleep(2.0)
    assert slept.wait(20.0)


@pytest.mark.parametrize("uses", [False, True], ids=["never used", "used"])
def test_a_closed_server_leaves_no_thread_and_no_clock_behind_although_nobody_waits_any_more(uses):
    before = set(threading.enumerate())

    def make_use_and_close():
        session = ScriptedSession()
        session.robot.close()
        session.clock.sleep(0.1)
        if uses:
            assert session.navigator.get_path(Pose.planar(2.0, 0.0)).success
        session.server.close()
        return weakref.ref(session.clock)

    clocks = [make_use_and_close() for _ in range(3)]
    left = [thread for thread in threading.enumerate() if thread not in before]
    for thread in left:
        thread.join(10.0)
    assert not any(thread.is_alive() for thread in left)
    gc.collect()
    assert [clock() for clock in clocks] == [None, None, None]


def test_closing_moves_no_time():
    session = ScriptedSession()
    session.clock.sleep(1.0)
    session.server.close()
    assert session.clock.now() == 1.0
    session.close()


def test_no_garbage_is_collected_while_the_frames_of_threads_are_read(monkeypatch):
    seen = []
    monkeypatch.setattr(sys, "_current_frames", lambda: seen.append(gc.isenabled()) or {})
    frames_of_threads()
    assert seen == [False] and gc.isenabled()
    gc.disable()
    try:
        frames_of_threads()
        assert not gc.isenabled()
    finally:
        gc.enable()
