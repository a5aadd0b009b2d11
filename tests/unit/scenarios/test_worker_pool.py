"""Worker processes: each job is done once, also when a worker is terminated in the middle of one."""

import os
import signal

import pytest

from mbf_abstract.testing.scripted_session import ScriptedSession
from terrain.sweeps.own_core import take_one_of
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


def core_beside(cores):
    return take_one_of(cores)


@pytest.mark.skipif(not hasattr(os, "sched_getaffinity"), reason="processes cannot be given cores here")
def test_a_worker_takes_a_core_that_no_worker_of_another_sweep_has():
    """Two sweeps of one worker each on a machine with many cores both took the second one."""
    cores = [100_000 + os.getpid() + k for k in (0, 1)]  # of no machine, and of no other test
    ((_, beside),) = run_in_workers(core_beside, [cores], 1)
    assert beside == cores[0], "a worker that has ended has given its core back"
    assert [take_one_of(cores) for _ in range(3)] == [cores[0], cores[1], cores[0]]
    ((_, last),) = run_in_workers(core_beside, [[cores[0], cores[1] + 1]], 1)
    assert last == cores[1] + 1
