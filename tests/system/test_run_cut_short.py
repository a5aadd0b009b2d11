"""What a run has done until it is killed, at whatever moment and by whatever signal, can be replayed."""

import json
import os
import shutil
import signal
import subprocess
import sys
from contextlib import suppress
from functools import partial

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

import terrain
from mbf_abstract.cli import make_app
from mbf_abstract.events import EventKind
from terrain.recording.recording import Recording, RecordingError
from terrain.recording.run_folder import PARTS, read_parts, read_run
from terrain.scenarios.actors import Walker
from terrain.scenarios.scenario import PlanarPose, load_scenario
from terrain.session.runner import RunOptions, run_scenario
from terrain.viewer.live.session import LiveSession, ViewOptions

pytestmark = [pytest.mark.timeout(300), pytest.mark.usefixtures("one_core")]

SCENARIO = {
    "name": "corridor",
    "proves": "A run that is killed leaves what it has done.",
    "backend": "costmap",
    "navigation": {"costmap": f"{terrain.__path__[0]}/scenarios/library/config/indoor_costmap.yaml"},
    "world": {"type": "office"},
    "physics": "kinematic",
    "robot": "turtlebot",
    "start": "corridor_west",
    "goals": [{"x": 14.5, "y": 12.6}],
    "sensors": [{"name": "lidar", "rays": 180, "max_range": 8.0}],
}

PATIENT = ("--set", "tf_timeout=100", "--set", "controller_patience=100", "--set", "planner_patience=100")
"""A machine that is busy has the run stand still for seconds, which are no fault here."""

PROGRAM = """
import signal
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell lets its background jobs ignore it
from mbf_abstract.cli import main
main()
"""


@pytest.fixture
def slow_run(tmp_path):
    """Start ``mbf run`` in real time; returns the process and its folder once some seconds have been driven."""
    (tmp_path / "corridor.yaml").write_text(yaml.safe_dump(SCENARIO))
    start = [sys.executable, "-c", PROGRAM, "run", str(tmp_path / "corridor.yaml")]
    process = subprocess.Popen(
        [*start, *PATIENT, "--wall-clock", "--out", str(tmp_path / "run")],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip
    while not (tmp_path / "run" / PARTS / "000002.npz").is_file() or read_parts(tmp_path / "run").duration <= 2.9:
        with suppress(subprocess.TimeoutExpired):  # to look all the time takes the run's own core
            pytest.fail(f"it ended with {process.wait(timeout=0.2)}: {process.communicate()}")
    yield process, tmp_path / "run"
    process.kill()
    process.communicate()


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT], ids=lambda number: number.name)
def test_a_run_that_is_killed_is_replayed_as_far_as_it_came(slow_run, number):
    process, folder = slow_run
    os.kill(process.pid, number)
    _, reported = process.communicate()

    result = CliRunner().invoke(make_app(), ["replay", str(folder), "--no-open"])

    assert process.returncode != 0 and not (folder / "recording.npz").exists()
    assert result.exit_code == 0, result.output
    assert {"picture.png", "report.html", "replay.html", "run.mcap"} <= {file.name for file in folder.iterdir()}
    recording, metrics = read_run(folder)
    assert metrics["verdict"] == "UNFINISHED: the run was cut short" and metrics["success"] is False
    assert recording.duration > 2.9 and np.all(np.diff(recording.times) >= 0.0)
    assert recording.ground is not None and recording.paths and recording.scans and recording.grids
    assert any(event.kind is EventKind.GOAL_ACCEPTED for event in recording.events)
    assert number is not signal.SIGINT or "mbf replay" in reported


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """A run with somebody who walks, its parts kept: as whole recording and in parts."""
    scenario = load_scenario("crowded_corridor").model_copy(
        update={
            "physics": "kinematic",
            "goals": (PlanarPose(x=5.0, y=9.7),),
            "actors": (Walker(type="walker", route=((12.0, 9.0), (14.0, 9.0)), speed=0.5),),
        }
    )
    folder, kept = tmp_path_factory.mktemp("run"), tmp_path_factory.mktemp("kept")

    def keep(progress):
        if (folder / PARTS).is_dir():
            shutil.copytree(folder / PARTS, kept / PARTS, dirs_exist_ok=True)

    result = run_scenario(scenario, RunOptions(folder, on_progress=keep))
    assert result.success, result.verdict
    return folder, kept


def test_the_parts_of_a_run_are_its_recording_and_go_when_it_is_whole(recorded):
    folder, kept = recorded
    whole, joined = Recording.load(folder / "recording.npz"), read_parts(kept)

    assert not (folder / PARTS).exists()
    count = len(joined.times)
    assert len(whole.times) - 40 < count <= len(whole.times)
    for name in ("times", "poses", "twists", "commands"):
        np.testing.assert_array_equal(getattr(joined, name), getattr(whole, name)[:count])
    np.testing.assert_array_equal(joined.actors[0].poses, whole.actors[0].poses[:count])
    np.testing.assert_array_equal(joined.ground.vertices, whole.ground.vertices)
    assert joined.events == whole.events[: len(joined.events)]
    for name in ("paths", "scans"):
        theirs, ours = getattr(joined, name), getattr(whole, name)
        assert 0 < len(theirs) <= len(ours)
        for (stamp, points), (their_stamp, their_points) in zip(ours, theirs, strict=False):
            assert stamp == their_stamp
            np.testing.assert_array_equal(points, their_points)
    assert [grid.time for grid in joined.grids] == [grid.time for grid in whole.grids][: len(joined.grids)]


def test_a_part_that_was_being_written_is_left_out_and_a_damaged_one_is_named(recorded, tmp_path):
    _, kept = recorded
    shutil.copytree(kept / PARTS, tmp_path / PARTS)
    before = read_parts(tmp_path)
    (tmp_path / PARTS / ".000099.1234.part.npz").write_bytes(b"PK half a file")
    assert len(read_parts(tmp_path).times) == len(before.times)

    (tmp_path / PARTS / "000001.npz").write_bytes(b"PK")
    with pytest.raises(RecordingError, match=r"000001\.npz"):
        read_parts(tmp_path)


def test_a_new_run_in_the_same_folder_starts_from_nothing(recorded, tmp_path):
    """Else what an earlier run has left would be taken for that of one that was killed early."""
    folder = tmp_path / "run"
    shutil.copytree(recorded[0], folder)
    shutil.copytree(recorded[1] / PARTS, folder / PARTS)
    (folder / "report.html").write_text("of the earlier run")
    scenario = load_scenario("crowded_corridor")

    def stop(progress):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_scenario(scenario, RunOptions(folder, on_step=stop))

    left = {file.name for file in folder.iterdir()}
    assert not left & {"recording.npz", "metrics.json", "report.html", PARTS}


def test_a_disk_that_takes_no_parts_is_reported_once_and_the_run_goes_on(tmp_path):
    scenario = load_scenario("crowded_corridor").model_copy(
        update={"physics": "kinematic", "goals": (PlanarPose(x=4.0, y=9.7),), "actors": ()}
    )

    def block(progress):
        if (tmp_path / PARTS).is_dir():
            shutil.rmtree(tmp_path / PARTS)
            (tmp_path / PARTS).write_text("in the way")

    result = run_scenario(scenario, RunOptions(tmp_path, on_progress=block))

    assert result.success, result.verdict
    lines = [json.loads(line) for line in (tmp_path / "events.jsonl").read_text().splitlines()]
    assert [line["source"] for line in lines if line["kind"] == "sink_failed"] == ["recording"]


@pytest.mark.parametrize("stay", [False, True])
def test_a_simulation_that_fails_ends_the_run_with_its_error(tmp_path, stay):
    """And does not leave whoever waits for a goal, or for Ctrl-C to be heard, waiting for ever."""
    scenario = load_scenario("crowded_corridor").model_copy(update={"physics": "kinematic", "actors": ()})

    def fail(progress):
        if progress.time > 3.0:
            raise ValueError("the floor has gone")

    notes = []
    watch = partial(LiveSession, options=ViewOptions(port=18800, speed=0.0)) if stay else RunOptions.watch
    with pytest.raises(ValueError, match="the floor has gone"):
        options = RunOptions(tmp_path, on_progress=fail, watch=watch, stay=stay, on_note=notes.append)
        run_scenario(scenario, options)

    assert "mbf replay" in notes[-1]
    assert read_parts(tmp_path).duration > 2.9
