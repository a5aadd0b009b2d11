"""``mbf bench`` from the page of the documentation to the table, and plugins that do what they must not."""

import json
import re
import shlex
from pathlib import Path

import pytest
from typer.testing import CliRunner

from mbf_abstract.cli import make_app
from terrain.experiments.evaluation.indoor import always
from terrain.experiments.evaluation.protocol import Entry, Protocol, Trial
from terrain.experiments.evaluation.trials import run_trials
from terrain.scenarios.scenario import PlanarPose, Scenario
from terrain.scenarios.world_types import GeneratedWorld

pytestmark = pytest.mark.timeout(600)  # workers compile kernels on a machine that has none
REPOSITORY = Path(__file__).resolve().parents[2]
NAVIGATION = """
backend: mesh
dist_tolerance: 0.4
angle_tolerance: 3.14
planners: [{name: dijkstra, type: dijkstra}]
controllers: [{name: follower, type: path_follower}]
mesh_map: {mesh_file: $WORLD_MESH, layers: []}
"""
BAD_PLANNERS = """
import os
from mbf_mesh_nav.plugins import MeshPlanner

class Raises(MeshPlanner):
    def make_plan(self, request):
        raise ZeroDivisionError("no idea")

class Garbage(MeshPlanner):
    def make_plan(self, request):
        return {"path": "to glory"}

class Crashes(MeshPlanner):
    def make_plan(self, request):
        os._exit(3)
"""


def test_the_first_command_of_the_page_judges_its_planner_and_a_second_one_drives_nothing_again(tmp_path, monkeypatch):
    page = (REPOSITORY / "docs" / "bench.md").read_text("utf-8")
    path, _, *arguments = shlex.split(re.findall(r"^PYTHONPATH=.*mbf bench.*--levels.*$", page, re.MULTILINE)[0])
    monkeypatch.syspath_prepend(str(REPOSITORY / path.removeprefix("PYTHONPATH=")))
    monkeypatch.chdir(tmp_path)

    asked = CliRunner().invoke(make_app(), [*arguments, "--workers", "1"])  # one process fewer to start

    assert asked.exit_code == 0, asked.output
    assert "straight_planner:StraightPlanner, level 0, seed 0: SUCCESS: goal reached" in asked.output
    folder = tmp_path / arguments[arguments.index("--out") + 1]
    log = (folder / "runs.jsonl").read_bytes()
    (run,) = json.loads((folder / "results.json").read_text())["runs"]
    assert run["success"] and run["route"] and run["entry"] == "straight_planner:StraightPlanner"
    assert "straight_planner:StraightPlanner" in (folder / "leaderboard.html").read_text()

    again = CliRunner().invoke(make_app(), [*arguments, "--json"])

    assert (folder / "runs.jsonl").read_bytes() == log
    lines = {line["entry"]: line for line in json.loads(again.stdout)["standings"]}
    assert lines["straight_planner:StraightPlanner"]["share"] == 1.0
    assert {"any_angle", "cvp"} < lines.keys(), "the shipped planners stand beside it"


def test_planners_that_raise_crash_or_return_no_plan_have_their_reason_and_the_others_drive(tmp_path, monkeypatch):
    (tmp_path / "bad_planners.py").write_text(BAD_PLANNERS)
    (tmp_path / "nav.yaml").write_text(NAVIGATION)
    monkeypatch.syspath_prepend(str(tmp_path))
    scenario = Scenario(
        name="level 0",
        proves="A short drive.",
        backend="mesh",
        navigation={"mesh": tmp_path / "nav.yaml"},
        world=GeneratedWorld(type="generated", size=(6.0, 5.0), spacing=0.5),
        robot="turtlebot",
        start=PlanarPose(x=2.0, y=2.5),
        goals=(PlanarPose(x=4.0, y=2.5),),
        physics="kinematic",
        time_limit=20.0,
    )
    names = ["Raises", "Garbage", "Crashes"]
    entries = [Entry(name, "mesh", {"planner": f"bad_planners:{name}"}) for name in names]
    entries.append(Entry("good", "mesh", {"planner": "dijkstra"}))
    protocol = Protocol("tiny", "v1", "", "mesh", [Trial(scenario, 0)], {"success": ""}, always, {})

    rows = {row["entry"]: row for row in run_trials(protocol, entries, tmp_path, workers=1, time_limit=600.0)}

    assert rows["good"]["success"] and not any(rows[name]["success"] for name in names)
    assert {rows[name]["failure"] for name in names} == {"error"}
    assert rows["Raises"]["verdict"] == "ZeroDivisionError: no idea"
    assert rows["Garbage"]["verdict"] == "AttributeError: 'dict' object has no attribute 'success'"
    assert rows["Crashes"]["verdict"] == "crashed: the process of the run ended with code 3"
