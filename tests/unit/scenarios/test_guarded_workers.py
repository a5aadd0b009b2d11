"""Guarded workers: a job that hangs, crashes or leaves a thread behind costs nothing but its own result."""

import multiprocessing
import os
import signal
import threading
from contextlib import suppress
from pathlib import Path

import pytest

from mbf_abstract.time.clock import wall_seconds
from terrain.sweeps.guarded_workers import Lost, run_guarded

FOR_EVER = range(10**15)


def do(job):
    """End the process, add without an end in compiled code, leave a thread or a child behind, or answer."""
    if job == "crash":
        os._exit(3)
    if job == "hang":
        sum(FOR_EVER)  # one call in C: no other thread of Python gets its turn
    if job == "thread":
        threading.Thread(target=threading.Event().wait, daemon=True).start()
    if job.startswith("child"):
        child = multiprocessing.get_context("fork").Process(target=signal.pause)
        child.start()
        if job == "child, then crash":
            os._exit(4)
        return job, child.pid
    return job, os.getpid()


@pytest.mark.parametrize("workers", [1, 2])
def test_every_job_has_its_result_or_the_reason_why_it_has_none(workers):
    jobs = ["a", "crash", "b", "hang", "c"]
    results = dict(run_guarded(do, jobs, workers, time_limit=2.0))
    assert list(sorted(results)) == sorted(jobs)
    assert results["crash"] == Lost("crashed: the process of the run ended with code 3")
    assert results["hang"] == Lost("hung: the run did not end within 2 s")
    assert [results[job][0] for job in "abc"] == ["a", "b", "c"]


def test_a_worker_with_a_thread_left_behind_gets_no_other_job():
    results = dict(run_guarded(do, ["a", "thread", "b"], 1, time_limit=60.0))
    assert results["a"][1] == results["thread"][1] != results["b"][1]


def test_a_worker_that_dies_between_two_jobs_is_replaced_and_its_next_job_is_done():
    results = run_guarded(do, ["a", "b"], 1, time_limit=60.0)
    job, (_, idle) = next(results)
    os.kill(idle, signal.SIGKILL)
    # It is left to be waited for. In /proc it has ended before its threads have, which still hold its end of the pipe.
    os.waitid(os.P_PID, idle, os.WEXITED | os.WNOWAIT)
    ((other, (_, pid)),) = results
    assert (job, other) == ("a", "b") and pid != idle


class UnpickledByFreshWorkersOnly:
    """A job that ends a worker which has done another one, while it takes this one from the pipe."""

    has_worked = False

    def __reduce__(self):
        return unpickled, ()


def unpickled():
    if UnpickledByFreshWorkersOnly.has_worked:
        os._exit(9)
    return "b"


def note(job):
    UnpickledByFreshWorkersOnly.has_worked = True
    return job, os.getpid()


def test_a_worker_that_dies_before_it_has_begun_its_next_job_is_replaced_and_that_is_done():
    (_, first), (_, second) = run_guarded(note, ["a", UnpickledByFreshWorkersOnly()], 1, time_limit=60.0)
    assert first[0] == "a" and second[0] == "b" and first[1] != second[1]


class NeverUnpickled:
    """A job that ends every worker which takes it."""

    def __reduce__(self):
        return os._exit, (7,)


def test_a_job_that_ends_every_worker_before_it_has_begun_is_lost_and_the_others_are_done():
    results = [result for _, result in run_guarded(do, ["a", NeverUnpickled(), "b"], 1, time_limit=60.0)]
    assert sorted(str(one) for one in results if isinstance(one, Lost)) == [
        "Lost(reason='crashed: the process of the run ended with code 7')"
    ]
    assert [one[0] for one in results if not isinstance(one, Lost)] == ["a", "b"]


def test_a_job_may_start_processes_and_they_end_with_their_worker():
    """A child holds the worker's end of the pipe: its end alone does not show that the worker has died."""
    results = dict(run_guarded(do, ["child", "child, then crash", "a"], 1, time_limit=60.0))
    assert results["child, then crash"] == Lost("crashed: the process of the run ended with code 4")
    assert results["a"][0] == "a"
    wait_for_the_end_of(results["child"][1])


def wait_for_the_end_of(pid):
    """Wait until a process has ended; one that nobody has waited for has ended, too."""
    deadline = wall_seconds() + 60.0
    file = Path(f"/proc/{pid}/stat")
    with suppress(FileNotFoundError, ProcessLookupError):
        while file.read_text().rpartition(")")[2].split()[0] != "Z":
            assert wall_seconds() < deadline, f"process {pid} has not ended"


def test_no_job_follows_one_that_leaves_traces():
    results = dict(run_guarded(do, ["a", "b", "c"], 1, 60.0, leaves_traces="b".__eq__))
    assert results["a"][1] == results["b"][1] != results["c"][1]
