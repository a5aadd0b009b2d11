"""A run that was left on the disk: its recording and its numbers, read again."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from terrain.metrics import measure
from terrain.recording import Recording


def read_run(folder: Path) -> tuple[Recording, dict[str, Any]]:
    """Return the recording and the metrics of a run's folder.

    What only the run itself knew, as slip and wall time, is there if metrics.json and timing.json are; all else is
    measured again. Raises RecordingError for a folder without a readable recording.
    """
    recording = Recording.load(folder / "recording.npz")
    metrics = measure(recording).to_json() | recording.verdict.to_json()
    for name in ("metrics.json", "timing.json"):
        if (folder / name).is_file():
            metrics |= json.loads((folder / name).read_text())
    return recording, metrics
