"""Guarded workers: a job that hangs, crashes or leaves a thread behind costs nothing but its own result."""

import os
import threading

import pytest

from terrain.sweeps.guarded_workers import Lost, run_guarded

FOR_EVER = range(10**15)


def do(job):
    """End the process, add without an end in compiled code, leave a thread behind, or answer."""
    if job == "crash":
        os._exit(3)
    if job == "hang":
        sum(FOR_EVER)  # one call in C: no other thread of Python gets its turn
    if job == "thread":
        threading.Thread(target=threading.Event().wait, daemon=True).start()
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
