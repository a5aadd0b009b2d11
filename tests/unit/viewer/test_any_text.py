"""No text of a run, whatever is in it, keeps its results from being made whole."""

import base64
import io
import json
import re
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image
from rich.console import Console
from typer.testing import CliRunner

from mbf_abstract.cli import make_app
from mbf_abstract.commands.reporting import readable_errors
from mbf_abstract.config.yaml_source import load_yaml
from mbf_abstract.event_bus import EventBus
from mbf_abstract.event_sinks import MemorySink
from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.goals.result_types import MoveBaseResult
from mbf_abstract.whole_files import replacing, write_whole
from terrain.commands.live_line import LiveLine
from terrain.physics.robot_models import HUSKY
from terrain.recording.metrics import measure
from terrain.recording.recorded_robot import RobotShape
from terrain.recording.recorder import Recorder
from terrain.recording.verdict import judge
from terrain.scenarios.limits import Limits
from terrain.viewer import results
from terrain.viewer.pictures.animation import write_animation
from terrain.viewer.pictures.run_picture import picture_png
from terrain.viewer.results import write_results

TEXTS = [
    r"$\frac$", "$$", "$x_{", "\ud800", "a\udfff b", "[/x]", "[bold]", "</script><b>", "\x00\x07", "x" * 20_000,
    "\u202e\U0001f600", "走廊", "{0}%s",
]  # fmt: skip
CALM = {
    "max_tilt_deg": 5.0,
    "path_length_m": 10.0,
    "incidents": [],
    "collisions_while_moving": 0,
    "tip_overs": 0,
    "arrivals": [],
    "arrival_tolerance": (0.4, 180.0),
}


def run_called(text):
    """A short run in which everything that can have a name has this one."""
    memory = MemorySink()
    bus = EventBus(lambda: 0.1, [memory])
    bus.emit(EventKind.FAULT, text, message=text, where=text)
    bus.emit(EventKind.GOAL_FINISHED, "move_base", goal_id=1, outcome=0, message=text)
    recorder = Recorder(text, text, RobotShape.of(HUSKY), Pose.planar(0.0, 0.0), [Pose.planar(1.0, 0.0)])
    for step in range(11):
        recorder.sample(0.1 * step, Pose.planar(0.1 * step, 0.0), Twist.planar(1.0), Twist.planar(1.0))
    return recorder.finish(judge(MoveBaseResult(0, text), Limits(), CALM), memory.events)


@pytest.mark.parametrize("text", TEXTS, ids=lambda text: ascii(text[:12]))
def test_a_name_or_message_ruins_no_result(text, tmp_path):
    run = run_called(text)

    problems = write_results(tmp_path, run, measure(run).to_json() | run.verdict.to_json())
    run.save(tmp_path / "recording.npz")
    write_animation(tmp_path / "animation.gif", run)

    assert problems == []
    made = {"picture.png", "report.html", "replay.html", "run.mcap", "recording.npz", "animation.gif"}
    assert {file.name for file in tmp_path.iterdir()} == made
    assert max(Image.open(io.BytesIO((tmp_path / "picture.png").read_bytes())).size) < 4000
    assert (tmp_path / "report.html").read_text(encoding="utf-8").endswith("</html>")


def test_what_cannot_be_made_is_reported_and_the_rest_is_made(hill_recording, tmp_path, monkeypatch):
    def broken(recording):
        raise ValueError("no ink")

    monkeypatch.setattr(results, "picture_png", broken)
    problems = write_results(tmp_path, hill_recording, {})

    assert problems == ["picture.png could not be made: ValueError: no ink"]
    assert {file.name for file in tmp_path.iterdir()} == {"report.html", "replay.html", "run.mcap"}


def test_the_report_shows_the_picture_that_has_been_drawn(hill_recording, tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr(results, "picture_png", lambda recording: drawn.append(recording) or picture_png(recording))
    monkeypatch.delattr("terrain.viewer.reports.report.picture_png")

    assert write_results(tmp_path, hill_recording, {}) == []

    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    shown = Image.open(io.BytesIO(base64.b64decode(re.search(r"base64,([^\"]+)", page).group(1)))).convert("RGB")
    alone = Image.open(tmp_path / "picture.png").convert("RGB")
    assert np.abs(np.asarray(shown).astype(int) - np.asarray(alone)).mean() < 2.0, "of 255, in the mean"
    assert drawn == [hill_recording]


def test_a_file_that_could_not_be_written_whole_stays_as_it_was(tmp_path):
    file = tmp_path / "metrics.json"
    write_whole(file, "old \ud800\n")
    with pytest.raises(OSError, match="full"), replacing(file) as part:
        part.write_text("ne")
        raise OSError("disk full")
    assert file.read_bytes() == b"old \\ud800\n"
    assert list(tmp_path.iterdir()) == [file]


def test_half_a_surrogate_pair_in_a_yaml_file_is_spelled_out(tmp_path):
    (tmp_path / "a.yaml").write_text('name: "a\\ud800b"\n"k\\udc00": [1]\n')
    assert load_yaml(tmp_path / "a.yaml").data == {"name": "a\\ud800b", "k\\udc00": [1]}


def test_notes_and_steps_are_no_markup():
    console = Console(file=io.StringIO(), width=40, force_terminal=True)
    with LiveLine(console=console) as live:
        live.step("[/x]")
        live.note("[/x] " + "long " * 20)
    assert "[/x]" in console.file.getvalue()
    assert "long " * 19 in console.file.getvalue(), "an address must not be broken into lines"


@pytest.mark.parametrize(
    ("error", "reported"),
    [
        (MemoryError(), "error: not enough memory for that\n"),
        (MemoryError("Unable to allocate 5 GiB"), "error: not enough memory for that: Unable to allocate 5 GiB\n"),
        (ValueError(), "error: ValueError\n"),
        (RuntimeError("  "), "error: RuntimeError\n"),
        (OSError("no disk"), "error: no disk\n"),
    ],
    ids=repr,
)
def test_every_error_says_something(error, reported, capsys):
    with pytest.raises(BaseException, match="2"), readable_errors():
        raise error
    assert capsys.readouterr().err == reported


def test_folders_with_odd_names_are_compared(hill_recording, tmp_path):
    runs = [tmp_path / "[" / "x]", tmp_path / "b[" / "x]"]
    for folder in runs:
        folder.mkdir(parents=True)
        replace(hill_recording, scenario="[/y]").save(folder / "recording.npz")
        (folder / "metrics.json").write_text(json.dumps({"digest": "[/z]"}))

    result = CliRunner(env={"COLUMNS": "500"}).invoke(
        make_app(), ["compare", *map(str, runs), "--out", str(tmp_path / "page.html")]
    )

    assert result.exit_code == 0, result.output
    assert "[: SUCCESS" in result.stdout and "b[: SUCCESS" in result.stdout
