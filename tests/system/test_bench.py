"""``mbf bench`` from the page of the documentation to the table, and plugins that do what they must not."""

import json
import re
import shlex
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

from command_line import mbf
from mbf_abstract.cli import make_app
from mbf_abstract.config.findings import ConfigError
from terrain.experiments.evaluation.all_sets import bench_all
from terrain.experiments.evaluation.bench import Asked
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
    page = (folder / "leaderboard.html").read_text()
    assert "straight_planner:StraightPlanner" in page and " 1 world; protocol" in page

    again = CliRunner().invoke(make_app(), [*arguments, "--json"])

    assert (folder / "runs.jsonl").read_bytes() == log
    lines = {line["entry"]: line for line in json.loads(again.stdout)["standings"]}
    assert lines["straight_planner:StraightPlanner"]["share"] == 1.0
    assert {"any_angle", "cvp"} < lines.keys(), "the shipped planners stand beside it"


def short_drive(folder, name="level 0"):
    """A drive of 2 m on a mesh, with its configuration in the folder."""
    (folder / "nav.yaml").write_text(NAVIGATION)
    return Scenario(
        name=name,
        proves="A short drive.",
        backend="mesh",
        navigation={"mesh": folder / "nav.yaml"},
        world=GeneratedWorld(type="generated", size=(6.0, 5.0), spacing=0.5),
        robot="turtlebot",
        start=PlanarPose(x=2.0, y=2.5),
        goals=(PlanarPose(x=4.0, y=2.5),),
        physics="kinematic",
        time_limit=20.0,
    )


def tiny(scenario, name="tiny", about="Tiny.", **more):
    rules = {"success": "it arrived"}
    return Protocol(name, "v1", about, "mesh", [Trial(scenario, 0)], rules, always, {}, **more)


def test_all_sets_are_driven_by_one_command_and_stand_on_one_page(tmp_path, capsys):
    sets = [tiny(short_drive(tmp_path)), tiny(short_drive(tmp_path, "level 1"), "people", part="blind")]
    asked = Asked({"planner": "dijkstra"}, "mesh", "<mine>", (), 1, 600.0, True, tmp_path / "out", "mbf bench all")

    bench_all(sets, asked)

    answers = json.loads(capsys.readouterr().out)
    assert [answer["protocol"]["name"] for answer in answers] == ["tiny", "people"]
    assert all(answer["standings"][0]["arrived"] == 1 for answer in answers)
    page = (tmp_path / "out" / "leaderboard.html").read_text()
    links = re.findall(r'href="([^"]*leaderboard.html)"', page)
    assert links == ["tiny_v1/leaderboard.html", "people_blind_v1/leaderboard.html"]
    assert page.count("&lt;mine&gt;") == 2 and "1 of 1" in page
    assert all(protocol.hash in page for protocol in sets)
    assert all((tmp_path / "out" / link).is_file() for link in links)


def test_nothing_is_driven_where_one_set_refuses_the_entry(tmp_path):
    sets = [
        tiny(short_drive(tmp_path)),
        replace(tiny(short_drive(tmp_path)), entries={"mine": Entry("mine", "mesh", {})}),
    ]
    asked = Asked({"planner": "dijkstra"}, "mesh", "mine", (), 1, 600.0, False, tmp_path / "out", "mbf bench all")

    with pytest.raises(ConfigError, match="a name of your own"):
        bench_all(sets, asked)

    assert not (tmp_path / "out").exists()


def test_an_entry_of_one_set_cannot_be_driven_beside_in_all(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(make_app(), ["bench", "all", "--planner", "dijkstra", "--beside", "any_angle"])
    assert done.exit_code == 2
    text = "Invalid value for --beside: expected all, as the sets have entries of their own, got 'any_angle'"
    assert text in " ".join(done.output.split())
    assert not list(tmp_path.iterdir())


def test_results_beside_that_are_not_there_are_refused_before_anything_is_driven(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = mbf("bench", "indoor", "--planner", "dijkstra", "--beside", "nowhere/results.json")
    assert done.exit_code == 2 and "Errno" not in done.output
    assert "for --beside: expected a results.json or the name of a shipped entry, got 'nowhere/" in done.output
    assert "there is no such file" in done.output and not list(tmp_path.iterdir())


def test_planners_that_raise_crash_or_return_no_plan_have_their_reason_and_the_others_drive(tmp_path, monkeypatch):
    (tmp_path / "bad_planners.py").write_text(BAD_PLANNERS)
    monkeypatch.syspath_prepend(str(tmp_path))
    names = ["Raises", "Garbage", "Crashes"]
    entries = [Entry(name, "mesh", {"planner": f"bad_planners:{name}"}) for name in names]
    entries.append(Entry("good", "mesh", {"planner": "dijkstra"}))
    protocol = tiny(short_drive(tmp_path))

    rows = {row["entry"]: row for row in run_trials(protocol, entries, tmp_path, workers=1, time_limit=600.0)}

    assert rows["good"]["success"] and not any(rows[name]["success"] for name in names)
    assert [rows[name]["failure"] for name in names] == ["planner", "planner", "error"]
    raised = "INTERNAL_ERROR: plugin 'bad_planners_Raises' raised ZeroDivisionError in make_plan: no idea"
    assert rows["Raises"]["verdict"] == raised
    garbage = "INTERNAL_ERROR: plugin 'bad_planners_Garbage' returned dict from make_plan, not PlanResult"
    assert rows["Garbage"]["verdict"] == garbage
    assert rows["Crashes"]["verdict"] == "crashed: the process of the run ended with code 3"
