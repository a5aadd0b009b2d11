"""The folder of a run: its recording, written in parts while the run goes on, and its results, read again.

Each part holds two seconds of the run and is written atomically, so that a killed run can be replayed. After an orderly
end, the recording is written in one file and the parts are removed.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from mbf_abstract.event_bus import EventBus
from mbf_abstract.events import Event, EventKind, EventSink
from mbf_abstract.geometry import FloatArray
from terrain.recording.metrics import measure
from terrain.recording.recorded_maps import RecordedMesh
from terrain.recording.recorded_robot import joined_reports
from terrain.recording.recorder import Recorder
from terrain.recording.recording import Recording, RecordingError

RESULTS = (
    *("metrics.json", "timing.json", "recording.npz", "picture.png", "report.html", "replay.html", "run.mcap"),
    "provenance.yaml",
)
PARTS = "recording.parts"
ROWS = ("times", "poses", "twists", "commands", "scan_origins")
PERIOD = 2.0  # s of the run in one part; to write one takes about a millisecond


class RecordingParts(EventSink):
    """Writes what a recorder has got, part by part; a sink of the run's events, too.

    Parameters
    ----------
    folder : Path
        Of the run.
    earlier : sequence of Event
        Those that happened before this sink was there.
    origin : callable
        The events' time [s] at which the samples' time was 0.
    """

    def __init__(
        self,
        folder: Path,
        recorder: Recorder,
        events: EventBus,
        earlier: tuple[Event, ...],
        origin: Callable[[], float],
    ) -> None:
        self._folder = folder / PARTS
        self._recorder = recorder
        self._bus = events
        self._events = list(earlier)
        self._origin = origin
        self._next = 0.0
        self._count = 0
        self._failed = False
        events.add_sink(self)

    def write(self, event: Event) -> None:
        """Keep an event for the next part."""
        self._events.append(event)

    def after_step(self, time: float) -> None:
        """Write the next part if it is due; on the simulator's thread, ``time`` [s] is simulated."""
        if time >= self._next:
            self._next = time + PERIOD
            self._flush()

    def end(self) -> None:
        """Write what has come since the last part of a run that has begun."""
        if self._count:
            self._flush()

    def _flush(self) -> None:
        """Write the next part; a full disk is reported once and ends the parts."""
        if self._failed:
            return
        events, self._events = self._events, []
        try:
            self._folder.mkdir(exist_ok=True)
            part = self._recorder.take(tuple(events), self._origin())
            part.save(self._folder / f"{self._count:06d}.npz", compress=False)
            self._count += 1
        except OSError as error:
            self._failed = True
            self._bus.emit(EventKind.SINK_FAILED, "recording", sink=PARTS, message=f"{type(error).__name__}: {error}")

    def remove(self) -> None:
        """Remove the parts; the whole recording is on the disk."""
        remove_parts(self._folder.parent)


def remove_parts(folder: Path) -> None:
    """Remove the parts from a run's folder, if there are any."""
    shutil.rmtree(folder / PARTS, ignore_errors=True)


def has_parts(folder: Path) -> bool:
    """Whether a run's folder holds parts of a recording."""
    return any((folder / PARTS).glob("[0-9]*.npz"))


def read_parts(folder: Path) -> Recording:
    """Join the parts that a run has left in its folder.

    Raises
    ------
    RecordingError
        There are none, or one of them is damaged.
    """
    parts = [Recording.load(file) for file in sorted((folder / PARTS).glob("[0-9]*.npz"))]
    if not parts:
        raise RecordingError(f"{folder / PARTS}: holds no part of a recording")
    try:
        whole: dict[str, Any] = {name: _rows(parts, name) for name in ROWS}
        whole |= {name: _joined(parts, name) for name in ("paths", "scans", "grids", "layers", "objects")}
        return replace(
            parts[0],
            **whole,
            goals=parts[-1].goals,
            events=tuple(_joined(parts, "events")),
            meshes=_with_surface(_joined(parts, "meshes")),
            reports=joined_reports([part.reports for part in parts]),
            actors=[
                replace(track, poses=np.concatenate([part.actors[number].poses for part in parts]))
                for number, track in enumerate(parts[0].actors)
            ],
        )
    except (ValueError, IndexError) as error:
        raise RecordingError(f"{folder / PARTS}: parts that do not belong together: {error}") from error


def _rows(parts: list[Recording], name: str) -> FloatArray:
    return np.concatenate([getattr(part, name) for part in parts])


def _joined(parts: list[Recording], name: str) -> list[Any]:
    return [item for part in parts for item in getattr(part, name)]


def _with_surface(meshes: list[RecordedMesh]) -> list[RecordedMesh]:
    """Give all records the surface, which only the first one has."""
    return [replace(mesh, vertices=meshes[0].vertices, faces=meshes[0].faces) for mesh in meshes]


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


def is_run(folder: Path) -> bool:
    """Whether a folder has the recording of a robot, whole or of a run that was cut short."""
    return (folder / "recording.npz").is_file() or has_parts(folder)


def robots_of(folder: Path) -> list[str]:
    """Return the names of the robots that have a recording in a run's folder, sorted; "" for a run with one robot.

    A folder without any recording counts as that of one robot.
    """
    if is_run(folder) or not folder.is_dir():
        return [""]
    return sorted(part.name for part in folder.iterdir() if part.is_dir() and is_run(part)) or [""]


def clear_results(folder: Path) -> None:
    """Remove the results of an earlier run, so that they are not mistaken for new ones."""
    for name in RESULTS:
        (folder / name).unlink(missing_ok=True)
    remove_parts(folder)
