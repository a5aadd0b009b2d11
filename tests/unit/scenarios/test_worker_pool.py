"""Worker processes: each job is done once, also when a worker is terminated in the middle of one."""

import os
import signal

import pytest

from mbf_abstract.testing.scripted_session import ScriptedSession
from terrain.sweeps.worker_pool import run_in_workers


def end_once(marker):
    """End this worker by SIGTERM in its first job, with a navigation server alive; return the process of the second."""
    with ScriptedSession():
        if not os.path.exists(marker):
            with open(marker, "w") as file:
                file.write(str(os.getpid()))
            os.kill(os.getpid(), signal.SIGTERM)
        return os.getpid()


def test_a_job_whose_worker_is_terminated_is_given_to_another(tmp_path):
    marker = tmp_path / "first"
    ((job, process),) = run_in_workers(end_once, [str(marker)], 1)
    assert job == str(marker)
    assert process != int(marker.read_text())


def cores_of(job):
    return os.sched_getaffinity(0)


@pytest.mark.skipif(not hasattr(os, "sched_getaffinity"), reason="processes cannot be given cores here")
def test_workers_keep_to_different_cores_unless_there_are_fewer_cores():
    cores = os.sched_getaffinity(0)
    found = [core for _, core in run_in_workers(cores_of, range(len(cores)), len(cores))]
    assert sorted(core for own in found for core in own) == sorted(cores)
    assert all(own == cores for _, own in run_in_workers(cores_of, [0], len(cores) + 1))
