"""A sweep in which one setting is refused, on real workers: it is tried once, and its other runs are taken back."""

import time
from functools import partial
from pathlib import Path

import pytest
from distributed import LocalCluster

from mbf_abstract.cluster import run_on_cluster
from terrain.scenarios.library import LIBRARY
from terrain.scenarios.scenario import load_scenario
from terrain.sweeps.sweep import SweepRun, run_once, run_unless_refused
from terrain.sweeps.worker_pool import run_in_workers

pytestmark = pytest.mark.timeout(300)

NOT_YET = ("waiting", "queued", "no-worker", "processing")
clusters = []
"""The cluster of a test; its worker is a thread of this process."""


def run_and_note(folder, job):
    """Do a run as a sweep does, in no time and with a trace; on a cluster a good one waits for what is cancelled."""
    run = job[1]
    (Path(folder) / f"{run.variant}-{run.seed}").touch()
    if "nosuch" in run.variant:
        return run_once(job) | {"seed": run.seed, "variant": run.variant}
    while clusters and sum(task.state in NOT_YET for task in clusters[0].scheduler.tasks.values()) > 2:
        time.sleep(0.01)
    return {"seed": run.seed, "variant": run.variant, "refused": False}


@pytest.fixture(params=["processes", "cluster"])
def spread(request, tmp_path):
    """Does jobs on one real worker."""
    do = partial(run_and_note, str(tmp_path))
    if request.param == "processes":
        yield partial(run_in_workers, do, workers=1)
        return
    options = {"processes": False, "protocol": "tcp://", "dashboard_address": None, "host": "127.0.0.1"}
    with LocalCluster(n_workers=1, threads_per_worker=1, **options) as cluster:
        clusters.append(cluster)
        yield partial(run_on_cluster, do, address=cluster.scheduler_address)
        clusters.clear()


def test_what_a_real_worker_refuses_is_tried_once_and_its_other_runs_are_cancelled(spread, tmp_path):
    scenario = load_scenario(LIBRARY / "crowded_corridor.yaml")
    refused, good = ({"planner": name} for name in ("nosuch", "astar"))
    plan = [(0, refused), (0, good), (1, refused), (2, refused), (1, good)]
    jobs = [(scenario, SweepRun(seed, settings)) for seed, settings in plan]

    rows = list(run_unless_refused(jobs, [], spread))

    assert {file.name for file in tmp_path.iterdir()} == {"planner=nosuch-0", "planner=astar-0", "planner=astar-1"}
    assert sorted((run.seed, run.variant) for (_, run), _ in rows) == sorted((run.seed, run.variant) for _, run in jobs)
    assert [row["refused"] for (_, run), row in rows] == [run.settings == refused for (_, run), _ in rows]
    texts = {row["verdict"] for _, row in rows if row["refused"]}
    assert len(texts) == 1 and "nosuch" in texts.pop()
