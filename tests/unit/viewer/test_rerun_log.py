"""run.rrd, read back with Rerun's own reader."""

import numpy as np
import pytest
from typer.testing import CliRunner

from mbf_abstract.cli import make_app
from terrain.viewer.logs.rerun_log import write_rrd

chunks = pytest.importorskip("rerun.chunk", reason="Rerun has no packages for this Python")


@pytest.fixture
def columns(office_recording, tmp_path):
    """All columns of the file by entity and name."""
    write_rrd(tmp_path / "run.rrd", office_recording)
    found = {}
    for chunk in chunks.RrdReader(tmp_path / "run.rrd").store().stream():
        batch = chunk.to_record_batch()
        for name in batch.schema.names:
            column = batch.column(name).cast("int64") if name == "run" else batch.column(name)
            found.setdefault((chunk.entity_path, name), []).extend(column.to_pylist())
    return found


def test_the_robot_drives_the_recorded_track_on_the_recorded_times(columns, office_recording):
    places = np.array(columns["/world/robot", "Transform3D:translation"]).reshape(-1, 3)
    times = np.array(columns["/world/robot", "run"]) / 1e9

    np.testing.assert_allclose(places, office_recording.poses[:, :3], atol=1e-5)
    np.testing.assert_allclose(times, office_recording.times, atol=1e-9)


def test_world_plans_scans_and_events_are_there(columns, office_recording):
    entities = {entity for entity, _ in columns}

    assert {f"/world/{name}" for name in ("ground", "walls", "obstacles", "marks", "track", "plan", "scan")} <= entities
    assert len(columns["/world/scan", "Points3D:positions"]) == len(office_recording.scans)
    assert len(columns["/events", "TextLog:text"]) == len(office_recording.events)


def test_the_command_writes_it_and_an_animation_on_request(hill_recording, tmp_path):
    hill_recording.save(tmp_path / "recording.npz")

    asked = CliRunner().invoke(make_app(), ["replay", str(tmp_path), "--no-open", "--rrd", "--gif"])

    assert asked.exit_code == 0, asked.output
    assert (tmp_path / "run.rrd").stat().st_size > 10_000
    assert (tmp_path / "animation.gif").stat().st_size > 10_000
