"""``mbf run`` refuses what it cannot run, and drives a real building end to end."""

import json
import os

import pytest
import typer
from typer.testing import CliRunner

from mbf_abstract.geometry import Pose, Twist
from terrain.commands.run import register
from terrain.physics.robot_models import HUSKY
from terrain.recording.recorded_robot import RobotShape
from terrain.recording.recorder import Recorder
from terrain.recording.recording import Recording
from terrain.recording.verdict import Verdict


def mbf(*arguments):
    app = typer.Typer(pretty_exceptions_enable=False)
    register(app)
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def test_an_unknown_scenario_is_exit_code_2_and_the_known_ones_are_named():
    result = mbf("run", "moon")

    assert result.exit_code == 2
    assert "moon" in result.output and "outdoor" in result.output
    assert "Traceback" not in result.output


def test_a_backend_the_scenario_has_no_configuration_for_is_exit_code_2(tmp_path):
    result = mbf("run", "indoor", "--backend", "voxels", "--out", tmp_path, "--quiet")

    assert result.exit_code == 2
    assert "voxels" in result.output


def test_scenarios_are_listed_with_what_they_prove():
    result = mbf("scenarios")

    assert result.exit_code == 0
    for name in ("indoor", "outdoor"):
        assert any(line.startswith(name) and "[" in line for line in result.stdout.splitlines())


def test_a_run_through_a_real_building_reaches_its_goal_and_leaves_all_files(shared_data, tmp_path):
    building = shared_data / "maps" / "nav2_bringup" / "depot.yaml"

    result = mbf("run", "indoor", "--map", building, "--out", tmp_path / "run", "--json")

    answer = json.loads(result.stdout)
    assert (result.exit_code, answer["success"]) == (0, True), result.output
    files = {file.name for file in (tmp_path / "run").iterdir()}
    assert {"picture.png", "report.html", "replay.html", "run.mcap"} <= files
    assert {"events.jsonl", "metrics.json", "recording.npz"} <= files
    recording = Recording.load(tmp_path / "run" / "recording.npz")
    assert recording.verdict.success and recording.paths and recording.scans and recording.grids
    assert answer["metrics"]["distance_to_goal_m"] < 0.5


def save_a_short_run(folder):
    shape = RobotShape.of(HUSKY)
    recorder = Recorder("straight", "mesh", shape, Pose.planar(0.0, 0.0), [Pose.planar(1.0, 0.0)])
    for step in range(11):
        recorder.sample(0.1 * step, Pose.planar(0.1 * step, 0.0), Twist.planar(1.0), Twist.planar(1.0))
    recorder.finish(Verdict(0, "goal reached")).save(folder / "recording.npz")


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # the browser lives on, as it should
def test_the_replay_is_opened_in_the_browser(tmp_path, monkeypatch):
    opened, folder = tmp_path / "opened", tmp_path / "run"
    os.mkfifo(opened)
    browser = tmp_path / "xdg-open"
    browser.write_text(f'#!/bin/sh\necho "$1" > {opened}\n')
    browser.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=os.pathsep)
    folder.mkdir()
    save_a_short_run(folder)

    result = mbf("replay", folder)

    assert result.exit_code == 0, result.output
    assert opened.read_text().strip().removeprefix("file://") == str(folder / "replay.html")


def test_a_replay_is_made_again_from_the_recording_alone(tmp_path):
    save_a_short_run(tmp_path)

    result = mbf("replay", tmp_path, "--no-open")

    assert result.exit_code == 0, result.output
    made = {"picture.png", "report.html", "replay.html", "run.mcap"}
    assert {file.name for file in tmp_path.iterdir()} == {"recording.npz", *made}


def test_a_folder_without_a_recording_is_exit_code_2(tmp_path):
    result = mbf("replay", tmp_path)

    assert result.exit_code == 2
    assert "recording.npz" in result.output
