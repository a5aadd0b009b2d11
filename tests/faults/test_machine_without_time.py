"""Fault table, row 38: a machine that has no processor for a simulated run for a while, or stands."""

import os
import signal
import subprocess
import sys
import threading

import pytest

from mbf_abstract.time.own_time import OwnTime, seconds_without_processor

LINUX = pytest.mark.skipif(sys.platform != "linux", reason="only Linux reports how long a thread waits for a processor")
POSIX = pytest.mark.skipif(os.name != "posix", reason="a process is stopped by signals")

RUN = """
import os, signal, time
from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_types import GetPathGoal
from mbf_abstract.testing.scripted import straight_plan
from mbf_abstract.testing.scripted_session import ScriptedSession

def plan(request):
    os.kill(os.getpid(), signal.SIGSTOP)
    end = time.thread_time() + 0.1
    while time.thread_time() < end:
        pass
    return straight_plan(request)

with ScriptedSession(hang_guard=0.35) as session:
    session.planner.play(plan)
    result = session.navigator.send(GetPathGoal(Pose.planar(2.0, 0.0))).wait()
    print(result.outcome, session.clock.now(), result.message)
"""
"""A planner that stops its process, and works for 0.1 s once it goes on, in a run with a short hang guard."""


@POSIX
def test_a_run_whose_process_is_stopped_for_longer_than_the_hang_guard_goes_on_as_if_nothing_had_been():
    with subprocess.Popen([sys.executable, "-c", RUN], stdout=subprocess.PIPE, text=True) as run:
        os.waitpid(run.pid, os.WUNTRACED)
        with pytest.raises(subprocess.TimeoutExpired):
            run.wait(0.8)
        run.send_signal(signal.SIGCONT)
        assert run.communicate()[0].startswith("0 0.0 ")


def counted(looks, work=(1, 1, 1, 1, 1)):
    """What is counted at each of several looks: (clock, time without a processor)."""
    clock, unserved = (iter(column) for column in zip(*looks, strict=True))
    own_time = OwnTime(lambda: next(clock), lambda _: next(unserved))
    return [own_time.look(7, number, 2.0) for number, _ in zip(work, looks, strict=False)]


def test_time_counts_from_the_first_look_at_a_piece_of_work():
    assert counted([(100.0, 5.0), (101.0, 5.0), (102.5, 5.0)]) == [0.0, 1.0, 2.5]
    assert counted([(100.0, 5.0), (101.0, 5.0), (102.5, 5.0)], work=(1, 2, 2)) == [0.0, 0.0, 1.5]


def test_waiting_for_a_processor_does_not_count_although_it_is_known_late():
    assert counted([(0.0, 0.0), (1.0, 0.0), (2.0, 1.5), (3.0, 2.0)]) == [0.0, 1.0, 0.5, 1.0]


def test_a_look_that_comes_late_counts_as_the_longest_one():
    assert counted([(0.0, 0.0), (600.0, 0.0), (601.0, 0.0)]) == [0.0, 2.0, 3.0]


@LINUX
def test_the_system_reports_how_long_a_thread_waited_and_nothing_of_one_that_is_not_there():
    assert seconds_without_processor(threading.get_native_id()) > 0.0
    assert seconds_without_processor(0) == 0.0
