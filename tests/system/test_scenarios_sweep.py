"""A sweep that is killed in the middle goes on where it was: no run lost, none done twice."""

import csv
import json
import os
import signal
import subprocess
import sys

import pytest

pytestmark = pytest.mark.timeout(300)

COMMAND = "import typer; from terrain.sweep_cli import sweep; typer.run(sweep)"
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
    plan = ["--seeds", "0:2", "--set", "planner=dijkstra,astar", "--workers", "2", "--out", str(tmp_path / "out")]
    return [sys.executable, "-c", COMMAND, str(tmp_path / "trial.yaml"), *plan]


def logged(folder):
    return [json.loads(line) for line in (folder / "runs.jsonl").read_text().splitlines()]


def test_a_killed_sweep_is_resumed_without_losing_or_doubling_a_run(arguments, tmp_path):
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
    with (tmp_path / "out" / "sweep.csv").open() as file:
        table = list(csv.DictReader(file))
    assert {(row["seed"], row["variant"]) for row in table} == {
        (seed, variant) for seed in ("0", "1") for variant in ("planner=astar", "planner=dijkstra")
    }
