"""A run that arrives and drives into people is no success, wherever one looks."""

import json
import re

import pytest

from command_line import mbf
from mbf_abstract.event_sinks import read_events
from mbf_abstract.events import EventKind
from terrain.recording.run_folder import read_run
from terrain.scenarios.library import LIBRARY
from terrain.sweeps.log import SweepLog
from terrain.viewer.pictures.colours import WARNING

pytestmark = [pytest.mark.timeout(300), pytest.mark.usefixtures("one_core")]


@pytest.fixture
def rude(tmp_path):
    """The crowded corridor, with people who do not look where they walk; with seed 1 the robot arrives nevertheless."""
    text = (LIBRARY / "crowded_corridor.yaml").read_text()
    text = re.sub(r"(type: (walker|crowd))", r"\1, blind: true", text).replace("config/", f"{LIBRARY}/config/")
    (tmp_path / "rude.yaml").write_text(text)
    return tmp_path / "rude.yaml"


def test_a_contact_while_the_robot_moves_fails_the_run_everywhere(rude, tmp_path):
    run = mbf("run", rude, "--seed", "1", "--out", tmp_path / "run", "--quiet")

    metrics = json.loads((tmp_path / "run" / "metrics.json").read_text())
    count = metrics["collisions_while_moving"]
    verdict = (
        f"ARRIVED WITH FAILURES: contacts while the robot moved: {count} (person) (navigation: SUCCESS, goal reached)"
    )
    assert run.exit_code == 1
    assert verdict in run.stdout
    assert (metrics["success"], metrics["level"], metrics["outcome"]) == (False, "arrived", "SUCCESS")
    assert metrics["verdict"] == verdict
    events = [
        event.data for event in read_events(tmp_path / "run" / "events.jsonl") if event.kind is EventKind.INCIDENT
    ]
    contacts = [data for data in events if data["what"] == "collision_with_person"]
    at_fault = [data for data in events if data["what"].startswith("collision") and data["moved"] in ("robot", "both")]
    assert len(contacts) == metrics["collisions"] and len(at_fault) >= count
    assert sum(data["what"] == "near_miss" for data in events) == metrics["near_misses"]
    recording, _ = read_run(tmp_path / "run")
    assert (recording.verdict.success, str(recording.verdict)) == (False, verdict)
    report = (tmp_path / "run" / "report.html").read_text()
    assert f'<p class="outcome arrived">{verdict}</p>' in report
    replay = (tmp_path / "run" / "replay.html").read_text()
    assert f'<p id="verdict" style="color:{WARNING}">{verdict}</p>' in replay
    assert f"replay: {(tmp_path / 'run' / 'replay.html').as_uri()}" in run.stdout
    compared = mbf("compare", tmp_path / "run", tmp_path / "run", "--out", tmp_path / "compare.html")
    assert f"run: {verdict}" in compared.stdout and verdict in (tmp_path / "compare.html").read_text()


def test_a_sweep_reports_the_verdict_and_counts_no_success(rude, tmp_path):
    swept = mbf("sweep", rude, "--seeds", "1:2", "--out", tmp_path / "sweep")

    with SweepLog(tmp_path / "sweep" / "runs.jsonl") as log:
        (row,) = log.rows.values()
    assert row["success"] is False and row["verdict"].startswith("ARRIVED WITH FAILURES: ")
    assert f"seed 1: {row['verdict']}" in swept.stdout
    assert "ARRIVED WITH FAILURES: " in (tmp_path / "sweep" / "sweep.csv").read_text()
    assert 'class="arrived"' in (tmp_path / "sweep" / "sweep.html").read_text()
