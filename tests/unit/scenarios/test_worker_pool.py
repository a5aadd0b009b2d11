"""Worker processes: each job is done once, also when a worker is terminated in the middle of one."""

import os
import signal

import pytest

from mbf_abstract.testing.scripted_session import ScriptedSession
from terrain.sweeps.worker_pool import run_in_workers


def end_once(job):
    """End this worker by a signal in its first job, with a server alive; return the process of the second."""
    marker, ending = job
    with ScriptedSession():
        if not os.path.exists(marker):
            with open(marker, "w") as file:
                file.write(str(os.getpid()))
            os.kill(os.getpid(), ending)
        return os.getpid()


@pytest.mark.parametrize("ending", [signal.SIGTERM, signal.SIGINT])
def test_a_job_whose_worker_is_ended_is_given_to_another(tmp_path, ending):
    """A worker that outlived a Ctrl-C would wait for work while its parent, interrupted once more, waits for it."""
    marker = tmp_path / "first"
    ((job, process),) = run_in_workers(end_once, [(str(marker), ending)], 1)
    assert job == (str(marker), ending)
    assert process != int(marker.read_text())


def cores_of(job):
    return os.sched_getaffinity(0)


@pytest.mark.skipif(not hasattr(os, "sched_getaffinity"), reason="processes cannot be given cores here")
def test_workers_keep_to_different_cores_unless_there_are_fewer_cores():
    cores = os.sched_getaffinity(0)
    found = [core for _, core in run_in_workers(cores_of, range(len(cores)), len(cores))]
    assert sorted(core for own in found for core in own) == sorted(cores)
    assert all(own == cores for _, own in run_in_workers(cores_of, [0], len(cores) + 1))
