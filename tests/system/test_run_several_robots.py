"""Several robots of a scenario, from the file to the results: each has a folder, and the run has them together."""

import hashlib
import json
import shutil

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from mbf_abstract.event_sinks import read_events
from mbf_abstract.events import EventKind
from terrain.commands.run import register
from terrain.provenance.rerun import rerun
from terrain.recording.joint_recording import JointRecording
from terrain.recording.recording import Recording
from terrain.recording.run_folder import read_run, robots_of
from terrain.recording.verdict import Verdict
from terrain.scenarios.scenario import load_scenario
from terrain.session.fleet import seed_of
from terrain.session.runner import RunOptions, run_scenario
from terrain.viewer.results import write_joint_results

pytestmark = pytest.mark.timeout(300)
NAMES = ["anna", "ben"]


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("couriers")
    return run_scenario(load_scenario("two_couriers"), RunOptions(folder, write_joint_views=write_joint_results))


def test_both_arrive_and_the_numbers_of_the_run_are_those_of_its_robots(run):
    metrics = json.loads((run.folder / "metrics.json").read_text())
    own = {name: json.loads((run.folder / name / "metrics.json").read_text()) for name in NAMES}
    assert run.success, run.verdict
    assert metrics["robots"] == own
    assert metrics["path_length_m"] == pytest.approx(sum(one["path_length_m"] for one in own.values()))
    assert metrics["contacts_between_robots"] == []
    assert [one["seed"] for one in own.values()] == [seed_of(0, name) for name in NAMES]
    digests = "".join(f"{name} {one['digest']}\n" for name, one in own.items())
    assert metrics["digest"] == hashlib.sha256(digests.encode()).hexdigest()


def test_the_log_of_the_run_holds_the_events_of_each_robot_with_its_name(run):
    joint = list(read_events(run.folder / "events.jsonl"))
    assert [event.time for event in joint] == sorted(event.time for event in joint)
    for name in NAMES:
        own = list(read_events(run.folder / name / "events.jsonl"))
        named = [event for event in joint if event.source.startswith(f"{name}/")]
        assert [event.source.removeprefix(f"{name}/") for event in named] == [event.source for event in own]
        assert [event.data for event in named] == [event.data for event in own]
        assert any(event.kind is EventKind.GOAL_FINISHED for event in own)


def test_each_recording_has_the_other_robot_in_it_where_that_one_has_recorded_itself(run):
    anna, ben = (Recording.load(run.folder / name / "recording.npz") for name in NAMES)
    (other,) = anna.actors
    assert other.thing == "robot"
    assert np.abs(other.poses[:, :2] - ben.poses[:, :2]).max() < 0.05
    assert np.array_equal(anna.times, ben.times)


def test_picture_and_replay_show_all_robots_and_the_folder_says_which_there_are(run, tmp_path):
    page = (run.folder / "replay.html").read_text(encoding="utf-8")
    assert (run.folder / "picture.png").stat().st_size > 10_000
    assert robots_of(run.folder) == NAMES
    assert robots_of(run.folder / "ben") == robots_of(tmp_path) == [""]
    assert all(f"{name}/move_base" in page for name in NAMES)
    recordings = {name: read_run(run.folder / name)[0] for name in NAMES}
    joint = JointRecording(recordings, Verdict(0, "good"))
    assert len(joint.world.goals) == 2 and joint.world.actors == []


def test_the_replay_of_a_run_with_several_robots_is_written_anew(run, tmp_path):
    folder = shutil.copytree(run.folder, tmp_path / "copy")
    for page in folder.rglob("*.html"):
        page.unlink()
    app = typer.Typer(pretty_exceptions_enable=False)
    register(app)
    result = CliRunner().invoke(app, ["replay", str(folder), "--no-open"])
    assert result.exit_code == 0, result.output
    assert {page.parent.name for page in folder.rglob("replay.html")} == {"copy", *NAMES}


def test_a_run_with_several_robots_repeats_from_its_folder_alone(run, tmp_path):
    repetition = rerun(run.folder, RunOptions(tmp_path / "again"))
    assert repetition.differences.same_drive
    assert repetition.changed_files == ()
    assert {"anna/navigation.yaml", "ben/navigation.yaml", "world.yaml"} <= set(repetition.provenance.files)
