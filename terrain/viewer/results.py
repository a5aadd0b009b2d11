"""Everything of a run that is looked at, made from its recording: picture, report, replay and log for Foxglove."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from terrain.recording import Recording
from terrain.viewer.picture import ViewerMissing, write_picture
from terrain.viewer.replay import write_replay
from terrain.viewer.report import write_report


def write_results(
    folder: Path, recording: Recording, metrics: Mapping[str, Any], on_step: Callable[[str], None] = lambda text: None
) -> None:
    """Write picture.png, report.html, replay.html and run.mcap; raises ViewerMissing without what they need."""
    on_step("drawing the picture")
    write_picture(folder / "picture.png", recording)
    on_step("writing the report")
    write_report(folder / "report.html", recording, metrics)
    on_step("writing the replay")
    write_replay(folder / "replay.html", recording)
    on_step("writing the log for Foxglove")
    _write_log(folder / "run.mcap", recording)


def _write_log(file: Path, recording: Recording) -> None:
    try:
        from terrain.viewer.mcap_log import write_mcap
    except ImportError as error:
        raise ViewerMissing(f"run.mcap needs mcap and its schemas: pip install 'mbf-flex[sim]' ({error})") from error
    write_mcap(file, recording)
