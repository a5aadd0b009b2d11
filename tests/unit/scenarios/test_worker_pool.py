"""Worker processes: each job is done once, also when a worker is terminated in the middle of one."""

import os
import signal

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
