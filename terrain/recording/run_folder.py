"""The folder of a run: its recording and its numbers, read again."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from terrain.recording.metrics import measure
from terrain.recording.recording import Recording
from terrain.recording.recording_parts import has_parts, read_parts, remove_parts

RESULTS = ("metrics.json", "timing.json", "recording.npz", "picture.png", "report.html", "replay.html", "run.mcap")


def read_run(folder: Path) -> tuple[Recording, dict[str, Any]]:
    """Return the recording and the metrics of a run's folder; of a run that was cut short, up to its end.

    What only the run itself knew, as slip and wall time, is there if metrics.json and timing.json are; all else is
    measured again. Raises RecordingError for a folder without a readable recording.
    """
    cut_short = has_parts(folder) and not (folder / "recording.npz").is_file()
    recording = read_parts(folder) if cut_short else Recording.load(folder / "recording.npz")
    metrics = measure(recording).to_json() | recording.verdict.to_json()
    for name in ("metrics.json", "timing.json"):
        if (folder / name).is_file():
            metrics |= json.loads((folder / name).read_text())
    return recording, metrics


def clear_results(folder: Path) -> None:
    """Remove the results of an earlier run, so that they are not mistaken for new ones."""
    for name in RESULTS:
        (folder / name).unlink(missing_ok=True)
    remove_parts(folder)
