"""Where a run's results go if the command line names no folder."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

RUNS = Path("runs")


def new_run_folder(parent: Path, now: datetime) -> Path:
    """Return a folder name made of the time that does not exist yet."""
    stamp = now.strftime("%Y-%m-%d_%H-%M-%S")
    names = [stamp, *(f"{stamp}_{number}" for number in range(2, 1000))]
    return next(parent / name for name in names if not (parent / name).exists())
