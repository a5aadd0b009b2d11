"""A sweep that is killed in the middle, or loses a worker, goes on where it was: no run lost, none done twice."""

import csv
import json
import os
import signal
import subprocess
import sys
from contextlib import ExitStack

import pytest
from distributed import Client
from pyarrow import parquet

from mbf_abstract.cluster import ClusterError, run_on_cluster

pytestmark = pytest.mark.timeout(300)

COMMAND = "import typer; from terrain.sweeps.command import sweep; typer.run(sweep)"
CONNECT = "import sys; from mbf_abstract.cluster import run_on_cluster; list(run_on_cluster(print, [], sys.argv[1]))"
SCENARIO = """
name: trial
proves: A short drive.
backend: mesh
navigation: {mesh: nav.yaml}
world: {type: generated, size: [12.0, 10.0], spacing: 0.5, median_slope: 2.0}
robot: husky
start: {x: 4.0, y: 5.0}
goals: [{x: 6.0, y: 5.0}]
time_limit: 20.0
"""
NAVIGATION = """
backend: mesh
dist_tolerance: 0.4
angle_tolerance: 3.14
planners: [{name: dijkstra, type: dijkstra}]
controllers: [{name: follower, type: path_follower}]
mesh_map: {mesh_file: $WORLD_MESH, layers: []}
"""


@pytest.fixture
def arguments(tmp_path):
    (tmp_path / "nav.yaml").write_text(NAVIGATION)
    (tmp_path / "trial.yaml").write_text(SCENARIO)
    plan = ["--seeds", "0:2", "--set", "planner=dijkstra,astar", "--out", str(tmp_path / "out")]
    return [sys.executable, "-c", COMMAND, str(tmp_path / "trial.yaml"), *plan]


@pytest.fixture
def dask():
    """``dask(*arguments, wait_for)`` starts a part of a Dask cluster: its process, and the line it waited for."""
    with ExitStack() as processes:

        def start(*arguments, wait_for):
            process = subprocess.Popen(
                [sys.executable, "-m", "dask", *arguments], stderr=subprocess.PIPE, text=True, start_new_session=True
            )
            processes.callback(process.wait)
            processes.callback(process.kill)
            processes.callback(process.stderr.close)
            return process, next(line for line in process.stderr if wait_for in line)

        yield start


@pytest.fixture
def scheduler(dask):
    """Address of a Dask scheduler."""
    options = ("--host", "127.0.0.1", "--port", "0", "--no-dashboard")
    return dask("scheduler", *options, wait_for="Scheduler at")[1].split()[-1]


@pytest.fixture
def worker(dask, scheduler):
    """``worker(name, threads)`` starts a worker process of the scheduler."""

    def start(name, threads=1):
        options = ("--nthreads", str(threads), "--no-nanny", "--no-dashboard", "--name", name)
        return dask("worker", scheduler, *options, wait_for="Starting established connection")[0]

    return start


def logged(folder):
    return [json.loads(line) for line in (folder / "runs.jsonl").read_text().splitlines()]


def test_a_killed_sweep_is_resumed_without_losing_or_doubling_a_run(arguments, tmp_path):
    arguments += ["--workers", "2"]
    with subprocess.Popen(arguments, stdout=subprocess.PIPE, text=True, start_new_session=True) as process:
        for line in process.stdout:
            if line.startswith("seed "):
                break
        os.kill(process.pid, signal.SIGKILL)
    before = logged(tmp_path / "out")
    assert 1 <= len(before) < 4

    finished = subprocess.run(arguments, capture_output=True, text=True, check=True)

    after = logged(tmp_path / "out")
    assert after[: len(before)] == before
    assert len(after) == len({row["key"] for row in after}) == 4
    assert all(row["success"] for row in after)
    assert f"{len(before)} of them done before" in finished.stdout
    assert "%" not in finished.stdout, "a bar is for terminals"
    with (tmp_path / "out" / "sweep.csv").open() as file:
        table = list(csv.DictReader(file))
    assert {(row["outcome_code"], row["collisions"], row["tip_overs"]) for row in table} == {("0", "0", "0")}
    assert all(0.97 <= float(row["path_over_geodesic"]) < 1.2 for row in table)  # straight ahead on open ground
    assert {(row["seed"], row["variant"]) for row in table} == {
        (seed, variant) for seed in ("0", "1") for variant in ("planner=astar", "planner=dijkstra")
    }


def test_a_cluster_that_loses_a_worker_at_work_does_every_run_once(arguments, scheduler, worker, tmp_path):
    workers = {name: worker(name) for name in ("one", "two")}
    with Client(scheduler, set_as_default=False) as client:
        client.wait_for_workers(len(workers), timeout=60)
        info = client.scheduler_info(n_workers=-1)["workers"]
        processes = {where: workers[reported["name"]] for where, reported in info.items()}
        with subprocess.Popen([*arguments, "--scheduler", scheduler], stdout=subprocess.DEVNULL) as process:
            victim = None
            while victim is None:
                assert process.poll() is None, "the sweep ended before a worker was seen at work"
                victim = next((where for where, tasks in client.processing().items() if tasks), None)
            processes[victim].kill()

    assert process.returncode == 0
    rows = logged(tmp_path / "out")
    assert len(rows) == len({row["key"] for row in rows}) == 4
    assert all(row["success"] for row in rows)
    table = parquet.read_table(tmp_path / "out" / "sweep.parquet")
    assert sorted(zip(table["seed"].to_pylist(), table["variant"].to_pylist(), strict=True)) == [
        (seed, variant) for seed in (0, 1) for variant in ("planner=astar", "planner=dijkstra")
    ]


def test_a_scheduler_that_does_not_answer_is_reported():
    with pytest.raises(ClusterError, match="no scheduler answers at nonsense://here"):
        list(run_on_cluster(print, [], "nonsense://here"))


def test_an_address_without_a_port_is_one_error():
    finished = subprocess.run([sys.executable, "-c", CONNECT, "nonsense"], capture_output=True, text=True)
    assert "no scheduler answers at nonsense: missing port" in finished.stderr
    assert "Exception ignored" not in finished.stderr


def test_workers_with_several_threads_are_refused(scheduler, worker):
    worker("two at once", threads=2)

    # A process of its own: beside busy threads of other tests the client's loop has been seen to start too late.
    finished = subprocess.run([sys.executable, "-c", CONNECT, scheduler], capture_output=True, text=True)

    assert "ClusterError: workers must have one thread (--nthreads 1)" in finished.stderr


def test_settings_that_look_like_markup_neither_break_the_table_nor_vanish(arguments, tmp_path):
    arguments[arguments.index("planner=dijkstra,astar")] = "planner=[/x],[red]"
    arguments[arguments.index("0:2")] = "0:1"

    finished = subprocess.run(arguments, capture_output=True, text=True, env={**os.environ, "COLUMNS": "200"})

    assert (finished.returncode, finished.stderr) == (2, "")
    assert finished.stdout.count("planner=[/x]") == finished.stdout.count("planner=[red]") == 2


@pytest.mark.parametrize(("planners", "code"), [("dijkstra,astarr", 0), ("astarr", 2)])
def test_a_sweep_of_which_no_run_could_begin_ends_with_2(arguments, tmp_path, planners, code):
    given = [f"planner={planners}" if one.startswith("planner=") else one for one in arguments]
    done = subprocess.run(given, capture_output=True, text=True)
    assert done.returncode == code, done.stderr
    assert "refused with every seed" in done.stdout and "did you mean 'astar'" in done.stdout
